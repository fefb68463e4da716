"""Improved A*: exact against Dijkstra with the direction in the state, its rule, its smoothing."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from tests.voxel_paths import is_path, random_grid, turning
from uavexp.check.fields import box, empty, field_from
from uavexp.check.hall import LIMITS
from uavexp.check.requests import ask
from uavexp.errors import ConfigError
from uavexp.geometry import polyline_length_m
from uavexp.metrics.voxel_path import (
    cumulative_heading_change_rad,
    excess_climb,
    height_reversals,
    mean_heading_change_rad,
)
from uavexp.planner.find.turning import Turning
from uavexp.planner.find.voxels.directed import COUNT_MADE, COUNT_OPEN, RULE_AND, RULE_NONE, RULE_OR
from uavexp.planner.find.voxels.voxel_grid import VoxelGrid, Wish
from uavexp.planner.find.voxels.waypoints import in_sight, key_waypoints, smoothed, without_reversals
from uavexp.planner.improved_astar import ImprovedAstar
from uavexp.planner.shape.timing import resample
from uavexp.trajectory import evaluate
from uavexp.types import PlanStatus

RULES = {"none": RULE_NONE, "or": RULE_OR, "and": RULE_AND}


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("made_counts", [True, False])
def test_exact_form_has_the_least_sum_by_dijkstra(rule: str, made_counts: bool) -> None:
    rng = np.random.default_rng(7)
    wish = Wish(turn_weight=0.8, rule=RULES[rule], reading=COUNT_MADE if made_counts else COUNT_OPEN)
    solved = 0
    for density in (0.05, 0.2, 0.35, 0.35, 0.5):
        free, start, goal = random_grid(rng, (5, 5, 4), density)
        found = VoxelGrid(free).turning(np.array(start), np.array(goal), wish)
        least = turning(free, start, goal, 0.8, rule, made_counts)
        assert found.cost == pytest.approx(least, abs=1e-8)
        solved += found.found
    assert solved or rule == "and"


def test_paper_form_finds_paths_that_are_hardly_longer() -> None:
    rng = np.random.default_rng(2)
    longer = []
    for _ in range(60):
        free, start, goal = random_grid(rng, (8, 8, 6), 0.25)
        grid, ends = VoxelGrid(free), (np.array(start), np.array(goal))
        plain, paper = grid.shortest(*ends), grid.turning(*ends, Wish(exact=False, rule=RULE_NONE))
        assert plain.found == paper.found
        if plain.found:
            assert is_path(free, paper.cells)
            longer.append(paper.cost - plain.cost)
    assert min(longer) > -1e-9
    assert max(longer) <= 0.5 * 2.0 + 1e-9  # the greatest penalty, λ (1 - cos 180°)


def test_without_weight_the_exact_form_is_plain() -> None:
    rng = np.random.default_rng(5)
    for _ in range(30):
        free, start, goal = random_grid(rng, (7, 6, 6), 0.3)
        grid, ends = VoxelGrid(free), (np.array(start), np.array(goal))
        wish = Wish(turn_weight=0.0, rule=RULE_NONE)
        assert grid.turning(*ends, wish).cost == pytest.approx(grid.shortest(*ends).cost, abs=1e-9)


def test_near_the_goals_height_the_rule_asks_for_five_level_steps() -> None:
    free = np.ones((12, 1, 3), dtype=bool)
    ends = np.array([0, 0, 0]), np.array([11, 0, 1])
    cells = VoxelGrid(free).turning(*ends, Wish()).cells
    climb = int(np.flatnonzero(np.diff(cells[:, 2]))[0])
    assert climb >= 5
    assert VoxelGrid(free).turning(*ends, Wish(rule=RULE_NONE)).cost < 11.0 + np.sqrt(2.0)


def test_a_rule_that_forbids_every_climb_falls_back_and_says_so() -> None:
    grid = empty((3.0, 3.0, 3.0))
    field = field_from(grid)
    request = ask(field, np.array([0.8, 1.5, 0.8]), np.array([2.2, 1.5, 2.2]))
    for rule, remark in (("or", ""), ("and", "plain A*: the vertical rule leaves no path")):
        planner = ImprovedAstar(find=Turning(vertical_rule=rule))  # type: ignore[arg-type]
        planner.reset(LIMITS, np.random.default_rng(0))
        result = planner.plan(request)
        assert result.status is PlanStatus.OK
        assert result.reason == remark


def test_an_exhausted_budget_falls_back_and_says_so() -> None:
    free = np.ones((30, 30, 8), dtype=bool)
    free[12:15, :25] = False
    grid, ends = VoxelGrid(free), (np.array([5, 5, 4]), np.array([25, 5, 4]))
    budget = grid.shortest(*ends).expansions
    finder = Turning(max_expansions=budget, form="exact")
    answer, remark = finder.search(grid, *ends, finder.wish(0.1))
    assert answer.found
    assert remark == f"plain A*: not found in {budget} expansions"


def test_the_first_step_keeps_the_direction_flown() -> None:
    free = np.ones((9, 9, 3), dtype=bool)
    free[3:6, 3:6] = False
    grid, start, goal = VoxelGrid(free), np.array([0, 4, 1]), np.array([8, 4, 1])
    for side in (-1.0, 1.0):
        wish = Wish(first_weight=2.0, first_direction=(0.0, side, 0.0), rule=RULE_NONE)
        cells = grid.turning(start, goal, wish).cells
        assert np.sign(cells[len(cells) // 2, 1] - 4) == side


def test_the_weight_in_metres_is_dearer_in_small_voxels() -> None:
    assert Turning(weight_unit="metres").wish(0.03).turn_weight == pytest.approx(0.5 / 0.03)  # type: ignore[arg-type]
    assert Turning().wish(0.03).turn_weight == 0.5


def test_sight_touches_every_cell_of_the_segment() -> None:
    rng = np.random.default_rng(4)
    for _ in range(300):
        free = rng.random((6, 5, 4)) > 0.15
        a, b = rng.uniform(0.01, [5.99, 4.99, 3.99], (2, 3))
        sampled = (a + np.linspace(0.0, 1.0, 4000)[:, None] * (b - a)).astype(int)
        if in_sight(free, a, b):
            assert free[tuple(sampled.T)].all()
        else:
            assert in_sight(free, b, a) is False
    corner = np.ones((2, 2, 1), dtype=bool)
    corner[0, 1, 0] = False  # touched by the diagonal at one edge only
    assert not in_sight(corner, np.array([0.5, 0.5, 0.5]), np.array([1.5, 1.5, 0.5]))


def test_smoothing_keeps_ends_stays_free_and_shortens() -> None:
    rng = np.random.default_rng(9)
    for _ in range(60):
        free, start, goal = random_grid(rng, (10, 9, 6), 0.2)
        found = VoxelGrid(free).shortest(np.array(start), np.array(goal))
        if not found.found or start == goal:
            continue
        path = found.cells + 0.5
        curve = smoothed(free, path)
        np.testing.assert_allclose(curve[[0, -1]], path[[0, -1]])
        assert all(in_sight(free, a, b) for a, b in pairwise(curve))
        assert polyline_length_m(curve) <= polyline_length_m(path) + 1e-9


def test_key_waypoints_of_a_straight_run_are_its_ends() -> None:
    free = np.ones((40, 3, 3), dtype=bool)
    path = np.column_stack([np.arange(40) + 0.5, np.full(40, 1.5), np.full(40, 1.5)])
    np.testing.assert_array_equal(key_waypoints(free, path), path[[0, -1]])


def test_a_reversal_in_the_open_is_removed_and_one_round_a_wall_kept() -> None:
    spur = np.array([[0.5, 0.5, 0.5], [6.5, 0.5, 0.5], [2.5, 2.5, 0.5]])
    free = np.ones((8, 4, 1), dtype=bool)
    assert len(without_reversals(free, spur)) == 2
    free[:6, 1] = False
    assert len(without_reversals(free, spur)) == 3


@pytest.mark.parametrize(("least", "count"), [(0.0, 3), (0.1, 1), (0.6, 0)])
def test_small_swings_of_height_are_no_reversals(least: float, count: int) -> None:
    """An end 0.03 below its voxel's centre, up by 0.5, down by 0.4, and 0.02 down to the other end."""
    heights = [0.0, 0.03, 0.03, 0.53, 0.13, 0.15, 0.13]
    path = np.column_stack([np.arange(7.0), np.zeros(7), heights])
    assert height_reversals(path, least) == count


def test_reversals_are_the_changes_of_sign_where_every_swing_counts() -> None:
    heights = np.random.default_rng(0).normal(0.0, 1.0, 60).cumsum()
    path = np.column_stack([np.arange(60.0), np.zeros(60), heights])
    assert height_reversals(path) == np.count_nonzero(np.diff(np.sign(np.diff(heights))))


def test_metrics_of_a_path_by_hand() -> None:
    path = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 1], [3, 0, 1], [4, 0, 0], [4, 0, 0], [5, 0, 1.0]])
    assert polyline_length_m(path) == pytest.approx(2.0 + 3.0 * np.sqrt(2.0))
    assert height_reversals(path) == 2  # up, level, down, up
    assert excess_climb(path) == pytest.approx(3.0 - 1.0)
    turns = np.array([45.0, 45.0, 45.0, 90.0])
    assert np.degrees(cumulative_heading_change_rad(path)) == pytest.approx(turns.sum())
    assert np.degrees(mean_heading_change_rad(path)) == pytest.approx(turns.mean())
    straight = np.array([[0, 0, 0], [1, 1, 1.0], [3, 3, 3]])
    assert height_reversals(straight) == 0
    assert excess_climb(straight) == 0.0
    assert mean_heading_change_rad(straight) == 0.0


def test_what_is_flown_follows_the_smoothed_path() -> None:
    grid = empty((8.0, 5.0, 2.0))
    box(grid, (3.0, 0.0, 0.0), (3.4, 3.2, 2.0))
    request = ask(field_from(grid), np.array([1.0, 1.0, 1.0]), np.array([7.0, 1.0, 1.0]))
    planner = ImprovedAstar()
    planner.reset(LIMITS, np.random.default_rng(0))
    result = planner.plan(request)
    assert result.trajectory is not None
    times = np.linspace(result.trajectory.start_s, result.trajectory.end_s, 200)
    path = resample(result.path_m, 0.05)
    apart = np.linalg.norm(evaluate(result.trajectory, times)[0][:, None] - path[None], axis=2).min(axis=1)
    assert apart.max() < 1.0


def test_impossible_parameters_are_refused() -> None:
    wrong = {
        "form": "best",
        "weight_unit": "feet",
        "vertical_rule": "xor",
        "n_horizontal": "all",
        "turn_weight": -1.0,
    }
    for name, value in wrong.items():
        with pytest.raises(ConfigError, match=name):
            Turning(**{name: value})  # type: ignore[arg-type]
