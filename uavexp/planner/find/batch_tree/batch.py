"""Batch informed trees on states with velocity: BIT* with one heap (Gammell, Srinivasa and Barfoot 2015).

Batches of samples make ever denser random geometric graphs; each is searched by a lazy A* that reuses
the tree of the batch before. Vertices wait to be expanded and edges to be checked in the same heap: a
vertex under cost + to_goal, an edge under cost + its own cost + to_goal; both are lower bounds on a
solution through them, so a batch ends when the least is no better than the best solution. An edge is
checked against the map only when it comes out. A vertex whose cost falls is expanded again, hence a
batch that runs to its end leaves the best path of its graph. Edges found blocked are remembered.

Between batches everything that cannot be on a better solution is pruned: samples by the lower bounds
from the start and to the goal, vertices by their cost and the latter. On kinodynamic edges the bounds
are times of `motion.least_time` (reachability), on straight ones lengths.
"""

from __future__ import annotations

import heapq
from typing import NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Float, Int
from uavexp.planner.find.batch_tree.edges import EdgeRule, bound, corners_fit, cost, fits
from uavexp.planner.find.batch_tree.informed import Region, draw, draw_near, sampled_region
from uavexp.planner.find.batch_tree.neighbours import (
    Neighbours,
    neighbours_within,
    radius_of,
    sort_into_cells,
)
from uavexp.planner.find.batch_tree.tree_rows import (
    GOAL,
    NONE,
    START,
    TreeRows,
    add,
    attach,
    detach,
    edges_of,
    new_tree,
    path_to,
    prune,
)
from uavexp.planner.find.free_space import FreeSpace, cubic_is_free, straight_is_free

_FAILURES = 1 << 16  # blocked edges that are remembered
_TRIES = 1000  # draws for one free sample
_VELOCITY_SPREAD = 0.15  # of the speed limit: scatter of velocities about the best solution


class Budget(NamedTuple):
    """How long a search goes on, and what it draws."""

    first_batches: int  # at most, until there is a solution
    batches: int  # after that
    batch_samples: int
    iterations: int  # edges taken from the heap
    local_share: float  # of a batch drawn near the best solution, once there is one
    local_spread_m: float
    rewire_factor: float  # on the least radius that keeps asymptotic optimality


class Found(NamedTuple):
    """What a search leaves."""

    path: Float  # (P, 6) states from start to goal; empty: none
    steps: Float  # (P - 1,) cost of each edge
    history: Float  # (K, 2) iteration and best cost, whenever that fell
    iterations: int
    checks: int  # looks at the map
    samples: int  # drawn and free
    edges: Float  # (E, 2, 3) of the tree at the end


@nb.njit(cache=True)
def search(
    space: FreeSpace,
    start: Float,
    goal: Float,
    seeds: Float,
    reach_m: float,
    rule: EdgeRule,
    budget: Budget,
    rng: np.random.Generator,
) -> Found:
    """Grow the tree until the budget is spent; the best solution found never gets worse.

    Args:
        space: where.
        start: (6,) state.
        goal: (6,) state.
        seeds: (S, 6) free states that the first batch begins with.
        reach_m: least radius of that batch, so that it links them.
        rule: edges.
        budget: effort.
        rng: all that is drawn comes from here.
    """
    tree = new_tree(2 + seeds.shape[0] + (budget.first_batches + budget.batches) * budget.batch_samples)
    whole = bound(rule, start, goal)
    add(tree, START, start, START, 0, 0.0, whole)
    add(tree, GOAL, goal, GOAL, 0, whole, 0.0)
    tree.cost[START] = 0.0
    count = 2
    for seed in seeds:
        add(tree, count, seed, count, 0, bound(rule, start, seed), bound(rule, seed, goal))
        count += 1
    failed = np.zeros(_FAILURES, dtype=np.int64)
    serial, iterations, checks, samples = count, 0, 0, 0
    history = [(0.0, 0.0)]
    history.clear()
    solved = 0  # batches with a solution before them
    for batch in range(budget.first_batches + budget.batches):
        best = tree.cost[GOAL]
        if solved >= budget.batches if np.isfinite(best) else batch >= budget.first_batches:
            break
        solved += np.isfinite(best)
        count = prune(tree, count)
        region = sampled_region(space, start, goal, best * (rule.top_mps if rule.kinodynamic else 1.0))
        added, free, drawn, looked = _add_batch(tree, count, serial, batch, space, region, rule, budget, rng)
        count, serial, samples, checks = count + added, serial + added, samples + added, checks + looked
        measure = region.volume_m3 * free / max(drawn, 1)
        radius = radius_of(count, measure, 6 if rule.kinodynamic else 3, budget.rewire_factor)
        radius = max(min(radius, rule.longest_m), reach_m if batch == 0 else 0.0)
        cells = sort_into_cells(tree.state, count, radius)
        iterations, looked = _search_batch(
            tree, count, batch, cells, space, rule, failed, iterations, budget.iterations, history
        )
        checks += looked
        if iterations >= budget.iterations:
            break
    path, steps = path_to(tree, GOAL)
    record = np.empty((len(history), 2))
    for n in range(len(history)):
        record[n, 0], record[n, 1] = history[n]
    return Found(path, steps, record, iterations, checks, samples, edges_of(tree, count))


@nb.njit(cache=True)
def _add_batch(
    tree: TreeRows,
    count: int,
    serial: int,
    batch: int,
    space: FreeSpace,
    region: Region,
    rule: EdgeRule,
    budget: Budget,
    rng: np.random.Generator,
) -> tuple[int, int, int, int]:
    """Draw a batch of samples that may better the solution.

    Returns:
        How many; of the draws from the whole region, those kept and all of them; looks at the map.
    """
    best, start, goal = tree.cost[GOAL], tree.state[START], tree.state[GOAL]
    top_mps = rule.top_mps if rule.kinodynamic else 0.0
    spread_mps = _VELOCITY_SPREAD * top_mps
    solution, state = path_to(tree, GOAL), np.empty(6)
    added, drawn, free, checks = 0, 0, 0, 0
    for n in range(budget.batch_samples):
        local = np.isfinite(best) and n < budget.local_share * budget.batch_samples
        for _ in range(_TRIES):
            if local:
                kept = draw_near(space, region, solution, budget.local_spread_m, spread_mps, rng, state)
            else:
                kept = draw(space, region, top_mps, rng, state)
            checks += 1
            drawn += not local
            from_start, to_goal = bound(rule, start, state), bound(rule, state, goal)
            if kept and from_start + to_goal < best:
                add(tree, count + added, state, serial + added, batch, from_start, to_goal)
                added += 1
                free += not local
                break
    return added, free, drawn, checks


@nb.njit(cache=True)
def _search_batch(
    tree: TreeRows,
    count: int,
    batch: int,
    cells: Neighbours,
    space: FreeSpace,
    rule: EdgeRule,
    failed: Int,
    iterations: int,
    most: int,
    history: list[tuple[float, float]],
) -> tuple[int, int]:
    """Lazy A* on the graph of all samples; returns the iterations so far and the checks made."""
    queue = [
        (tree.cost[v] + tree.to_goal[v], v, NONE, 0.0) for v in range(count) if np.isfinite(tree.cost[v])
    ]
    heapq.heapify(queue)
    near = np.empty(count, dtype=np.int64)
    checks = 0
    while len(queue) > 0 and iterations < most:
        key, tail, head, step = heapq.heappop(queue)
        if key >= tree.cost[GOAL]:
            break
        if head == NONE:
            if tree.expanded_batch[tail] != batch or tree.cost[tail] < tree.expanded_cost[tail]:
                _expand(tree, tail, batch, cells, near, rule, queue)
            continue
        iterations += 1
        if tree.cost[tail] + step >= tree.cost[head] or _is_failed(tree, tail, head, failed):
            continue
        if not corners_fit(tree, tail, head, rule):
            continue
        if rule.kinodynamic:
            free, looked = cubic_is_free(space, tree.state[tail], tree.state[head], step, rule.top_mps)
        else:
            free, looked = straight_is_free(space, tree.state[tail], tree.state[head])
        checks += looked
        if not free:
            failed[_slot(tree, tail, head)] = _name(tree, tail, head)
            continue
        before = tree.cost[GOAL]
        _connect(tree, tail, head, step, queue)
        if tree.cost[GOAL] < before:
            history.append((float(iterations), tree.cost[GOAL]))
    return iterations, checks


@nb.njit(cache=True)
def _expand(
    tree: TreeRows,
    tail: int,
    batch: int,
    cells: Neighbours,
    near: Int,
    rule: EdgeRule,
    queue: list[tuple[float, int, int, float]],
) -> None:
    """Put the edges from a vertex that may better a solution into the heap."""
    only_new = tree.expanded_cost[tail] <= tree.cost[tail]  # the others were tried at this cost before
    tree.expanded_cost[tail], tree.expanded_batch[tail] = tree.cost[tail], batch
    best, here, paid = tree.cost[GOAL], tree.state[tail], tree.cost[tail]
    for n in range(neighbours_within(cells, tree.state, tail, near)):
        head = near[n]
        if head in (tail, START) or (only_new and tree.born[head] != batch):
            continue
        if paid >= tree.cost[head]:
            continue
        step = bound(rule, here, tree.state[head])
        there = paid + step
        if there >= tree.cost[head] or there + tree.to_goal[head] >= best:
            continue
        if rule.kinodynamic:
            step = cost(rule, here, tree.state[head])
            there = paid + step
        if there < tree.cost[head] and there + tree.to_goal[head] < best and fits(tree, tail, head, rule):
            heapq.heappush(queue, (there + tree.to_goal[head], tail, head, step))


@nb.njit(cache=True)
def _connect(
    tree: TreeRows, tail: int, head: int, step: float, queue: list[tuple[float, int, int, float]]
) -> None:
    """Make `tail` the parent of `head`, pass the gain on to its descendants, and expand them all again."""
    detach(tree, head)
    attach(tree, tail, head, step)
    waiting = [head]
    while len(waiting) > 0:
        vertex = waiting.pop()
        tree.cost[vertex] = tree.cost[tree.parent[vertex]] + tree.step[vertex]
        heapq.heappush(queue, (tree.cost[vertex] + tree.to_goal[vertex], vertex, NONE, 0.0))
        child = tree.child[vertex]
        while child != NONE:
            waiting.append(int(child))
            child = tree.sibling[child]


@nb.njit(cache=True)
def _name(tree: TreeRows, tail: int, head: int) -> int:
    return int((tree.serial[tail] << 32) | tree.serial[head]) + 1


@nb.njit(cache=True)
def _slot(tree: TreeRows, tail: int, head: int) -> int:
    """Where a blocked edge is remembered; a later one of the same slot replaces it."""
    return int(((tree.serial[tail] * 40503) ^ (tree.serial[head] * 30011)) & (_FAILURES - 1))


@nb.njit(cache=True)
def _is_failed(tree: TreeRows, tail: int, head: int, failed: Int) -> bool:
    return bool(failed[_slot(tree, tail, head)] == _name(tree, tail, head))
