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

from typing import Any

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
def grown(array: Record) -> Record:
    """The array, twice as long."""
    larger = np.empty(2 * array.shape[0], dtype=array.dtype)
    larger[: array.shape[0]] = array
    return larger


@nb.njit(cache=True, inline="always")
def _leap(terrain: Terrain, goal: tuple[int, int, int], n: int, i: int, j: int, k: int) -> int:
    """Cells that move n goes: a straight one to where a path can turn, or to the goal; 0: nowhere."""
    si, sj, sk = STEPS[n, 0], STEPS[n, 1], STEPS[n, 2]
    if si * si + sj * sj + sk * sk != 1:
        return 1
    count, goes_on = run_length(terrain.stops, terrain.first, terrain.shape, n, i, j, k)
    away = (goal[0] - i) * si + (goal[1] - j) * sj + (goal[2] - k) * sk
    reached = i + away * si == goal[0] and j + away * sj == goal[1] and k + away * sk == goal[2]
    if 0 < away <= count and reached:
        return int(away)
    return int(count) if goes_on else 0


@nb.njit(cache=True, inline="always")
def _moves(terrain: Terrain, arrived: int, i: int, j: int, k: int) -> int:
    """Canonical moves from a cell, bits."""
    bits = FULL
    if is_near(terrain.near, terrain.shape, i, j, k):
        bits = neighbourhood(terrain.free, terrain.shape, i, j, k)
    return int(remembered_moves(terrain.keys, terrain.known, arrived, bits))


@nb.njit(cache=True, inline="always")
def _push(stack: Int32, entry_of: Record, entries: int, rank: int, node: int) -> tuple[Int32, Record]:
    """Put a node on the stack of its rank; returns the arrays, which may have grown."""
    while rank >= stack.shape[0]:
        stack = np.concatenate((stack, np.full_like(stack, -1)))
    if entries == entry_of.shape[0]:
        entry_of = grown(entry_of)
    entry_of[entries].node, entry_of[entries].below = node, stack[rank]
    stack[rank] = entries
    return stack, entry_of


@nb.njit(cache=True, inline="always")
def _with_node(node_of: Record, nodes: int, cell: int) -> Record:
    """The nodes with one of a cell not seen before."""
    if nodes == node_of.shape[0]:
        node_of = grown(node_of)
    node_of[nodes].cell = cell
    return node_of


@nb.njit(cache=True, inline="always")
def _reach(node: Any, cost: float, parent: int, arrived: int) -> None:
    node.cost, node.closed, node.parent, node.arrived = cost, False, parent, arrived


@nb.njit(cache=True, inline="always")
def _begin(node_of: Record, entry_of: Record, stack: Int32, slot: Int32, source: int, place: int) -> None:
    """One node, on the first stack."""
    node_of[0].cell, slot[place] = source, 0
    _reach(node_of[0], 0.0, -1, 13)
    entry_of[0].node, entry_of[0].below, stack[0] = 0, -1, 0


@nb.njit(cache=True, inline="always")
def _index(cell: int, row: int, slab: int) -> tuple[int, int, int]:
    i = cell // slab
    j = (cell - i * slab) // row
    return i, j, cell - i * slab - j * row


@nb.njit(cache=True)
def find(
    terrain: Terrain, start: Int, goal: Int, max_expansions: int, slot: Int32
) -> tuple[int, float, int, Int32]:
    """Return status, cost in voxels, expansions and the path's cells (P, 3).

    Ends are padded indices (3,) of free cells; `slot` (cells,) is scratch of any contents.
    """
    shape, row, slab = terrain.shape, terrain.shape[2], terrain.shape[1] * terrain.shape[2]
    end = (goal[0], goal[1], goal[2])
    source, target = start[0] * slab + start[1] * row + start[2], end[0] * slab + end[1] * row + end[2]
    node_of, entry_of = np.empty(_FIRST_NODES, dtype=_NODE), np.empty(_FIRST_NODES, dtype=_ENTRY)
    stack = np.full(1024, -1, dtype=np.int32)  # top entry of each
    _begin(node_of, entry_of, stack, slot, source, _slot(shape, start[0], start[1], start[2]))
    least = octile(start[0] - end[0], start[1] - end[1], start[2] - end[2])
    nodes, entries, expansions, level, highest = 1, 1, 0, 0, 0
    best, last = (0.0, 0) if source == target else (np.inf, -1)
    while level <= highest and least + level / _PER_VOXEL < best - _SAME:
        top = stack[level]
        if top < 0:
            level += 1
            continue
        stack[level], node = entry_of[top].below, entry_of[top].node
        if node_of[node].closed:
            continue
        node_of[node].closed = True
        cell, cost, arrived = node_of[node].cell, node_of[node].cost, node_of[node].arrived
        ci, cj, ck = _index(cell, row, slab)
        if cost + octile(ci - end[0], cj - end[1], ck - end[2]) >= best - _SAME:
            continue
        if expansions >= max_expansions:
            return BUDGET, np.inf, expansions, np.empty((0, 3), dtype=np.int32)
        expansions += 1
        moves, n = _moves(terrain, arrived, ci, cj, ck), -1
        while moves != 0:
            n, taken, moves = n + 1, moves & 1, moves >> 1
            count = _leap(terrain, end, n, ci, cj, ck) if taken else 0
            if count == 0:
                continue
            there = cost + count * LENGTHS[n]
            oi, oj, ok = ci + count * STEPS[n, 0], cj + count * STEPS[n, 1], ck + count * STEPS[n, 2]
            ahead = octile(oi - end[0], oj - end[1], ok - end[2])
            if there + ahead >= best - _SAME:
                continue
            other, place = oi * slab + oj * row + ok, _slot(shape, oi, oj, ok)
            new = slot[place]
            if not (0 <= new < nodes and node_of[new].cell == other):
                node_of, new, slot[place] = _with_node(node_of, nodes, other), nodes, nodes
                nodes += 1
            elif there >= node_of[new].cost - _SAME:
                continue
            _reach(node_of[new], there, node, n)
            if other == target:
                best, last = there, new
                continue
            rank = max(int((there + ahead - least) * _PER_VOXEL), level)
            stack, entry_of = _push(stack, entry_of, entries, rank, new)
            entries, highest = entries + 1, max(highest, rank)
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
