"""Samples sorted into cells of the search radius, and that radius."""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Float, Int

_MOST_CELLS = 1 << 16


class Neighbours(NamedTuple):
    """Rows of a table of positions, in the order of the cells they lie in."""

    radius_m: float
    low_m: Float  # (3,)
    cell_m: float  # edge of a cell, >= radius
    shape: Int  # (3,)
    first: Int  # (cells + 1,) where a cell's rows begin in `row`
    row: Int  # (N,)


@nb.njit(cache=True)
def radius_of(count: int, measure_m3: float, dimension: int, factor: float) -> float:
    """Radius below which a random geometric graph is no longer sure to hold near-optimal paths, m.

    r = factor * 2 (1 + 1/d)^(1/d) (measure / unit ball)^(1/3) (log n / n)^(1/d)
    (Karaman and Frazzoli 2011, as in BIT*). With velocity in the state d = 6, and the factor is
    not the theorem's, which is for straight edges: a choice.

    Args:
        count: samples, n.
        measure_m3: volume that they are spread over.
        dimension: of the state, d.
        factor: > 1 keeps the guarantee for straight edges.
    """
    n, d = max(count, 2), float(dimension)
    spread = (measure_m3 / (4.0 * np.pi / 3.0)) ** (1.0 / 3.0)
    return float(factor * 2.0 * (1.0 + 1.0 / d) ** (1.0 / d) * spread * (np.log(n) / n) ** (1.0 / d))


@nb.njit(cache=True)
def sort_into_cells(states: Float, count: int, radius_m: float) -> Neighbours:
    """Sort the positions of the first `count` rows (N, >= 3) into cells."""
    low, high = states[0, :3].copy(), states[0, :3].copy()
    for row in range(count):
        low, high = np.minimum(low, states[row, :3]), np.maximum(high, states[row, :3])
    cell = max(radius_m, 1e-6)
    shape = np.ones(3, dtype=np.int64)
    while True:
        for k in range(3):
            shape[k] = int((high[k] - low[k]) / cell) + 1
        if float(shape[0]) * float(shape[1]) * float(shape[2]) <= _MOST_CELLS:  # integers would wrap around
            break
        cell *= 1.5
    place = np.empty(count, dtype=np.int64)
    first = np.zeros(shape[0] * shape[1] * shape[2] + 1, dtype=np.int64)
    for row in range(count):
        i, j, k = ((states[row, :3] - low) / cell).astype(np.int64)
        place[row] = (i * shape[1] + j) * shape[2] + k
        first[place[row] + 1] += 1
    first = np.cumsum(first)
    ordered, used = np.empty(count, dtype=np.int64), first.copy()
    for row in range(count):
        ordered[used[place[row]]] = row
        used[place[row]] += 1
    return Neighbours(radius_m, low, cell, shape, first, ordered)


@nb.njit(cache=True)
def neighbours_within(cells: Neighbours, states: Float, row: int, out: Int) -> int:
    """Write the rows within the radius of a row, itself included, to `out`; returns how many."""
    x, y, z = states[row, 0], states[row, 1], states[row, 2]
    i = int((x - cells.low_m[0]) / cells.cell_m)
    j = int((y - cells.low_m[1]) / cells.cell_m)
    k = int((z - cells.low_m[2]) / cells.cell_m)
    reach, found = cells.radius_m * cells.radius_m, 0
    for a in range(max(i - 1, 0), min(i + 2, cells.shape[0])):
        for b in range(max(j - 1, 0), min(j + 2, cells.shape[1])):
            for c in range(max(k - 1, 0), min(k + 2, cells.shape[2])):
                cell = (a * cells.shape[1] + b) * cells.shape[2] + c
                for n in range(cells.first[cell], cells.first[cell + 1]):
                    other = cells.row[n]
                    dx, dy, dz = states[other, 0] - x, states[other, 1] - y, states[other, 2] - z
                    if dx * dx + dy * dy + dz * dz <= reach:
                        out[found] = other
                        found += 1
    return found
