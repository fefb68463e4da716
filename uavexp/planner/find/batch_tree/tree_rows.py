"""The tree of a batch search as arrays: samples and vertices in rows, children in linked lists."""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Bool, Float, Int, Int32

START, GOAL = 0, 1  # rows of the two ends
NONE = -1


class TreeRows(NamedTuple):
    """Samples and vertices; row 0 is the start, row 1 the goal."""

    state: Float  # (N, 6)
    cost: Float  # (N,) from the start; inf: not in the tree
    step: Float  # (N,) cost of the edge from the parent
    from_start: Float  # (N,) lower bound
    to_goal: Float  # (N,) lower bound
    expanded_cost: Float  # (N,) cost at the last expansion; inf: never
    expanded_batch: Int32  # (N,)
    born: Int32  # (N,) batch
    serial: Int  # (N,) never reused
    parent: Int32  # (N,)
    child: Int32  # (N,) first
    sibling: Int32  # (N,) next


@nb.njit(cache=True)
def new_tree(size: int) -> TreeRows:
    """Room for so many rows."""
    links = np.full((5, size), NONE, dtype=np.int32)
    numbers = np.full((5, size), np.inf)
    serial = np.zeros(size, dtype=np.int64)
    return TreeRows(
        np.empty((size, 6)),
        numbers[0],
        numbers[1],
        numbers[2],
        numbers[3],
        numbers[4],
        links[0],
        links[1],
        serial,
        links[2],
        links[3],
        links[4],
    )


@nb.njit(cache=True)
def add(
    tree: TreeRows, row: int, state: Float, serial: int, batch: int, from_start: float, to_goal: float
) -> None:
    """Write a new sample into a row."""
    tree.state[row] = state
    tree.from_start[row], tree.to_goal[row] = from_start, to_goal
    tree.born[row], tree.serial[row] = batch, serial
    _cut(tree, row)


@nb.njit(cache=True)
def _cut(tree: TreeRows, row: int) -> None:
    """Make a row a sample that is not in the tree."""
    tree.cost[row], tree.step[row], tree.expanded_cost[row] = np.inf, 0.0, np.inf
    tree.expanded_batch[row] = tree.parent[row] = tree.child[row] = tree.sibling[row] = NONE


@nb.njit(cache=True)
def attach(tree: TreeRows, tail: int, head: int, step: float) -> None:
    """Make `tail` the parent of `head`, which has none; costs are the caller's to set."""
    tree.parent[head], tree.step[head] = tail, step
    tree.sibling[head], tree.child[tail] = tree.child[tail], head


@nb.njit(cache=True)
def detach(tree: TreeRows, row: int) -> None:
    """Take a row from its parent, if it has one."""
    parent = tree.parent[row]
    if parent == NONE:
        return
    if tree.child[parent] == row:
        tree.child[parent] = tree.sibling[row]
    else:
        other = tree.child[parent]
        while tree.sibling[other] != row:
            other = tree.sibling[other]
        tree.sibling[other] = tree.sibling[row]
    tree.parent[row] = tree.sibling[row] = NONE


@nb.njit(cache=True)
def prune(tree: TreeRows, count: int) -> int:
    """Drop what cannot better the best solution; returns how many rows are left, in their order.

    A vertex stays in the tree with its parent, while cost + to_goal is no more than the best cost.
    Otherwise it is a sample again, if its lower bounds leave hope.
    """
    best = tree.cost[GOAL]
    if not np.isfinite(best):
        return count
    stays = _still_in_tree(tree, count, best)
    place = np.full(count, NONE, dtype=np.int32)
    rows = 0
    for row in range(count):
        if stays[row] or row == GOAL or tree.from_start[row] + tree.to_goal[row] < best:
            place[row] = rows
            rows += 1
    for row in range(count):
        to = place[row]
        if to == NONE:
            continue
        parent, step = (place[tree.parent[row]] if stays[row] and row != START else NONE), tree.step[row]
        cost, expanded = tree.cost[row], tree.expanded_cost[row]
        batch, born = tree.expanded_batch[row], tree.born[row]
        bounds = tree.from_start[row], tree.to_goal[row]
        add(tree, to, tree.state[row].copy(), tree.serial[row], born, bounds[0], bounds[1])
        if stays[row]:
            tree.cost[to], tree.expanded_cost[to], tree.expanded_batch[to] = cost, expanded, batch
            tree.parent[to], tree.step[to] = parent, step
    tree.child[:rows] = NONE
    for row in range(rows - 1, -1, -1):
        parent = tree.parent[row]
        if parent != NONE:
            tree.sibling[row], tree.child[parent] = tree.child[parent], row
    return rows


@nb.njit(cache=True)
def _still_in_tree(tree: TreeRows, count: int, best: float) -> Bool:
    """Which rows stay vertices."""
    stays = np.zeros(count, dtype=np.bool_)
    limit = best * (1.0 + 1e-12)  # the solution's own vertices reach it, up to rounding
    stays[START] = True
    waiting = [START]
    while len(waiting) > 0:
        child = tree.child[waiting.pop()]
        while child != NONE:
            if tree.cost[child] + tree.to_goal[child] <= limit:
                stays[child] = True
                waiting.append(int(child))
            child = tree.sibling[child]
    return stays


@nb.njit(cache=True)
def path_to(tree: TreeRows, row: int) -> tuple[Float, Float]:
    """States (P, 6) from the start to a vertex and the costs (P - 1,) of the edges; empty for a sample."""
    if not np.isfinite(tree.cost[row]):
        return np.empty((0, 6)), np.empty(0)
    length, at = 1, row
    while tree.parent[at] != NONE:
        length, at = length + 1, tree.parent[at]
    states, steps = np.empty((length, 6)), np.empty(length - 1)
    at = row
    for n in range(length - 1, -1, -1):
        states[n] = tree.state[at]
        if n > 0:
            steps[n - 1] = tree.step[at]
            at = tree.parent[at]
    return states, steps


@nb.njit(cache=True)
def edges_of(tree: TreeRows, count: int) -> Float:
    """Ends (E, 2, 3) of all edges of the tree, m."""
    out = np.empty((count, 2, 3))
    rows = 0
    for row in range(count):
        if tree.parent[row] != NONE:
            out[rows, 0], out[rows, 1] = tree.state[tree.parent[row], :3], tree.state[row, :3]
            rows += 1
    return out[:rows].copy()
