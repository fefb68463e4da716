"""Frontier cells in clusters: joined ones, cut into cubes so that what has not changed stays one cluster."""

from __future__ import annotations

import numba as nb
import numpy as np

from uavexp.arrays import Int, Int32
from uavexp.explorer.volume.steps import Steps


@nb.njit(cache=True)
def _parts(cells: Int, steps: Steps, number: Int32) -> Int:
    """Number (F,) of the part of 26-connected cells (F,), ascending, that each belongs to.

    `number` (N,) is all zero, and is left so.
    """
    for n in range(cells.shape[0]):
        number[cells[n]] = n + 1
    part = np.full(cells.shape[0], -1, dtype=np.int64)
    stack = np.empty(cells.shape[0], dtype=np.int64)
    count = 0
    for first in range(cells.shape[0]):
        if part[first] >= 0:
            continue
        part[first], stack[0], waiting = count, first, 1
        while waiting > 0:
            waiting -= 1
            here = cells[stack[waiting]]
            for offset in steps.offset:
                near = number[here + offset] - 1
                if near >= 0 and part[near] < 0:
                    part[near], stack[waiting] = count, near
                    waiting += 1
        count += 1
    for n in range(cells.shape[0]):
        number[cells[n]] = 0
    return part


def clusters_of(cells: Int, index: Int, steps: Steps, number: Int32, least: int, most: int) -> list[Int]:
    """Clusters of frontier cells.

    Args:
        cells: (F,) flat, ascending.
        index: (F, 3) the same by axis.
        steps: on the grid.
        number: (N,) zeros for every cell of the grid; is left so.
        least: smaller parts of joined cells are left out.
        most: cells along the edge of the cubes into which parts are cut.

    Returns:
        The cells (C,) of each, ascending.
    """
    if not len(cells):
        return []
    part = _parts(cells, steps, number)
    large = np.bincount(part)[part] >= least
    cells, part, cube = cells[large], part[large], index[large] // most
    order = np.lexsort((cells, *cube.T, part))
    key = np.column_stack([part, cube])[order]
    edges = np.flatnonzero((np.diff(key, axis=0) != 0).any(axis=1)) + 1
    return np.split(cells[order], edges) if len(order) else []
