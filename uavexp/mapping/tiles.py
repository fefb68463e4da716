"""Which parts of a map have changed: a counter for each tile of columns (`DistanceField.changed`)."""

from __future__ import annotations

import numba as nb
import numpy as np

from uavexp.arrays import Int32
from uavexp.field import TILE


def no_changes(shape: tuple[int, int, int]) -> Int32:
    """Counters of a grid in which nothing has changed."""
    return np.zeros((-(-shape[0] // TILE), -(-shape[1] // TILE)), np.int32)


@nb.njit(cache=True)
def count_changes(voxel: Int32, shape: tuple[int, int, int], changed: Int32) -> None:
    """Raise the counters of the tiles that hold a changed voxel (N,), flat and ascending."""
    _, ny, nz = shape
    end = np.int32(0)  # of the column that was counted last
    for n in range(voxel.shape[0]):
        if voxel[n] >= end:
            column = voxel[n] // nz
            end = np.int32((column + 1) * nz)
            changed[column // ny // TILE, column % ny // TILE] += 1
