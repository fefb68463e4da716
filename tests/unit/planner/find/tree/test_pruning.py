"""What cannot be on a better solution is neither drawn nor kept: bounds checked row by row."""

from __future__ import annotations

import numpy as np
import pytest

from tests.unit.planner.find.tree.test_tree import GOAL as GOAL_M
from tests.unit.planner.find.tree.test_tree import START as START_M
from tests.unit.planner.find.tree.test_tree import walled
from uavexp.planner.find.batch_tree.batch import Budget, _add_batch
from uavexp.planner.find.batch_tree.edges import EdgeRule, bound
from uavexp.planner.find.batch_tree.informed import sampled_region
from uavexp.planner.find.batch_tree.tree_rows import GOAL, START, TreeRows, add, attach, new_tree, prune

BEGIN, END = (np.concatenate([point, np.zeros(3)]) for point in (START_M, GOAL_M))
BUDGET = Budget(20, 10, 200, 10**6, 0.0, 0.3, 1.1)


def begun(rule: EdgeRule, slack: float) -> TreeRows:
    """Start and goal, joined at `slack` times the least cost there may be."""
    tree, whole = new_tree(400), bound(rule, BEGIN, END)
    add(tree, START, BEGIN, START, 0, 0.0, whole)
    add(tree, GOAL, END, GOAL, 0, whole, 0.0)
    attach(tree, START, GOAL, slack * whole)
    tree.cost[START], tree.cost[GOAL] = 0.0, slack * whole
    return tree


@pytest.mark.parametrize("kinodynamic", [False, True])
def test_only_samples_that_may_better_the_solution_are_drawn(kinodynamic: bool) -> None:
    rule = EdgeRule(kinodynamic, 0.0, 6.0, 5.0, 3.5)
    tree, space = begun(rule, 1.1), walled()
    best = tree.cost[GOAL]
    region = sampled_region(space, BEGIN, END, best * (rule.top_mps if kinodynamic else 1.0))
    rng = np.random.Generator(np.random.PCG64(0))
    added, *_ = _add_batch(tree, 2, 2, 0, space, region, rule, BUDGET, rng)
    assert added > 20
    for state in tree.state[2 : 2 + added]:
        assert bound(rule, BEGIN, state) + bound(rule, state, END) < best


def test_vertices_are_pruned_by_their_cost_and_the_bound_to_the_goal() -> None:
    rule = EdgeRule(False, 0.0, 6.0, 5.0, 3.5)
    tree = begun(rule, 1.2)
    best, rng = tree.cost[GOAL], np.random.default_rng(1)
    for row in range(2, 200):
        state = np.concatenate([rng.uniform((0.5, 0.5, 1.0), (9.5, 7.5, 1.4)), np.zeros(3)])
        add(tree, row, state, row, 0, bound(rule, BEGIN, state), bound(rule, state, END))
        if row % 2:  # joined to the start, by a way up to a half longer than the straight one
            step = rng.uniform(1.0, 1.5) * tree.from_start[row]
            attach(tree, START, row, step)
            tree.cost[row] = step
    cost, to_goal = tree.cost[:200].copy(), tree.to_goal[:200].copy()
    is_vertex = np.isfinite(cost) & (cost + to_goal <= best * (1 + 1e-12))
    is_sample = ~is_vertex & (tree.from_start[:200] + to_goal < best)
    kept = prune(tree, 200)
    assert kept == np.count_nonzero(is_vertex | is_sample)
    assert np.count_nonzero(np.isfinite(tree.cost[:kept])) == np.count_nonzero(is_vertex)
    left = tree.serial[:kept][np.isfinite(tree.cost[:kept])]
    assert set(left) == set(np.flatnonzero(is_vertex))
    assert np.count_nonzero(np.isfinite(cost) & ~is_vertex & (cost <= best)) > 0  # else it says nothing
