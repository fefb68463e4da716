"""The cheapest path over the columns of a planar path: what is left of a search where walls are upright.

No path costs less than the planar one over columns, each as good as its best cell, and what the climb
from start to goal adds at least. Where the cheapest cells over the planar path's columns cost hardly more
than that bound, no search among all cells can find anything much better.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from uavexp.arrays import Float, Int, UInt8
from uavexp.planner.find.grid_search import Space, cell_clearance, limit, penalty

CLIMB = 0.3178372451957822  # √3 - √2: what a step costs more, at least, when it also climbs


@nb.njit(cache=True)
def over_columns(space: Space, parent: UInt8, longest: int) -> tuple[float, Int]:
    """Cost, voxels, and cells (P, 3) of the cheapest path over the planar path's columns; inf: there is none.

    Args:
        space: what is searched.
        parent: of the columns, as `plan_columns` left them.
        longest: most columns that its path can have.
    """
    path, k0 = _planar_path(space, parent, longest), space.box[0, 2]
    layers = space.box[1, 2] - k0 + 1
    cost, came = np.full((len(path), layers), np.inf), np.zeros((len(path), layers), dtype=np.int64)
    cost[0, space.start[2] - k0] = 0.0
    before = _worth(space, path[0])
    for n in range(1, len(path)):
        worth = _worth(space, path[n])
        level = float(np.abs(path[n] - path[n - 1]).sum())
        for k in range(layers):
            for of in range(max(k - 1, 0), min(k + 2, layers)):
                step = np.sqrt(level + abs(k - of)) * (1.0 + 0.5 * (before[of] + worth[k]))
                if cost[n - 1, of] + step < cost[n, k]:
                    cost[n, k], came[n, k] = cost[n - 1, of] + step, of
        before = worth
    cells = np.empty((len(path), 3), dtype=np.int64)
    k = space.goal[2] - k0
    total = cost[len(path) - 1, k]
    for n in range(len(path) - 1, -1, -1):
        cells[n, :2], cells[n, 2] = path[n], k + k0
        k = came[n, k]
    return total, cells


@nb.njit(cache=True)
def _planar_path(space: Space, parent: UInt8, longest: int) -> Int:
    """Columns (P, 2) from start to goal."""
    nj = space.box[1, 1] - space.box[0, 1] + 1
    path = np.empty((longest, 2), dtype=np.int64)
    path[0] = space.start[:2]
    n = 0
    while path[n, 0] != space.goal[0] or path[n, 1] != space.goal[1]:
        step = parent[(path[n, 0] - space.box[0, 0]) * nj + path[n, 1] - space.box[0, 1]]
        n += 1
        path[n, 0], path[n, 1] = path[n - 1, 0] + step // 3 - 1, path[n - 1, 1] + step % 3 - 1
    return path[: n + 1]


@nb.njit(cache=True)
def _worth(space: Space, column: Int) -> Float:
    """Penalty of each cell of a column (2,); inf where it is closed."""
    start, goal, k0 = space.start, space.goal, space.box[0, 2]
    apart = float((column[0] - start[0]) ** 2 + (column[1] - start[1]) ** 2)
    worth = np.empty(space.box[1, 2] - k0 + 1)
    for k in range(len(worth)):
        clearance = cell_clearance(space, column[0], column[1], k + k0)
        least = limit(space.rule, apart + float((k + k0 - start[2]) ** 2))
        is_end = (column == start[:2]).all() and k + k0 == start[2]
        is_end |= (column == goal[:2]).all() and k + k0 == goal[2]
        worth[k] = penalty(clearance, space.rule) if clearance >= least or is_end else np.inf
    return worth
