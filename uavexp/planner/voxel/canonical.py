"""Exact A* among voxels, fast: canonical successors, straight jumps, buckets.

Costs are 1, √2 and √3 voxels, no corner is cut (`moves`). What makes it fast changes no
answer:
- a cell passes on only the moves of canonical paths, 1 to 3 instead of 26 in free space;
- straight moves run on to where a canonical path can turn (`jump`), and are dropped where
  it never can;
- the open list is an array of stacks, one for every eighth of a voxel of f; a cell may be
  expanded again within one stack, and the goal's cost is final when no f below it is left;
- a sparse set says which cells were touched, so no array of the grid's size is ever cleared
  (Briggs and Torczon 1993).
"""

from __future__ import annotations

import numba as nb
import numpy as np

from uavexp.planner.voxel.jump import Terrain, is_near, neighbourhood, remembered_moves, run_length
from uavexp.planner.voxel.moves import FULL, LENGTHS, STEPS, octile
from uavexp.types import Int, Int32

FOUND, NO_PATH, BUDGET = 0, 1, 2
_PER_VOXEL = 8  # stacks for each voxel of f
_SAME = 1e-9  # costs closer than this differ by rounding only
_FIRST_NODES = 4096


@nb.njit(cache=True)
def _grown(array: Int, fill: int) -> Int:
    larger = np.full(2 * array.shape[0], fill, dtype=array.dtype)
    larger[: array.shape[0]] = array
    return larger


@nb.njit(cache=True)
def find(
    terrain: Terrain, start: Int, goal: Int, max_expansions: int, slot: Int32
) -> tuple[int, float, int, Int32]:
    """Return status, cost in voxels, expansions and the path's cells (P, 3).

    Args:
        terrain: the grid.
        start: padded index (3,), free.
        goal: padded index (3,), free.
        max_expansions: budget.
        slot: scratch (cells,), any contents.
    """
    shape, free, near_x, near_y, near_z, keys, known = terrain
    full = FULL
    row, slab = shape[2], shape[1] * shape[2]
    goal_i, goal_j, goal_k = goal[0], goal[1], goal[2]
    source = start[0] * slab + start[1] * row + start[2]
    target = goal[0] * slab + goal[1] * row + goal[2]
    cell_of = np.empty(_FIRST_NODES, dtype=np.int64)
    cost = np.empty(_FIRST_NODES)
    parent = np.empty(_FIRST_NODES, dtype=np.int32)
    arrived = np.empty(_FIRST_NODES, dtype=np.int8)
    closed = np.zeros(_FIRST_NODES, dtype=np.bool_)
    entry_node = np.empty(_FIRST_NODES, dtype=np.int32)
    entry_below = np.empty(_FIRST_NODES, dtype=np.int32)
    stack = np.full(1024, -1, dtype=np.int32)  # top entry of each
    least = octile(start[0] - goal[0], start[1] - goal[1], start[2] - goal[2])
    cell_of[0], cost[0], parent[0], arrived[0], slot[source] = source, 0.0, -1, 13, 0
    entry_node[0], entry_below[0], stack[0] = 0, -1, 0
    nodes, entries, expansions, level, highest = 1, 1, 0, 0, 0
    best, last = np.inf, -1
    while level <= highest and least + level / _PER_VOXEL < best - _SAME:
        top = stack[level]
        if top < 0:
            level += 1
            continue
        stack[level] = entry_below[top]
        node = entry_node[top]
        if closed[node]:
            continue
        closed[node] = True
        cell = cell_of[node]
        ci = cell // slab
        cj = (cell - ci * slab) // row
        ck = cell - ci * slab - cj * row
        if cost[node] + octile(ci - goal_i, cj - goal_j, ck - goal_k) >= best - _SAME:
            continue
        if expansions >= max_expansions:
            return BUDGET, np.inf, expansions, np.empty((0, 3), dtype=np.int32)
        expansions += 1
        bits = full
        if is_near(near_z, shape, ci, cj, ck):
            bits = neighbourhood(free, shape, ci, cj, ck)
        moves = remembered_moves(keys, known, arrived[node], bits)
        n = -1
        while moves != 0:
            n += 1
            if moves & 1 == 0:
                moves >>= 1
                continue
            moves >>= 1
            si, sj, sk = STEPS[n, 0], STEPS[n, 1], STEPS[n, 2]
            step = si * slab + sj * row + sk
            count = 1
            if si * si + sj * sj + sk * sk == 1:
                if not is_near(near_z, shape, ci + si, cj + sj, ck + sk):
                    count += run_length(near_x, near_y, near_z, shape, n, ci + si, cj + sj, ck + sk)
                away = (goal_i - ci) * si + (goal_j - cj) * sj + (goal_k - ck) * sk
                if 0 < away <= count and cell + away * step == target:
                    count = away
            other = cell + count * step
            there = cost[node] + count * LENGTHS[n]
            new = slot[other]
            fresh = not (0 <= new < nodes and cell_of[new] == other)
            if not fresh and there >= cost[new] - _SAME:
                continue
            oi, oj, ok = ci + count * si, cj + count * sj, ck + count * sk
            ahead = octile(oi - goal_i, oj - goal_j, ok - goal_k)
            if there + ahead >= best - _SAME:
                continue
            if other != target and is_near(near_z, shape, oi, oj, ok):
                bits = neighbourhood(free, shape, oi, oj, ok)
                if remembered_moves(keys, known, n, bits) == 0:
                    continue
            if fresh:
                if nodes == cost.shape[0]:
                    cell_of, parent = _grown(cell_of, 0), _grown(parent, 0)
                    cost, arrived = _grown(cost, 0), _grown(arrived, 0)
                    closed = _grown(closed, False)
                new = nodes
                nodes += 1
                slot[other], cell_of[new] = new, other
            cost[new], parent[new], arrived[new], closed[new] = there, node, n, False
            if other == target:
                best, last = there, new
                continue
            rank = max(int((there + ahead - least) * _PER_VOXEL), level)
            while rank >= stack.shape[0]:
                stack = _grown(stack, -1)
            if entries == entry_node.shape[0]:
                entry_node, entry_below = _grown(entry_node, 0), _grown(entry_below, 0)
            entry_node[entries], entry_below[entries] = new, stack[rank]
            stack[rank] = entries
            entries += 1
            highest = max(highest, rank)
    if source == target:
        best, last = 0.0, 0
    if last < 0:
        return NO_PATH, np.inf, expansions, np.empty((0, 3), dtype=np.int32)
    return FOUND, best, expansions, _trace(last, cell_of, parent, arrived, row, slab)


@nb.njit(cache=True)
def _trace(last: int, cell_of: Int, parent: Int32, arrived: Int, row: int, slab: int) -> Int32:
    """Every cell of the path to a node, straight jumps filled in, (P, 3)."""
    cells = 1
    node = last
    while parent[node] >= 0:
        n = arrived[node]
        step = STEPS[n, 0] * slab + STEPS[n, 1] * row + STEPS[n, 2]
        cells += (cell_of[node] - cell_of[parent[node]]) // step
        node = parent[node]
    path = np.empty((cells, 3), dtype=np.int32)
    at, node, cell = cells, last, cell_of[last]
    while True:
        at -= 1
        path[at, 0] = cell // slab
        path[at, 1] = cell % slab // row
        path[at, 2] = cell % row
        if at == 0:
            break
        n = arrived[node]
        cell -= STEPS[n, 0] * slab + STEPS[n, 1] * row + STEPS[n, 2]
        if cell == cell_of[parent[node]]:
            node = parent[node]
    return path
