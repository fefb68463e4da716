"""Exact A* among voxels, fast: canonical successors, straight jumps, buckets.

Costs are 1, √2 and √3 voxels, no corner is cut (`moves`). What makes it fast changes no
answer:
- a cell passes on only the moves of canonical paths, 1 to 3 instead of 26 in free space;
- straight moves run on to where a canonical path can turn, and are dropped where it never can
  (`jump`);
- the open list is an array of stacks, one for every eighth of a voxel of f; a cell may be
  expanded again within one stack, and the goal's cost is final when no f below it is left;
- a sparse set says which cells were touched, so no array of the grid's size is ever cleared
  (Briggs and Torczon 1993); it is stored in blocks of 64 cells, near in memory as in space.
"""

from __future__ import annotations

import numba as nb
import numpy as np
import numpy.typing as npt

from uavexp.arrays import Int, Int32
from uavexp.planner.find.octile import octile
from uavexp.planner.find.voxels.jump import Terrain, is_near, neighbourhood, remembered_moves, run_length
from uavexp.planner.find.voxels.moves import FULL, LENGTHS, STEPS

Record = npt.NDArray[np.void]

FOUND, NO_PATH, BUDGET = 0, 1, 2
_PER_VOXEL = 8  # stacks for each voxel of f
_SAME = 1e-9  # costs closer than this differ by rounding only
_FIRST_NODES = 4096
_NODE = np.dtype(
    [("cost", "f8"), ("cell", "i8"), ("parent", "i4"), ("arrived", "i1"), ("closed", "b1")], align=True
)
_ENTRY = np.dtype([("node", "i4"), ("below", "i4")])


def slots(shape: Int) -> int:
    """Length of the scratch array for a padded grid of this shape (3,)."""
    return int(np.prod(-(-shape // 4)) * 64)


@nb.njit(cache=True, inline="always")
def _slot(shape: Int, i: int, j: int, k: int) -> int:
    """Place of a cell in the scratch array."""
    block = ((i >> 2) * ((shape[1] + 3) >> 2) + (j >> 2)) * ((shape[2] + 3) >> 2) + (k >> 2)
    return int(block << 6 | (i & 3) << 4 | (j & 3) << 2 | (k & 3))


@nb.njit(cache=True)
def _grown(array: Record) -> Record:
    larger = np.empty(2 * array.shape[0], dtype=array.dtype)
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
    shape, free, near, stops, first, keys, known = terrain
    full = FULL
    row, slab = shape[2], shape[1] * shape[2]
    goal_i, goal_j, goal_k = goal[0], goal[1], goal[2]
    source = start[0] * slab + start[1] * row + start[2]
    target = goal[0] * slab + goal[1] * row + goal[2]
    node_of, entry_of = np.empty(_FIRST_NODES, dtype=_NODE), np.empty(_FIRST_NODES, dtype=_ENTRY)
    stack = np.full(1024, -1, dtype=np.int32)  # top entry of each
    least = octile(start[0] - goal[0], start[1] - goal[1], start[2] - goal[2])
    origin = node_of[0]
    origin.cell, origin.cost, origin.parent, origin.arrived, origin.closed = source, 0.0, -1, 13, False
    slot[_slot(shape, start[0], start[1], start[2])] = 0
    entry_of[0].node, entry_of[0].below, stack[0] = 0, -1, 0
    nodes, entries, expansions, level, highest = 1, 1, 0, 0, 0
    best, last = np.inf, -1
    while level <= highest and least + level / _PER_VOXEL < best - _SAME:
        top = stack[level]
        if top < 0:
            level += 1
            continue
        stack[level] = entry_of[top].below
        node = entry_of[top].node
        if node_of[node].closed:
            continue
        node_of[node].closed = True
        cell, cost, arrived = node_of[node].cell, node_of[node].cost, node_of[node].arrived
        ci = cell // slab
        cj = (cell - ci * slab) // row
        ck = cell - ci * slab - cj * row
        if cost + octile(ci - goal_i, cj - goal_j, ck - goal_k) >= best - _SAME:
            continue
        if expansions >= max_expansions:
            return BUDGET, np.inf, expansions, np.empty((0, 3), dtype=np.int32)
        expansions += 1
        bits = full
        if is_near(near, shape, ci, cj, ck):
            bits = neighbourhood(free, shape, ci, cj, ck)
        moves = remembered_moves(keys, known, arrived, bits)
        n = -1
        while moves != 0:
            n += 1
            if moves & 1 == 0:
                moves >>= 1
                continue
            moves >>= 1
            si, sj, sk = STEPS[n, 0], STEPS[n, 1], STEPS[n, 2]
            step = si * slab + sj * row + sk
            count, goes_on = 1, True
            if si * si + sj * sj + sk * sk == 1:
                count, goes_on = run_length(stops, first, shape, n, ci, cj, ck)
                away = (goal_i - ci) * si + (goal_j - cj) * sj + (goal_k - ck) * sk
                if 0 < away <= count and cell + away * step == target:
                    count, goes_on = away, True
                if not goes_on:
                    continue
            other = cell + count * step
            there = cost + count * LENGTHS[n]
            oi, oj, ok = ci + count * si, cj + count * sj, ck + count * sk
            ahead = octile(oi - goal_i, oj - goal_j, ok - goal_k)
            if there + ahead >= best - _SAME:
                continue
            place = _slot(shape, oi, oj, ok)
            new = slot[place]
            if not (0 <= new < nodes and node_of[new].cell == other):
                if nodes == node_of.shape[0]:
                    node_of = _grown(node_of)
                new = nodes
                nodes += 1
                slot[place] = new
                node_of[new].cell = other
            elif there >= node_of[new].cost - _SAME:
                continue
            node_of[new].cost, node_of[new].closed = there, False
            node_of[new].parent, node_of[new].arrived = node, n
            if other == target:
                best, last = there, new
                continue
            rank = max(int((there + ahead - least) * _PER_VOXEL), level)
            while rank >= stack.shape[0]:
                stack = np.concatenate((stack, np.full_like(stack, -1)))
            if entries == entry_of.shape[0]:
                entry_of = _grown(entry_of)
            entry_of[entries].node, entry_of[entries].below = new, stack[rank]
            stack[rank] = entries
            entries += 1
            highest = max(highest, rank)
    if source == target:
        best, last = 0.0, 0
    if last < 0:
        return NO_PATH, np.inf, expansions, np.empty((0, 3), dtype=np.int32)
    return FOUND, best, expansions, _trace(last, node_of, row, slab)


@nb.njit(cache=True)
def _trace(last: int, node_of: Record, row: int, slab: int) -> Int32:
    """Every cell of the path to a node, straight runs filled in, (P, 3)."""
    cells, node = 1, last
    while node_of[node].parent >= 0:
        n, before = node_of[node].arrived, node_of[node].parent
        step = STEPS[n, 0] * slab + STEPS[n, 1] * row + STEPS[n, 2]
        cells += (node_of[node].cell - node_of[before].cell) // step
        node = before
    path = np.empty((cells, 3), dtype=np.int32)
    at, node, cell = cells, last, node_of[last].cell
    while True:
        at -= 1
        path[at, 0], path[at, 1], path[at, 2] = cell // slab, cell % slab // row, cell % row
        if at == 0:
            break
        n = node_of[node].arrived
        cell -= STEPS[n, 0] * slab + STEPS[n, 1] * row + STEPS[n, 2]
        if cell == node_of[node_of[node].parent].cell:
            node = node_of[node].parent
    return path
