"""Which voxels are obstacles: occupied, and not alone (spatial continuity, Liao et al., 3.5)."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from uavexp.arrays import Bool
from uavexp.cloud.voxels import CloudVoxels, packed

_HALF_AROUND = np.array(
    [(i, j, k) for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1) if (i, j, k) > (0, 0, 0)]
)  # 13 of the 26 neighbours: the others are the same pairs


def obstacles(voxels: CloudVoxels, least_voxels: int) -> Bool:
    """Voxels (V,) that are not traversable: those of a joined group, by 26 neighbours, large enough.

    Args:
        voxels: non-empty ones.
        least_voxels: smaller groups are specks; empty space and specks are traversable.
    """
    count, index = len(voxels.key), voxels.index
    rows, columns = [], []
    for step in _HALF_AROUND:
        there = packed(index + step)
        place = np.minimum(np.searchsorted(voxels.key, there), count - 1)
        met = np.flatnonzero(voxels.key[place] == there)
        rows.append(met)
        columns.append(place[met])
    row, column = np.concatenate(rows), np.concatenate(columns)
    graph = coo_matrix((np.ones(len(row), dtype=np.int8), (row, column)), shape=(count, count))
    label = connected_components(graph, directed=False)[1]
    return np.asarray(np.bincount(label)[label] >= least_voxels)
