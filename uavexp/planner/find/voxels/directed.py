"""A* with a price on turning and a rule for vertical steps (Liao et al., improved A*).

Two forms of the turning penalty P = λ (1 - cos θ), θ between the step into a cell and the one
before it, both with steps of 1, √2 and √3 voxels that cut no corner:

- paper: f = g + h + P, P in f only, a state for every cell, no cell reopened (eq. 5-1). It
  orders the search; the length of what it finds may exceed the shortest.
- exact: least Σ (length + P). The step of arrival belongs to the state, and for the vertical
  rule the level steps since the last vertical one, up to the number that counts.

Vertical steps (eq. 5-2, garbled in print) are allowed from a cell where no level step is open,
which is more than two voxels above or below the goal, or with enough level steps: made
since the last vertical one, or open from here. The conditions are joined by "or" or by "and".

The first step is weighed against the direction flown: λ_v (1 - cos) is part of its cost.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from uavexp.arrays import Float, Int, Int32, UInt8
from uavexp.planner.find.octile import octile
from uavexp.planner.find.voxels.canonical import BUDGET, FOUND, NO_PATH, Record, grown
from uavexp.planner.find.voxels.jump import neighbourhood
from uavexp.planner.find.voxels.moves import LENGTHS, STEPS, open_moves

RULE_NONE, RULE_OR, RULE_AND = 0, 1, 2
COUNT_MADE, COUNT_OPEN = 0, 1  # readings of N_horizontal
_LEVEL_STEPS = 5  # N_horizontal that allows a vertical step
_GOAL_BAND = 2  # voxels of height around the goal within which vertical steps are suppressed
_FIRST_NODES = 4096
_NODE = np.dtype(
    [
        ("key", "i8"),
        ("cell", "i8"),
        ("cost", "f8"),
        ("parent", "i8"),
        ("arrived", "i1"),
        ("made", "i1"),
        ("closed", "b1"),
    ],
    align=True,
)
COSINE: Float = np.divide(STEPS @ STEPS.T, np.outer(LENGTHS, LENGTHS), where=np.outer(LENGTHS, LENGTHS) > 0.0,
                          out=np.ones((27, 27)))  # fmt: skip
LEVEL = int(sum(1 << n for n in range(27) if STEPS[n, 2] == 0 and n != 13))  # bits of the level moves


@nb.njit(cache=True)
def _may_climb(rule: int, reading: int, moves: int, height: int, made: int) -> bool:
    """Whether vertical steps are allowed from a cell.

    Args:
        rule: RULE_NONE, RULE_OR or RULE_AND.
        reading: COUNT_MADE or COUNT_OPEN.
        moves: open moves, bits.
        height: above the goal, voxels.
        made: level steps since the last vertical one.
    """
    if rule == RULE_NONE:
        return True
    level = moves & LEVEL
    count = made
    if reading == COUNT_OPEN:
        count = 0
        while level != 0:
            level &= level - 1
            count += 1
    hemmed = moves & LEVEL == 0
    far = abs(height) > _GOAL_BAND
    enough = count >= _LEVEL_STEPS
    return (hemmed and far and enough) if rule == RULE_AND else (hemmed or far or enough)


@nb.njit(cache=True)
def _place(table: Int, node_of: Record, key: int) -> int:
    """Place of a key in the hash table (node numbers, -1 where empty), or where it would go."""
    mask = table.shape[0] - 1
    place = (key * 0x9E3779B1 >> 12) & mask
    while table[place] >= 0 and node_of[table[place]].key != key:
        place = (place + 1) & mask
    return int(place)


@nb.njit(cache=True)
def _is_dominated(table: Int, node_of: Record, key: int, made: int) -> bool:
    """Whether the same cell and step were closed before, at no greater cost, with more level steps made."""
    for more in range(1, 6 - made):
        other = table[_place(table, node_of, key + more)]
        if other >= 0 and node_of[other].closed:
            return True
    return False


@nb.njit(cache=True)
def _push(heap_f: Float, heap_node: Int, size: int, f: float, node: int) -> int:
    at = size
    while at > 0:
        above = (at - 1) >> 1
        if heap_f[above] <= f:
            break
        heap_f[at], heap_node[at] = heap_f[above], heap_node[above]
        at = above
    heap_f[at], heap_node[at] = f, node
    return size + 1


@nb.njit(cache=True)
def _pop(heap_f: Float, heap_node: Int, size: int) -> int:
    """Take the first entry out of a heap of `size`; it must have been read before."""
    size -= 1
    f, node = heap_f[size], heap_node[size]
    at = 0
    while True:
        child = 2 * at + 1
        if child >= size:
            break
        if child + 1 < size and heap_f[child + 1] < heap_f[child]:
            child += 1
        if heap_f[child] >= f:
            break
        heap_f[at], heap_node[at] = heap_f[child], heap_node[child]
        at = child
    heap_f[at], heap_node[at] = f, node
    return size


@nb.njit(cache=True)
def _longer(array: Int) -> Int:
    grown = np.empty(2 * array.shape[0], dtype=array.dtype)
    grown[: array.shape[0]] = array
    return grown


@nb.njit(cache=True)
def _with_node(table: Int, node_of: Record, nodes: int, key: int) -> tuple[Int, Record]:
    """Table and nodes, where need be twice as long, with the next node under a new key."""
    if nodes == node_of.shape[0]:
        table, node_of = np.full(2 * table.shape[0], -1, dtype=np.int64), grown(node_of)
        for node in range(nodes):
            table[_place(table, node_of, node_of[node].key)] = node
    table[_place(table, node_of, key)] = nodes
    return table, node_of


@nb.njit(cache=True)
def find_directed(
    free: UInt8, shape: Int, start: Int, goal: Int, exact: bool, turn_weight: float, first_costs: Float,
    rule: int, reading: int, max_expansions: int,
) -> tuple[int, float, int, Int32]:  # fmt: skip
    """Return status, objective in voxels (paper: length and first cost), expansions, cells (P, 3).

    `free` is bits of the padded grid of this shape (3,) (`jump.Terrain`), ends are padded indices of free
    cells, `turn_weight` and `first_costs`, of each move (27,) as the first one, are in voxels.
    """
    row, slab = shape[2], shape[1] * shape[2]
    source = start[0] * slab + start[1] * row + start[2]
    target = goal[0] * slab + goal[1] * row + goal[2]
    counts = exact and rule != 0 and reading == 0
    table, node_of = np.full(4 * _FIRST_NODES, -1, dtype=np.int64), np.empty(_FIRST_NODES, dtype=_NODE)
    heap_f, heap_node = np.empty(_FIRST_NODES), np.empty(_FIRST_NODES, dtype=np.int64)
    key = (source * 27 + 13) * 6 if exact else source
    table[_place(table, node_of, key)] = 0
    _write(node_of, 0, key, source, 0.0, -1, 13, 0)
    nodes, expansions, size = 1, 0, _push(heap_f, heap_node, 0, 0.0, 0)
    while size > 0:
        node = heap_node[0]
        size = _pop(heap_f, heap_node, size)
        if node_of[node].closed:
            continue
        node_of[node].closed = True
        cell, cost, made = node_of[node].cell, node_of[node].cost, node_of[node].made
        if counts and _is_dominated(table, node_of, node_of[node].key, made):
            continue
        if cell == target:
            return FOUND, cost, expansions, _trace(node, node_of, row, slab)
        if expansions >= max_expansions:
            return BUDGET, np.inf, expansions, np.empty((0, 3), dtype=np.int32)
        expansions += 1
        ci, cj, ck, before = cell // slab, cell % slab // row, cell % row, node_of[node].arrived
        moves = open_moves(neighbourhood(free, shape, ci, cj, ck))
        if not _may_climb(rule, reading, moves, ck - goal[2], made):
            moves &= LEVEL
        for n in range(27):
            if not moves >> n & 1:
                continue
            other = cell + STEPS[n, 0] * slab + STEPS[n, 1] * row + STEPS[n, 2]
            steps = 0 if STEPS[n, 2] != 0 else min(made + 1, _LEVEL_STEPS)
            key = (other * 27 + n) * 6 + (steps if counts else 0) if exact else other
            penalty = 0.0 if before == 13 else turn_weight * (1.0 - COSINE[before, n])
            there = cost + LENGTHS[n] + (first_costs[n] if before == 13 else 0.0)
            there += penalty if exact else 0.0
            new = table[_place(table, node_of, key)]
            if new >= 0 and (node_of[new].closed or there >= node_of[new].cost - 1e-9):
                continue
            if new < 0:
                table, node_of = _with_node(table, node_of, nodes, key)
                new, nodes = nodes, nodes + 1
            _write(node_of, new, key, other, there, node, n, steps)
            ahead = octile(ci + STEPS[n, 0] - goal[0], cj + STEPS[n, 1] - goal[1], ck + STEPS[n, 2] - goal[2])
            f = there + ahead * (1.0 + 1e-9) + (0.0 if exact else penalty)  # ties: towards the goal
            if size == heap_f.shape[0]:
                heap_f, heap_node = _longer(heap_f), _longer(heap_node)
            size = _push(heap_f, heap_node, size, f, new)
    return NO_PATH, np.inf, expansions, np.empty((0, 3), dtype=np.int32)


@nb.njit(cache=True, inline="always")
def _write(
    node_of: Record, node: int, key: int, cell: int, cost: float, parent: int, arrived: int, made: int
) -> None:
    """An open node."""
    node_of[node].key, node_of[node].cell, node_of[node].cost = key, cell, cost
    node_of[node].parent, node_of[node].arrived = parent, arrived
    node_of[node].made, node_of[node].closed = made, False


@nb.njit(cache=True)
def _trace(last: int, node_of: Record, row: int, slab: int) -> Int32:
    """Cells (P, 3) of the path to a node."""
    count, node = 0, last
    while node >= 0:
        count += 1
        node = node_of[node].parent
    path = np.empty((count, 3), dtype=np.int32)
    node = last
    for at in range(count - 1, -1, -1):
        cell = node_of[node].cell
        path[at, 0], path[at, 1], path[at, 2] = cell // slab, cell % slab // row, cell % row
        node = node_of[node].parent
    return path
