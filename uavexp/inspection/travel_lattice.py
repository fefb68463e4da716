"""Lattice of the places that the vehicle can reach, with the edges between them.

Nodes where the vehicle fits, joined to their 26 neighbours where it also fits halfway; only
the part joined to the start is kept.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from uavexp.arrays import Bool, Float, Int, Int32
from uavexp.errors import require_positive
from uavexp.field import DistanceField

EDGE_UNITS = 500  # of the longest edge: lengths are whole numbers, so buckets serve as queue
_STEPS = np.array(
    [(i, j, k) for i in (0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1) if (i, j, k) > (0, 0, 0)]
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Lattice:
    """Nodes that can be reached from the start, and the edges between them in compressed rows."""

    field: DistanceField
    clearance_m: float
    origin_m: Float  # (3,) of node (0, 0, 0)
    step_m: Float  # (3,)
    node: Int32  # (X, Y, Z) number of a node, -1: not reachable
    position_m: Float  # (M, 3)
    starts: Int32  # (M + 1,)
    ends: Int32  # (E,) both ways
    units: Int32  # (E,) length
    unit_m: float


def lattice_of(
    field: DistanceField,
    flight_bounds_m: Float,
    start_m: Float,
    clearance_m: float = 0.45,
    cell_m: float = 0.2,
    layer_m: float = 0.4,
) -> Lattice:
    """Lattice of the free space joined to a start.

    Args:
        field: distances to obstacles.
        flight_bounds_m: (2, 3) box that holds all nodes.
        start_m: (3,); its part of the lattice is that of the nearest node within three cells.
        clearance_m: that every node has.
        cell_m: horizontal spacing.
        layer_m: vertical spacing.

    Returns:
        the lattice; without nodes when the start is near none.
    """
    require_positive(clearance_m=clearance_m, cell_m=cell_m, layer_m=layer_m)
    step = np.array([cell_m, cell_m, layer_m])
    room = np.asarray(flight_bounds_m[1] - flight_bounds_m[0], dtype=np.float64)
    shape = np.maximum(np.floor(room / step + 1e-9).astype(int) + 1, 1)
    origin = np.asarray(flight_bounds_m[0]) + 0.5 * (room - (shape - 1) * step)
    points = origin + np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1) * step
    passable = (field.distance_m(points.reshape(-1, 3)) >= clearance_m).reshape(shape)
    position = points[passable]
    number = np.full(shape, -1, dtype=np.int32)
    number[passable] = np.arange(position.shape[0])
    pairs = _edges(field, number, position, clearance_m)
    part = _part_of(position, pairs, start_m, 3.0 * max(cell_m, layer_m))
    renumbered = np.cumsum(part, dtype=np.int32) - 1
    pairs = renumbered[pairs[part[pairs[:, 0]]]].astype(np.int64)
    position = position[part]
    number[passable] = np.where(part, renumbered, -1)
    unit = float(np.linalg.norm(step)) / EDGE_UNITS
    both = np.concatenate([pairs, pairs[:, ::-1]])
    both = both[np.lexsort((both[:, 1], both[:, 0]))]
    length = np.linalg.norm(position[both[:, 0]] - position[both[:, 1]], axis=1)
    return Lattice(
        field=field,
        clearance_m=clearance_m,
        origin_m=origin,
        step_m=step,
        node=number,
        position_m=position,
        starts=np.searchsorted(both[:, 0], np.arange(position.shape[0] + 1)).astype(np.int32),
        ends=np.ascontiguousarray(both[:, 1], dtype=np.int32),
        units=np.round(length / unit).astype(np.int32),
        unit_m=unit,
    )


def _edges(field: DistanceField, number: Int32, position: Float, clearance_m: float) -> Int:
    """Pairs of neighbouring nodes (E, 2) between which the vehicle fits, each once."""
    found = [np.zeros((0, 2), dtype=np.int64)]
    for step in _STEPS:
        here, there = [], []
        for axis, shift in enumerate(step):
            count = number.shape[axis]
            here.append(slice(max(-shift, 0), count - max(shift, 0)))
            there.append(slice(max(shift, 0), count - max(-shift, 0)))
        pair = np.stack([number[tuple(here)].ravel(), number[tuple(there)].ravel()], axis=1).astype(np.int64)
        pair = pair[(pair >= 0).all(axis=1)]
        halfway = 0.5 * (position[pair[:, 0]] + position[pair[:, 1]])
        found.append(pair[field.distance_m(halfway) >= clearance_m])
    return np.concatenate(found)


def _part_of(position: Float, pairs: Int, start_m: Float, reach_m: float) -> Bool:
    """Nodes (M,) joined to the one nearest to the start."""
    count = position.shape[0]
    apart = np.linalg.norm(position - start_m, axis=1)
    if count == 0 or not apart.min() <= reach_m:
        return np.zeros(count, dtype=np.bool_)
    graph = coo_matrix((np.ones(len(pairs), dtype=np.int8), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    _, label = connected_components(graph, directed=False)
    joined: Bool = label == label[apart.argmin()]
    return joined
