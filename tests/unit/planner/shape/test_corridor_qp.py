"""B-spline smoothing: exact matrices, optimal and within limits, clear, and honest about failure."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.optimize import LinearConstraint, NonlinearConstraint, minimize

from tests.shaped import shaped
from uavexp.arrays import Bool, Float
from uavexp.check.fields import bounds, box, empty, field_from
from uavexp.field import DistanceField
from uavexp.geometry import polyline_length_m
from uavexp.planner.find.free_space import free_space
from uavexp.planner.shape.cone_program import NO_CUTS, Problem, solve
from uavexp.planner.shape.corridor_qp import CorridorQp, Derivative
from uavexp.planner.shape.flight_corridor import Corridor, make_corridor
from uavexp.planner.shape.shortcut import shortcut
from uavexp.planner.shape.timing import resample
from uavexp.planner.spline.clamped import Basis, end_points, make_basis, to_trajectory
from uavexp.trajectory import derivative, evaluate
from uavexp.types import Goal, Limits, PlanRequest, PlanStatus

LIMITS = Limits(
    max_speed_mps=5.0, max_acceleration_mps2=3.5, max_body_rate_radps=2.0, body_size_m=(0.32, 0.32, 0.12)
)
KINDS = [(d, d.order + 1) for d in Derivative]


def ask(
    field: DistanceField, grid: Bool, start: Float, goal: Float, velocity: Float | None = None, **more: Any
) -> PlanRequest:
    return PlanRequest(
        time_s=5.0,
        position_m=start,
        velocity_mps=np.zeros(3) if velocity is None else velocity,
        acceleration_mps2=np.zeros(3),
        goal=Goal(position_m=goal, is_target=more.get("target", True), score=0.0),
        field=field,
        flight_bounds_m=bounds(grid),
    )


def hall() -> tuple[Bool, DistanceField, Float]:
    """Two walls with a gap each, and the way round them."""
    grid = empty((12.0, 8.0, 2.4))
    box(grid, (3.5, 0.0, 0.0), (4.0, 5.5, 2.4))
    box(grid, (7.5, 2.5, 0.0), (8.0, 8.0, 2.4))
    way = np.array([[1.0, 1.0, 1.2], [3.0, 6.2, 1.2], [4.6, 6.2, 1.2], [7.0, 1.8, 1.2], [8.5, 1.8, 1.2]])
    return grid, field_from(grid), np.concatenate([way, [[11.0, 7.0, 1.2]]])


def reference_spline(control: Float, degree: int) -> BSpline:
    spans = len(control) - degree
    knots = np.concatenate([np.zeros(degree), np.arange(spans + 1.0), np.full(degree, float(spans))])
    return BSpline(knots, control, degree)


@pytest.mark.parametrize(("kind", "degree"), KINDS)
@pytest.mark.parametrize("spans", [1, 2, 7])
def test_energy_is_the_integral_by_gauss_legendre(kind: Derivative, degree: int, spans: int) -> None:
    control = np.random.default_rng(spans).normal(size=(spans + degree, 3))
    basis, spline = make_basis(degree, spans, kind.order), reference_spline(control, degree)
    node, weight = np.polynomial.legendre.leggauss(6)
    at = (np.arange(spans)[:, None] + 0.5 + 0.5 * node).ravel()
    integral = (np.tile(0.5 * weight, spans)[:, None] * spline(at, kind.order) ** 2).sum()
    assert np.einsum("ia,ij,ja", control, basis.energy, control) == pytest.approx(integral, rel=1e-10)


@pytest.mark.parametrize(("kind", "degree"), KINDS)
def test_trajectory_and_derivative_control_points_are_the_splines(kind: Derivative, degree: int) -> None:
    control, h = np.random.default_rng(1).normal(size=(8 + degree, 3)), 0.3
    basis, spline = make_basis(degree, 8, kind.order), reference_spline(control, degree)
    flown = to_trajectory(basis, control, h, 2.0, True)
    times = np.linspace(0.0, 8.0, 101)[1:-1]
    for order in range(degree + 1):
        np.testing.assert_allclose(
            derivative(flown, 2.0 + h * times, order), spline(times, order) / h**order, rtol=1e-6, atol=1e-6
        )
    for order, matrix in ((1, basis.velocity), (2, basis.acceleration)):
        knots = spline.t[order:-order]
        lower = BSpline(knots, matrix @ control, degree - order)
        np.testing.assert_allclose(lower(times), spline(times, order), atol=1e-10)


@pytest.mark.parametrize(("kind", "degree"), KINDS)
def test_end_points_give_the_end_states(kind: Derivative, degree: int) -> None:
    basis, states = make_basis(degree, 6, kind.order), np.random.default_rng(2).normal(size=(2, 3, 3))
    control = np.zeros((6 + degree, 3))
    ends = end_points(basis, 0.4, *states)
    control[:3], control[-3:] = ends[:3], ends[3:]
    flown = to_trajectory(basis, control, 0.4, 0.0, False)
    for moment, state in ((0.0, states[0]), (flown.end_s, states[1])):
        got = np.stack([part[0] for part in evaluate(flown, np.array([moment]))])
        np.testing.assert_allclose(got, state, atol=1e-9)


def open_problem(degree: int, order: int, speed: float, strength: float) -> tuple[Problem, Basis]:
    """Eight metres through a corridor that is one box, from rest to rest."""
    spans = 8
    basis = make_basis(degree, spans, order)
    corner = np.array([8.0, 1.0, 0.5])
    normal = np.tile(np.concatenate([np.eye(3), -np.eye(3)]), (spans, 1))
    offset = np.tile([9.0, 2.0, 2.0, 1.0, 0.3, 1.0], spans)
    corridor = Corridor(normal, offset, 6 * np.arange(spans + 1), True)
    ends = np.zeros((2, 3, 3))
    ends[1, 0] = corner
    guess = np.linspace(0.0, 1.0, spans + degree)[:, None] * corner
    return Problem(basis, corridor, guess, ends[0], ends[1], speed, strength), basis


@pytest.mark.parametrize(("kind", "degree"), KINDS)
def test_without_active_limits_the_qp_is_the_linear_solution(kind: Derivative, degree: int) -> None:
    problem, basis = open_problem(degree, kind.order, 50.0, 50.0)
    control = solve(problem, 0.5, NO_CUTS, 5).control
    assert control is not None
    free = slice(3, -3)
    pinned = control.copy()
    pinned[free] = 0.0
    best = np.linalg.solve(basis.energy[free, free], -(basis.energy @ pinned)[free])
    np.testing.assert_allclose(control[free], best, atol=1e-4)


def test_with_active_limits_it_is_near_the_cone_programs_optimum() -> None:
    """Against scipy's SLSQP on the norms themselves: cost within 5 %, limits kept by both."""
    speed, strength, h = 2.1, 1.9, 0.75
    problem, basis = open_problem(3, 2, speed, strength)
    sideways = np.array([[0.0, 0.0, 0.0], [0.2, 0.9, 0.0], [0.0, 0.0, 0.0]])
    problem = problem._replace(start=sideways)
    answer = solve(problem, h, NO_CUTS, 12)
    control = answer.control
    assert control is not None
    assert len(answer.cuts.order) > 0
    matrices = np.concatenate([basis.velocity / h / speed, basis.acceleration / h**2 / strength])
    assert np.linalg.norm(matrices @ control, axis=1).max() <= 1.0 + 1e-6
    pinned = control.copy()
    pinned[3:-3] = 0.0

    def whole(x: Float) -> Float:
        out = pinned.copy()
        out[3:-3] = x.reshape(-1, 3)
        return out

    def cost(control: Float) -> float:
        return float(np.einsum("ia,ij,ja", control, basis.energy, control))

    exact = minimize(
        lambda x: cost(whole(x)),
        control[3:-3].ravel(),
        method="SLSQP",
        constraints=[
            NonlinearConstraint(lambda x: ((matrices @ whole(x)) ** 2).sum(axis=1), -np.inf, 1.0),
            LinearConstraint(np.eye(3 * len(control[3:-3])), -1.0, 9.0),
        ],
        options={"maxiter": 500, "ftol": 1e-10},
    )
    assert exact.success
    assert cost(whole(exact.x)) <= cost(control) * (1.0 + 1e-6) <= 1.05 * cost(whole(exact.x))


@pytest.mark.parametrize("kind", list(Derivative))
def test_keeps_limits_corridor_and_length(kind: Derivative) -> None:
    grid, field, way = hall()
    start = np.array([1.5, 0.2, 0.0])
    request = ask(field, grid, way[0], way[-1], velocity=start)
    result = shaped(CorridorQp(derivative=kind), request, way, LIMITS)
    assert result.trajectory is not None, result.reason
    times = np.append(np.arange(5.0, result.trajectory.end_s, 1e-3), result.trajectory.end_s)
    position, velocity, acceleration = evaluate(result.trajectory, times)
    assert np.linalg.norm(velocity, axis=1).max() <= LIMITS.max_speed_mps
    assert np.linalg.norm(acceleration, axis=1).max() <= LIMITS.max_acceleration_mps2
    assert field.distance_m(position).min() >= 0.26
    np.testing.assert_allclose(position[[0, -1]], way[[0, -1]], atol=1e-9)
    np.testing.assert_allclose(velocity[0], start, atol=1e-9)
    np.testing.assert_allclose(velocity[-1], 0.0, atol=1e-9)
    space = free_space(field, way[[0, -1]], request.flight_bounds_m, 0.26, np.inf, False)
    straightest = polyline_length_m(shortcut(resample(way, 0.1), space))
    most = 1.06 if kind is Derivative.SNAP else 1.03  # least snap rounds its corners more widely
    assert polyline_length_m(position) < most * straightest


def test_clear_by_construction_without_the_last_check() -> None:
    """Every point of every span lies in that span's region: sampled, not read off the rows."""
    grid, field, way = hall()
    route = resample(resample(way, 0.1), 0.6)
    basis = make_basis(3, len(route) - 1, 2)
    corridor = make_corridor(field, route, bounds(grid), 0.26, False)
    ends = np.zeros((2, 3, 3))
    ends[:, 0] = route[[0, -1]]
    guess = np.stack(
        [np.interp(np.linspace(0, 1, len(route) + 2), np.linspace(0, 1, len(route)), c) for c in route.T],
        axis=1,
    )
    control = solve(Problem(basis, corridor, guess, *ends, 5.0, 3.5), 0.6, NO_CUTS, 12).control
    assert control is not None
    u = np.linspace(0.0, 1.0, 21)
    bernstein = np.stack([(1 - u) ** 3, 3 * u * (1 - u) ** 2, 3 * u**2 * (1 - u), u**3], axis=1)
    for m, points in enumerate(bernstein @ (basis.bezier @ control)):
        faces = slice(corridor.first[m], corridor.first[m + 1])
        assert (points @ corridor.normal[faces].T <= corridor.offset[faces] + 1e-5).all()


def test_times_of_a_dynamic_planner_set_the_duration() -> None:
    grid = empty((8.0, 4.0, 2.0))
    field, way = field_from(grid), np.linspace([1.0, 2.0, 1.0], [7.0, 2.0, 1.0], 20)
    request = ask(field, grid, way[0], way[-1])
    share = np.linspace(0.0, 1.0, 20)
    slow = shaped(CorridorQp(duration_margin=1.0), request, way, LIMITS, 9.0 * share)
    assert slow.trajectory is not None
    assert slow.trajectory.duration_s == pytest.approx(9.0)


def test_a_moving_end_can_be_stopped_from() -> None:
    grid = empty((12.0, 4.0, 2.0))
    box(grid, (8.0, 0.0, 0.0), (8.5, 4.0, 2.0))
    field, shaper = field_from(grid), CorridorQp(end_speed_mps=2.0)
    speeds = []
    for goal_x in (4.0, 7.6):
        way = np.array([[1.0, 2.0, 1.0], [goal_x, 2.0, 1.0]])
        request = ask(field, grid, way[0], way[-1], target=False)
        flown = shaped(shaper, request, way, LIMITS).trajectory
        assert flown is not None
        assert not flown.at_rest
        speeds.append(float(np.linalg.norm(evaluate(flown, np.array([flown.end_s]))[1])))
    assert speeds == pytest.approx([2.0, 0.0], abs=1e-9)


def test_a_start_towards_a_wall_is_braked_first() -> None:
    grid = empty((8.0, 4.0, 2.0))
    box(grid, (4.0, 0.0, 0.0), (4.3, 4.0, 2.0))
    field = field_from(grid)
    way = np.array([[1.5, 2.0, 1.0], [0.5, 2.0, 1.0]])
    request = ask(field, grid, way[0], way[1], velocity=np.array([2.5, 0.0, 0.0]))
    result = shaped(CorridorQp(), request, way, LIMITS)
    assert result.trajectory is not None
    position = evaluate(result.trajectory, np.arange(5.0, result.trajectory.end_s, 1e-3))[0]
    assert 0.5 < position[:, 0].max() - 1.5 < 2.2
    late = dataclasses.replace(request, position_m=np.array([3.2, 2.0, 1.0]))
    refused = shaped(CorridorQp(), late, np.array([late.position_m, way[1]]), LIMITS)
    assert refused.status is PlanStatus.NOT_CLEAR
    assert "braking" in refused.reason


@pytest.mark.parametrize(
    ("change", "status"),
    [
        ({"limits": dataclasses.replace(LIMITS, max_speed_mps=0.0)}, PlanStatus.LIMITS),
        ({"limits": dataclasses.replace(LIMITS, max_acceleration_mps2=0.0)}, PlanStatus.LIMITS),
        ({"velocity": np.array([6.0, 0.0, 0.0])}, PlanStatus.LIMITS),
        ({"velocity": np.array([np.nan, 0.0, 0.0])}, PlanStatus.SOLVER),
        ({"path": np.array([[1.0, 1.0, 1.0], [np.nan, 1.0, 1.0]])}, PlanStatus.SOLVER),
        ({"path": np.array([[1.0, 1.0, 1.0]])}, PlanStatus.SOLVER),
        ({"times": np.array([0.0, np.inf])}, PlanStatus.SOLVER),
        ({"times": np.array([0.0, 0.0])}, PlanStatus.OK),
        ({"goal": np.array([1.0, 1.0, 1.0])}, PlanStatus.OK),  # two equal points: it stays
        ({"gap": 0.4}, PlanStatus.NOT_CLEAR),  # a passage narrower than the body
    ],
)
def test_bad_input_has_a_status(change: dict[str, Any], status: PlanStatus) -> None:
    grid = empty((6.0, 2.0, 2.0))
    start, goal = np.array([1.0, 1.0, 1.0]), change.get("goal", np.array([5.0, 1.0, 1.0]))
    if "gap" in change:
        box(grid, (2.5, 0.0, 0.0), (3.5, 1.0 - 0.5 * change["gap"], 2.0))
        box(grid, (2.5, 1.0 + 0.5 * change["gap"], 0.0), (3.5, 2.0, 2.0))
    request = ask(field_from(grid), grid, start, goal, velocity=change.get("velocity"))
    result = shaped(
        CorridorQp(),
        request,
        change.get("path", np.stack([start, goal])),
        change.get("limits", LIMITS),
        change.get("times"),
    )
    assert result.status is status
    assert (result.trajectory is not None) == (status is PlanStatus.OK)
    assert result.reason or status is PlanStatus.OK
