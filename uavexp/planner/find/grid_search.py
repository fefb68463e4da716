"""A* among the voxels of a distance field: first planar and backward on columns, then forward on cells.

An edge costs its length times (1 + the mean penalty of its two cells), voxels; a column is as good as its
best cell. A row of `Nodes` counts where its stamp is the search's, so no array is ever cleared.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Float, Float32, Int, Int32, UInt8
from uavexp.planner.find.heap import pop, sift_up
from uavexp.planner.find.octile import octile

FOUND, NO_PATH, BUDGET = 0, 1, 2
STEPS = np.array(
    [(i, j, k) for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1) if (i, j, k) != (0, 0, 0)],
    dtype=np.int64,
)
_LENGTHS = np.sqrt((STEPS**2).sum(axis=1).astype(np.float64))
_CLOSED, _BLOCKED, _SEEN = -1, -2, -3  # what `place` says of a node that is not in the heap
_TIE = 1.0 + 1e-6  # inflation of the heuristic: prefers the deeper of equal nodes
_BELOW_LIMIT = 20.0  # extra penalty of a cell below the limit, next to a start that is there too


@nb.njit(cache=True, inline="always")
def _octile(di: int, dj: int, dk: int) -> float:
    """Rounded from the exact differences; the order of equal keys hangs on the last bit."""
    return float(octile(di, dj, dk, 0.41421356237309503, 0.3178372451957822))


class ClearanceRule(NamedTuple):
    """What a clearance is worth."""

    least_m: float  # cells below it are closed
    safe_m: float  # no penalty from there on
    scale: float  # 1 / (safe - least)
    weight: float
    start_m: float  # clearance of the start
    reach2: float  # squared voxels from the start within which that is enough; negative: nowhere


class Space(NamedTuple):
    """What is searched."""

    distance: Float32  # (X, Y, Z) m
    state: UInt8  # (X, Y, Z)
    known_only: bool
    cut_corners: bool
    rule: ClearanceRule
    box: Int  # (2, 3) first and last voxel
    start: Int  # (3,) voxel
    goal: Int  # (3,) voxel


@nb.njit(cache=True)
def searched(
    origin_m: Float,
    voxel_m: float,
    shape: Int,
    start_m: Float,
    goal_m: Float,
    bounds_m: Float,
    z_band_m: float,
) -> tuple[Int, Int, Int]:
    """First and last voxel (2, 3) of the flight bounds within the height band, and those of start and goal.

    Args:
        origin_m: (3,) of the map.
        voxel_m: its voxels' edge.
        shape: (3,) of it, voxels.
        start_m: (3,).
        goal_m: (3,); a bound narrower than a voxel still holds its voxel.
        bounds_m: (2, 3) of the flight.
        z_band_m: what the heights between start and goal may be left by.
    """
    box, start, goal = np.empty((2, 3), np.int64), np.empty(3, np.int64), np.empty(3, np.int64)
    for axis in range(3):
        low, high, last = bounds_m[0, axis], bounds_m[1, axis], shape[axis] - 1
        if axis == 2:
            low = max(low, min(start_m[axis], goal_m[axis]) - z_band_m)
            high = min(high, max(start_m[axis], goal_m[axis]) + z_band_m)
        first = np.ceil((low - origin_m[axis]) / voxel_m - 0.5 - 1e-9)
        final = np.floor((high - origin_m[axis]) / voxel_m - 0.5 + 1e-9)
        at = min(max(np.floor((goal_m[axis] - origin_m[axis]) / voxel_m), 0), last)
        box[0, axis], box[1, axis] = max(min(first, at), 0), min(max(final, at), last)
        here = np.floor((start_m[axis] - origin_m[axis]) / voxel_m)
        start[axis], goal[axis] = min(max(here, box[0, axis]), box[1, axis]), at
    return box, start, goal


class Nodes(NamedTuple):
    """Memory of a search: a row for each cell or column."""

    cost: Float
    key: Float
    stamp: Int32  # of the last search that saw it
    place: Int32  # in the heap
    heap: Int32


@nb.njit(cache=True, inline="always")
def penalty(clearance: float, rule: ClearanceRule) -> float:
    """Share by which a cell of this clearance lengthens the way through it."""
    if clearance >= rule.safe_m:
        return 0.0
    short = min((rule.safe_m - clearance) * rule.scale, 10.0)  # an unknown start has no clearance at all
    penalty = rule.weight * short * short
    return float(penalty + _BELOW_LIMIT if clearance < rule.least_m else penalty)


@nb.njit(cache=True, inline="always")
def limit(rule: ClearanceRule, distance_voxels_squared: float) -> float:
    """Least clearance of a passable cell at this squared distance from the start."""
    return float(min(rule.least_m, rule.start_m) if distance_voxels_squared <= rule.reach2 else rule.least_m)


@nb.njit(cache=True)
def cell_clearance(space: Space, i: int, j: int, k: int) -> float:
    """Clearance of a cell; where unknown is closed: none in it, and the least allowed next to it."""
    state = space.state
    here = float(space.distance[i, j, k])
    if not space.known_only:
        return here
    if state[i, j, k] == 0:
        return -np.inf
    for axis in range(3):
        for side in (-1, 1):
            ni = min(max(i + (side if axis == 0 else 0), 0), state.shape[0] - 1)
            nj = min(max(j + (side if axis == 1 else 0), 0), state.shape[1] - 1)
            nk = min(max(k + (side if axis == 2 else 0), 0), state.shape[2] - 1)
            if state[ni, nj, nk] == 0:
                return float(min(here, space.rule.least_m))
    return here


@nb.njit(cache=True, inline="always")
def _best_clearance(space: Space, i: int, j: int) -> float:
    """Clearance of a column's best cell."""
    best = -np.inf
    for k in range(space.box[0, 2], space.box[1, 2] + 1):
        best = max(best, cell_clearance(space, i, j, k))
    return best


@nb.njit(cache=True, inline="always")
def _see(nodes: Nodes, node: int, generation: int, blocked: bool) -> None:
    """Begin with a node that this search has not seen."""
    nodes.stamp[node] = generation
    nodes.cost[node] = np.inf
    nodes.place[node] = _BLOCKED if blocked else _SEEN


@nb.njit(cache=True, inline="always")
def _begin(nodes: Nodes, source: int, key: float, generation: int) -> None:
    """A heap of one node."""
    nodes.stamp[source] = generation
    nodes.cost[source] = 0.0
    nodes.key[source] = key
    nodes.heap[0] = source
    nodes.place[source] = 0


@nb.njit(cache=True, inline="always")
def _improve(nodes: Nodes, size: int, node: int, cost: float, key: float) -> int:
    """Give a node a lower cost; returns the heap's size."""
    if nodes.place[node] == _SEEN:
        nodes.heap[size] = node
        nodes.place[node] = size
        size += 1
    nodes.cost[node] = cost
    nodes.key[node] = key
    sift_up(nodes.heap, nodes.place, nodes.key, nodes.place[node])
    return size


@nb.njit(cache=True)
def plan_columns(
    space: Space, generation: int, inflation: float, columns: Nodes, worth: Float, parent: UInt8
) -> tuple[int, float, int]:
    """Backward planar A* over columns; returns status, cost in voxels and expansions.

    Args:
        space: what is searched.
        generation: of this search.
        inflation: of the heuristic: the cost is at most so many times the least.
        columns: memory.
        worth: (columns,) where the penalty of each column's best cell is written.
        parent: (columns,) where the column that one was reached from is written, 3 (di + 1) + dj + 1 away.
    """
    box, start, goal, rule = space.box, space.start, space.goal, space.rule
    i0, j0, i1, j1 = box[0, 0], box[0, 1], box[1, 0], box[1, 1]
    nj = j1 - j0 + 1
    source = (goal[0] - i0) * nj + goal[1] - j0
    target = (start[0] - i0) * nj + start[1] - j0
    _begin(columns, source, _octile(goal[0] - start[0], goal[1] - start[1], 0), generation)
    worth[source] = penalty(_best_clearance(space, goal[0], goal[1]), rule)
    size, expansions = 1, 0
    while size > 0:
        cell = pop(columns.heap, columns.place, columns.key, size)
        size -= 1
        expansions += 1
        if cell == target:
            return FOUND, columns.cost[cell], expansions
        ci, cj = cell // nj + i0, cell % nj + j0
        for i in range(max(ci - 1, i0), min(ci + 1, i1) + 1):
            for j in range(max(cj - 1, j0), min(cj + 1, j1) + 1):
                if i == ci and j == cj:
                    continue
                other = (i - i0) * nj + j - j0
                if columns.stamp[other] != generation:
                    best = _best_clearance(space, i, j)
                    worth[other] = penalty(best, rule)
                    least = limit(rule, float((i - start[0]) ** 2 + (j - start[1]) ** 2))
                    _see(columns, other, generation, best < least and other != target)
                if columns.place[other] == _CLOSED or columns.place[other] == _BLOCKED:
                    continue
                step = 1.4142135623730951 if i != ci and j != cj else 1.0
                there = columns.cost[cell] + step * (1.0 + 0.5 * (worth[cell] + worth[other]))
                if there < columns.cost[other]:
                    key = there + inflation * _octile(i - start[0], j - start[1], 0)
                    size = _improve(columns, size, other, there, key)
                    parent[other] = 3 * (ci - i + 1) + cj - j + 1
    return NO_PATH, np.inf, expansions


@nb.njit(cache=True)
def plan_cells(
    space: Space,
    generation: int,
    max_expansions: int,
    planar_total: float,
    columns: Nodes,
    cells: Nodes,
    parent: UInt8,
) -> tuple[int, float, int]:
    """Forward A* over cells; returns status, cost in voxels and expansions.

    Args:
        space: what is searched.
        generation: of this search and of the planar one before it.
        max_expansions: budget.
        planar_total: cost that the planar search found, voxels.
        columns: as it left them.
        cells: memory.
        parent: (cells,) where the step (of `STEPS`) is written by which a cell was reached.
    """
    box, start, goal, rule = space.box, space.start, space.goal, space.rule
    i0, j0, k0, i1, j1, k1 = box[0, 0], box[0, 1], box[0, 2], box[1, 0], box[1, 1], box[1, 2]
    nj, nk = j1 - j0 + 1, k1 - k0 + 1
    source = ((start[0] - i0) * nj + start[1] - j0) * nk + start[2] - k0
    target = ((goal[0] - i0) * nj + goal[1] - j0) * nk + goal[2] - k0
    _begin(cells, source, 0.0, generation)
    size, expansions = 1, 0
    while size > 0:
        cell = pop(cells.heap, cells.place, cells.key, size)
        size -= 1
        if cell == target:
            return FOUND, cells.cost[cell], expansions
        if expansions >= max_expansions:
            return BUDGET, np.inf, expansions
        expansions += 1
        ci, cj, ck = cell // (nk * nj) + i0, (cell // nk) % nj + j0, cell % nk + k0
        here = penalty(cell_clearance(space, ci, cj, ck), rule)
        for n in range(26):
            i, j, k = ci + STEPS[n, 0], cj + STEPS[n, 1], ck + STEPS[n, 2]
            if i < i0 or i > i1 or j < j0 or j > j1 or k < k0 or k > k1:
                continue
            other = ((i - i0) * nj + j - j0) * nk + k - k0
            clearance = cell_clearance(space, i, j, k)
            if cells.stamp[other] != generation:
                apart = float((i - start[0]) ** 2 + (j - start[1]) ** 2 + (k - start[2]) ** 2)
                _see(cells, other, generation, clearance < limit(rule, apart) and other != target)
            if cells.place[other] == _CLOSED or cells.place[other] == _BLOCKED:
                continue
            if not space.cut_corners and _cuts_corner(space, ci, cj, ck, n):
                continue
            there = cells.cost[cell] + _LENGTHS[n] * (1.0 + 0.5 * (here + penalty(clearance, rule)))
            if there < cells.cost[other]:
                column = (i - i0) * nj + j - j0
                bound = _planar_bound(columns, column, generation, planar_total, i - start[0], j - start[1])
                bound = max(_octile(i - goal[0], j - goal[1], k - goal[2]), bound)
                size = _improve(cells, size, other, there, there + _TIE * bound)
                parent[other] = n
    return NO_PATH, np.inf, expansions


@nb.njit(cache=True)
def trace(space: Space, parent: UInt8, longest: int) -> Int:
    """Voxels (P, 3) from start to goal, at most `longest`, by the parents that `plan_cells` left."""
    nj, nk = space.box[1, 1] - space.box[0, 1] + 1, space.box[1, 2] - space.box[0, 2] + 1
    cells = np.empty((longest, 3), dtype=np.int64)
    cell, n = space.goal - space.box[0], longest - 1
    cells[n] = cell
    while (cell != space.start - space.box[0]).any():
        cell = cell - STEPS[parent[(cell[0] * nj + cell[1]) * nk + cell[2]]]
        n -= 1
        cells[n] = cell
    path: Int = cells[n:] + space.box[0]
    return path


@nb.njit(cache=True, inline="always")
def _planar_bound(
    columns: Nodes, column: int, generation: int, planar_total: float, di: int, dj: int
) -> float:
    """Lower bound on the cost from a column, (di, dj) from the start, to the goal, voxels."""
    if columns.stamp[column] == generation and columns.place[column] == _CLOSED:
        return float(columns.cost[column])
    return float(planar_total - _octile(di, dj, 0))


@nb.njit(cache=True, inline="always")
def _cuts_corner(space: Space, i: int, j: int, k: int, n: int) -> bool:
    """Whether a cell of the box that the step moves through is blocked."""
    for a in range(2):
        for b in range(2):
            for c in range(2):
                at_i, at_j, at_k = i + a * STEPS[n, 0], j + b * STEPS[n, 1], k + c * STEPS[n, 2]
                if cell_clearance(space, at_i, at_j, at_k) < space.rule.least_m:
                    return True
    return False
