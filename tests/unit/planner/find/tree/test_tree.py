"""The batch search against independent answers: shortest paths of its graph, dense samples, closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from uavexp.arrays import Float
from uavexp.check.fields import bounds, box, empty, field_from
from uavexp.errors import ConfigError
from uavexp.geometry import polyline_length_m
from uavexp.planner.df_bitstar import DfBitstar
from uavexp.planner.find.batch_tree.batch import Budget, Found, search
from uavexp.planner.find.batch_tree.cubic_motion import (
    cubic_coefficients,
    cubic_time,
    keeps_limits,
    least_time,
    scalar_time,
)
from uavexp.planner.find.batch_tree.edges import EdgeRule
from uavexp.planner.find.batch_tree.neighbours import neighbours_within, sort_into_cells
from uavexp.planner.find.free_space import FreeSpace, free_space, straight_is_free
from uavexp.planner.find.tree import Edges, Tree
from uavexp.planner.shape.base import Shaper
from uavexp.planner.shape.corridor_qp import CorridorQp
from uavexp.planner.shape.time_law import TimeLaw, stop_and_go
from uavexp.trajectory import evaluate
from uavexp.types import Goal, Limits, PlanRequest, PlanResult, PlanStatus

LIMITS = Limits(
    max_speed_mps=5.0, max_acceleration_mps2=3.5, max_body_rate_radps=4.0, body_size_m=(0.32, 0.32, 0.12)
)
START, GOAL = np.array([1.0, 1.0, 1.2]), np.array([9.0, 7.0, 1.2])
GRID = empty((10.0, 8.0, 2.4))
box(GRID, (3.0, 0.0, 0.0), (3.2, 5.0, 2.4))
box(GRID, (6.0, 3.0, 0.0), (6.2, 8.0, 2.4))
FIELD = field_from(GRID)
STRAIGHT = EdgeRule(False, 0.0, 6.0, 5.0, 3.5)


def walled() -> FreeSpace:
    return free_space(FIELD, np.stack([START, GOAL]), bounds(GRID), 0.26, 0.3, False)


def grow(rule: EdgeRule = STRAIGHT, seed: int = 0, **changes: Any) -> Found:
    numbers = {"first_batches": 20, "batches": 10, "batch_samples": 100, "iterations": 10**6}
    shares = {"local_share": 0.0, "local_spread_m": 0.3, "rewire_factor": 1.1}
    ends = [np.concatenate([point, np.zeros(3)]) for point in (START, GOAL)]
    rng = np.random.Generator(np.random.PCG64(seed))
    return search(walled(), *ends, np.zeros((0, 6)), 0.0, rule, Budget(**(numbers | shares | changes)), rng)


def plan(start: Float = START, goal: Float = GOAL, limits: Limits = LIMITS, **parameters: Any) -> PlanResult:
    velocity = parameters.pop("velocity", np.zeros(3))
    field, grid = parameters.pop("field", FIELD), parameters.pop("grid", GRID)
    shape, unknown = parameters.pop("shape", CorridorQp()), parameters.pop("unknown", "optimistic")
    made = DfBitstar(find=Tree(**parameters), shape=shape, unknown=unknown)
    made.reset(limits, np.random.default_rng(3))
    request = PlanRequest(
        time_s=2.0,
        position_m=start,
        velocity_mps=velocity,
        acceleration_mps2=np.zeros(3),
        goal=Goal(position_m=goal, is_target=True, score=0.0),
        field=field,
        flight_bounds_m=bounds(grid),
    )
    return made.plan(request)


def bang_bang_s(distance: float, start: float, end: float, top: float, strongest: float) -> float:
    """Least time by trying every peak speed on a fine grid: no closed form."""
    best = np.inf
    for peak in np.linspace(-top, top, 20001):
        ramps = abs(peak - start) / strongest + abs(peak - end) / strongest
        covered = (peak**2 - start**2) / (2 * strongest) * np.sign(peak - start)
        covered += (peak**2 - end**2) / (2 * strongest) * np.sign(peak - end)
        left = distance - covered
        if abs(left) < 2e-3:
            best = min(best, ramps)
        elif peak != 0.0 and left / peak > 0.0:
            best = min(best, ramps + left / peak)
    return best


@pytest.mark.parametrize(
    ("distance", "start", "end"),
    [(4.0, 0.0, 0.0), (40.0, 0.0, 0.0), (3.0, 2.0, -1.0), (0.5, 4.0, 0.0), (-2.0, 1.0, 1.0), (0.0, 2.0, 2.0)],
)
def test_scalar_time_is_the_least_of_all_peak_speeds(distance: float, start: float, end: float) -> None:
    brute = bang_bang_s(distance, start, end, 5.0, 3.5)
    assert scalar_time(distance, start, end, 5.0, 3.5) == pytest.approx(brute, abs=5e-3)


def test_rest_to_rest_cubic_has_its_closed_form() -> None:
    start, end = np.zeros(6), np.array([3.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    exact = np.sqrt(6.0 * 3.0 / 3.5)  # acceleration 6 d / T² at both ends
    assert exact <= cubic_time(start, end, np.inf, 5.0, 3.5) <= exact * 1.01
    assert least_time(start, end, 5.0, 3.5) == pytest.approx(2.0 * np.sqrt(3.0 / 3.5))


def test_cubic_keeps_the_norm_limits_on_the_whole_edge() -> None:
    rng = np.random.default_rng(0)
    joined = 0
    for _ in range(300):
        start, end = rng.uniform(-2.0, 2.0, (2, 6))
        duration = cubic_time(start, end, np.inf, 3.0, 2.5)
        if not np.isfinite(duration):
            continue
        joined += 1
        assert keeps_limits(start, end, duration, 3.0, 2.5)
        assert duration >= least_time(start, end, 3.0, 2.5) * (1.0 - 1e-9)
        c, t = cubic_coefficients(start, end, duration), np.linspace(0.0, duration, 2000)
        speed = np.linalg.norm(np.stack([t**0, 2 * t, 3 * t**2], axis=1) @ c[1:], axis=1)
        strength = np.linalg.norm(np.stack([2 * t**0, 6 * t], axis=1) @ c[2:], axis=1)
        assert speed.max() <= 3.0 * (1.0 + 1e-6)
        assert strength.max() <= 2.5 * (1.0 + 1e-6)
        np.testing.assert_allclose(np.vander([duration], 4, increasing=True) @ c, end[None, :3], atol=1e-9)
    assert joined > 100


def test_free_lines_keep_the_clearance_everywhere() -> None:
    space, rng, free_lines = walled(), np.random.default_rng(1), 0
    for _ in range(2000):
        a, b = rng.uniform([0.3, 0.3, 1.0], [9.7, 7.7, 1.4], (2, 3))
        free, _ = straight_is_free(space, a, b)
        dense = FIELD.distance_m(a + np.linspace(0.0, 1.0, 400)[:, None] * (b - a)).min()
        if free:
            free_lines += 1
            assert dense >= 0.26
        else:
            assert dense <= 0.26 + 0.25 * 0.1 + 0.01
    assert 300 < free_lines < 1900


def test_neighbours_are_those_of_brute_force() -> None:
    states = np.random.default_rng(2).uniform(0.0, 3.0, (300, 6))
    cells, out = sort_into_cells(states, 300, 0.7), np.empty(300, dtype=np.int64)
    for row in range(0, 300, 7):
        found = set(out[: neighbours_within(cells, states, row, out)].tolist())
        apart = np.linalg.norm(states[:, :3] - states[row, :3], axis=1)
        assert found == set(np.flatnonzero(apart <= 0.7).tolist())


def test_neighbours_within_no_radius_are_those_at_the_same_place_however_large_the_tree() -> None:
    states = np.random.default_rng(2).uniform(0.0, 30.0, (50, 6))
    states[7] = states[3]
    cells, out = sort_into_cells(states, 50, 0.0), np.empty(50, dtype=np.int64)
    assert set(out[: neighbours_within(cells, states, 3, out)].tolist()) == {3, 7}


def test_a_batch_leaves_the_shortest_path_of_its_graph() -> None:
    # one batch with every sample a neighbour of every other: the visibility graph of the samples
    from scipy.sparse.csgraph import dijkstra

    found = grow(first_batches=1, batches=0, batch_samples=150, rewire_factor=50.0, iterations=10**7)
    rng, space = np.random.Generator(np.random.PCG64(0)), walled()
    from uavexp.planner.find.batch_tree.informed import draw, sampled_region

    region, points = sampled_region(space, START, GOAL, np.inf), [START, GOAL]
    while len(points) < 152:
        state = np.empty(6)
        if draw(space, region, 0.0, rng, state):
            points.append(state[:3])
    count = len(points)
    weights = np.zeros((count, count))
    for i in range(count):
        for j in range(count):
            length = float(np.linalg.norm(points[i] - points[j]))
            if i != j and length <= 6.0 and straight_is_free(space, points[i], points[j])[0]:
                weights[i, j] = length
    assert found.history[-1, 1] == pytest.approx(dijkstra(weights, indices=0)[1], rel=1e-12)


@pytest.mark.parametrize("kinodynamic", [False, True])
def test_cost_never_rises_and_more_batches_are_no_worse(kinodynamic: bool) -> None:
    rule = STRAIGHT._replace(kinodynamic=kinodynamic)
    few, many = (grow(rule, batches=n, local_share=0.5, rewire_factor=2.0, first_batches=60) for n in (3, 6))
    assert len(few.path) > 0
    for found in (few, many):
        assert (np.diff(found.history[:, 1]) < 0.0).all()
        assert (np.diff(found.history[:, 0]) > 0.0).all()
        assert found.steps.sum() == pytest.approx(found.history[-1, 1], rel=1e-9)
    np.testing.assert_array_equal(many.history[: len(few.history)], few.history)  # same tree, grown on


def test_converges_to_the_exact_shortest_path() -> None:
    def least(x: float, y: float, u: float, w: float) -> float:  # around both wall ends, in the plane
        return float(np.hypot(x - 1.0, y - 1.0) + np.hypot(u - x, w - y) + np.hypot(9.0 - u, 7.0 - w))

    # corners of the walls grown by the clearance, less the arcs: a lower and an upper bound
    lower = least(3.1, 5.05, 6.1, 2.95)
    upper = least(3.1 - 0.3, 5.0 + 0.45, 6.1 + 0.3, 3.0 - 0.45)
    found = grow(batches=40, local_share=0.5)
    assert lower < found.history[-1, 1] < upper * 1.01
    assert polyline_length_m(found.path[:, :3]) == pytest.approx(found.history[-1, 1])


def test_the_filter_keeps_corners_that_can_be_rounded() -> None:
    sharp = grow(local_share=0.5)
    rule = STRAIGHT._replace(corner_mps=1.5)
    found = grow(rule, local_share=0.5)

    def speeds(path: Float) -> Float:
        steps = np.diff(path[:, :3], axis=0)
        lengths = np.linalg.norm(steps, axis=1)
        cosine = np.einsum("ij,ij->i", steps[:-1], steps[1:]) / (lengths[:-1] * lengths[1:])
        half = np.tan(0.5 * np.arccos(np.clip(cosine, -1.0, 1.0)))
        return np.sqrt(3.5 * 0.5 * np.minimum(lengths[:-1], lengths[1:]) / np.maximum(half, 1e-12))

    assert speeds(found.path).min() >= 1.5 * (1.0 - 1e-9)
    assert speeds(sharp.path).min() < 1.5
    assert found.history[-1, 1] >= sharp.history[-1, 1] * 0.999  # a subset of the edges is no shorter


def test_kinodynamic_motion_keeps_limits_and_clearance_without_smoothing() -> None:
    result = plan(shape=TimeLaw())
    assert result.trajectory is not None
    times = np.arange(result.trajectory.start_s, result.trajectory.end_s, 1e-3)
    position, velocity, acceleration = evaluate(result.trajectory, times)
    assert np.linalg.norm(velocity, axis=1).max() <= 5.0 * (1.0 + 1e-6)
    assert np.linalg.norm(acceleration, axis=1).max() <= 3.5 * (1.0 + 1e-6)
    assert FIELD.distance_m(position).min() >= 0.26
    assert result.history[-1, 1] == pytest.approx(result.trajectory.duration_s)
    assert np.abs(np.diff(velocity, axis=0)).max() <= 3.5e-3 * 1.01  # velocity is continuous


def test_time_is_no_less_than_the_bound_and_less_than_stopping_at_corners() -> None:
    result = plan()
    guide = plan(edges=Edges.STRAIGHT)
    assert result.history[-1, 1] >= np.linalg.norm(GOAL - START) / 5.0
    assert result.history[-1, 1] < stop_and_go(guide.path_m, 0.0, LIMITS).duration_s


@pytest.mark.parametrize("edges", list(Edges))
@pytest.mark.parametrize("shape", [CorridorQp(), TimeLaw()])
def test_every_form_plans(edges: Edges, shape: Shaper) -> None:
    result = plan(edges=edges, shape=shape)
    assert result.status is PlanStatus.OK
    assert result.trajectory is not None
    ends = evaluate(result.trajectory, np.array([result.trajectory.start_s, result.trajectory.end_s]))[0]
    np.testing.assert_allclose(ends, np.stack([START, GOAL]), atol=1e-6)
    assert result.collision_checks > 0
    assert result.expansions > 0


def test_without_the_filter_edges_are_straight_whatever_they_are_called() -> None:
    plain = plan(dynamics_filter=False)
    same = plan(dynamics_filter=False, edges=Edges.STRAIGHT)
    np.testing.assert_array_equal(plain.history, same.history)
    assert plain.history[-1, 1] == pytest.approx(polyline_length_m(plain.path_m))


def test_bad_requests_have_a_status_and_a_reason() -> None:
    wall = np.array([3.1, 1.0, 1.2])
    none = Limits(
        max_speed_mps=0.0, max_acceleration_mps2=0.0, max_body_rate_radps=1.0, body_size_m=(0.3, 0.3, 0.1)
    )
    full = np.ones_like(GRID)
    shut = GRID.copy()
    box(shut, (3.0, 0.0, 0.0), (3.2, 8.0, 2.4))
    slit = shut.copy()
    slit[30:32, 38:42] = False  # 0.4 m, narrower than the body with its clearance
    answers = {
        PlanStatus.START_BLOCKED: [plan(start=wall), plan(field=field_from(full), grid=full)],
        PlanStatus.GOAL_BLOCKED: [plan(goal=wall), plan(goal=np.array([20.0, 1.0, 1.2]))],
        PlanStatus.LIMITS: [plan(limits=none), plan(velocity=np.array([6.0, 0.0, 0.0]))],
        PlanStatus.NO_PATH: [
            plan(field=field_from(shut), first_batches=10),
            plan(field=field_from(slit), first_batches=10),
            plan(max_iterations=1),
        ],
        PlanStatus.SOLVER: [plan(start=np.array([np.nan, 1.0, 1.0]))],
    }
    for status, results in answers.items():
        for result in results:
            assert result.status is status, result.reason
            assert result.reason


def test_a_goal_where_the_vehicle_is_needs_no_way() -> None:
    result = plan(goal=START.copy())
    assert result.status is PlanStatus.OK
    assert result.trajectory is not None


def test_unknown_space_is_closed_when_conservative() -> None:
    unknown = np.zeros_like(GRID)
    unknown[40:55] = True
    field = field_from(GRID, unknown=unknown)
    assert plan(field=field).status is PlanStatus.OK
    assert plan(field=field, unknown="conservative", first_batches=5).status is PlanStatus.NO_PATH


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("edges", "curly"),
        ("batches", -1),
        ("local_share", 1.0),
    ],
)
def test_bad_parameters_are_refused(name: str, value: object) -> None:
    with pytest.raises(ConfigError, match=name):
        Tree(**{name: value})


def test_stop_and_go_stands_at_every_corner_and_never_leaves_the_path() -> None:
    path = np.array([[0.0, 0.0, 1.0], [2.0, 0.0, 1.0], [2.0, 5.0, 1.5], [2.0, 5.0, 1.5], [1.9, 5.0, 1.5]])
    trajectory = stop_and_go(path, 3.0, LIMITS)
    times = np.arange(3.0, trajectory.end_s, 1e-3)
    position, velocity, acceleration = evaluate(trajectory, times)
    assert np.linalg.norm(velocity, axis=1).max() <= 5.0
    assert 0.99 * 3.5 < np.linalg.norm(acceleration, axis=1).max() <= 3.5 * (1.0 + 1e-9)
    assert np.linalg.norm(evaluate(trajectory, trajectory.breaks_s)[1], axis=1).max() < 1e-9
    assert polyline_length_m(position) == pytest.approx(polyline_length_m(path), abs=1e-3)
