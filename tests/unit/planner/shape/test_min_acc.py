"""Minimum-acceleration planning against closed forms and on hard requests."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from uavexp.arrays import Bool, Float
from uavexp.check.fields import bounds, box, empty, field_from
from uavexp.errors import ConfigError
from uavexp.field import DistanceField
from uavexp.geometry import polyline_length_m
from uavexp.planner.min_acc import MinAcc
from uavexp.planner.shape.scp import Scp
from uavexp.planner.spline.cubic import segment_model
from uavexp.planner.spline.uniform import power_matrix
from uavexp.trajectory import Trajectory, evaluate
from uavexp.types import Goal, Limits, PlanRequest, PlanStatus

LIMITS = Limits(
    max_speed_mps=2.5, max_acceleration_mps2=2.5, max_body_rate_radps=2.0, body_size_m=(0.32, 0.32, 0.12)
)


def planner(limits: Limits = LIMITS, **changes: float | str) -> MinAcc:
    shaped = {name: changes.pop(name) for name in list(changes) if hasattr(Scp(), name)}
    made = MinAcc(shape=Scp(**shaped), **changes)  # type: ignore[arg-type]
    made.reset(limits, np.random.default_rng(0))
    return made


def request(
    grid: Bool,
    start: tuple[float, float, float],
    goal: tuple[float, float, float],
    *,
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0),
    acceleration: tuple[float, float, float] = (0.0, 0.0, 0.0),
    target: bool = True,
    field: DistanceField | None = None,
) -> PlanRequest:
    return PlanRequest(
        time_s=2.0,
        position_m=np.array(start),
        velocity_mps=np.array(velocity),
        acceleration_mps2=np.array(acceleration),
        goal=Goal(position_m=np.array(goal), is_target=target, score=0.0),
        field=field_from(grid) if field is None else field,
        flight_bounds_m=bounds(grid),
    )


def sampled(trajectory: Trajectory) -> tuple[Float, Float, Float]:
    times = np.append(np.arange(trajectory.start_s, trajectory.end_s, 1e-3), trajectory.end_s)
    return evaluate(trajectory, times)


def energy(trajectory: Trajectory) -> float:
    """∫ ‖r''‖² of a trajectory of cubic pieces."""
    a = 2.0 * trajectory.coefficients[:, 2]
    duration = np.diff(trajectory.breaks_s)
    b = a + 6.0 * trajectory.coefficients[:, 3] * duration[:, None]
    return float(((a * a + a * b + b * b).sum(axis=1) * duration / 3.0).sum())


HALL = empty((14.0, 6.0, 3.0))
FLIGHT = ((1.5, 3.0, 1.5), (11.5, 3.0, 1.5))


def test_free_flight_is_the_cubic_of_least_acceleration() -> None:
    # slow enough that no limit binds; 12 L² / T³ is the least ∫ a² between states of rest
    # (Pontryagin), reached by the cubic L (3 s² - 2 s³); the spline starts and ends at zero acceleration
    excess = []
    for spacing in (1.0, 0.4):
        free = planner(duration_margin=2.0, control_spacing_m=spacing, jerk_s=0.0)
        result = free.plan(request(HALL, *FLIGHT))
        assert result.trajectory is not None
        duration = result.trajectory.duration_s
        position = sampled(result.trajectory)[0]
        s = np.linspace(0.0, 1.0, len(position))
        cubic = 1.5 + 10.0 * (3.0 * s**2 - 2.0 * s**3)
        assert np.abs(position[:, 0] - cubic).max() < 0.02 * 10.0
        np.testing.assert_allclose(position[:, 1:], [[3.0, 1.5]] * len(position), atol=1e-3)
        excess.append(energy(result.trajectory) / (12.0 * 10.0**2 / duration**3) - 1.0)
    assert 0.0 < excess[1] < excess[0] < 0.2


def test_where_jerk_alone_counts_free_flight_is_the_quintic_of_least_jerk() -> None:
    smooth = planner(duration_margin=2.0, control_spacing_m=0.6, jerk_s=100.0)
    result = smooth.plan(request(HALL, *FLIGHT))
    assert result.trajectory is not None
    position = sampled(result.trajectory)[0]
    s = np.linspace(0.0, 1.0, len(position))
    quintic = 1.5 + 10.0 * (6.0 * s**5 - 15.0 * s**4 + 10.0 * s**3)
    assert np.abs(position[:, 0] - quintic).max() < 0.005 * 10.0


def test_free_flight_is_the_optimum_of_the_same_problem_in_casadi() -> None:
    limits = replace(LIMITS, max_speed_mps=4.0, max_acceleration_mps2=4.0)
    asked = request(HALL, *FLIGHT, velocity=(0.3, 0.4, 0.1), acceleration=(-0.5, 0.4, 0.0), target=False)
    jerk_s = 0.5
    trajectory = planner(limits, duration_margin=2.5, tolerance=1e-9, jerk_s=jerk_s).plan(asked).trajectory
    assert trajectory is not None
    segments, h = len(trajectory.breaks_s) - 1, float(np.diff(trajectory.breaks_s)[0])
    end_velocity = evaluate(trajectory, trajectory.breaks_s[-1:])[1][0]
    opti, cost, rows = ca.Opti("conic"), 0, ca.DM(power_matrix(3))
    control = opti.variable(segments + 3, 3)
    for axis in range(3):
        for m in range(segments):
            window = control[m : m + 4, axis]
            cost += segment_model()(window)[0] + (jerk_s / h) ** 2 * (6.0 * rows[3, :] @ window) ** 2
    ends = ((0, asked.position_m, asked.velocity_mps, asked.acceleration_mps2),)
    for first, position, velocity, acceleration in ends:
        window = control[first : first + 4, :]
        opti.subject_to(rows[0, :] @ window == position[None])
        opti.subject_to(rows[1, :] @ window == h * velocity[None])
        opti.subject_to(2 * (rows[2, :] @ window) == h**2 * acceleration[None])
    last = control[segments - 1 :, :]
    opti.subject_to(ca.sum1(rows @ last) == asked.goal.position_m[None])
    opti.subject_to(ca.DM([[0, 1, 2, 3]]) @ rows @ last == h * end_velocity[None])
    opti.subject_to(ca.DM([[0, 0, 2, 6]]) @ rows @ last == 0)
    opti.minimize(cost)
    opti.solver("qrqp", {"print_iter": False, "print_header": False, "print_info": False})
    best = opti.solve().value(control)
    windows = np.stack([best[j : j + segments] for j in range(4)], axis=1)
    expected = np.einsum("ij,mjk->mik", power_matrix(3), windows) / h ** np.arange(4)[:, None]
    np.testing.assert_allclose(trajectory.coefficients, expected, atol=2e-3)


def test_free_flight_does_not_crawl() -> None:
    result = planner().plan(request(HALL, *FLIGHT))
    assert result.trajectory is not None
    fastest = 10.0 / 2.5 + 2.5 / 2.5  # trapezoid of full acceleration and speed
    assert fastest < result.trajectory.duration_s <= 1.1 * fastest / 0.95
    assert np.linalg.norm(sampled(result.trajectory)[1], axis=1).max() > 0.85 * 2.5


def test_keeps_to_the_middle_of_a_gap() -> None:
    grid = empty((8.0, 6.0, 2.0))
    box(grid, (3.5, 0.0, 0.0), (4.5, 3.0, 2.0))
    box(grid, (3.5, 3.9, 0.0), (4.5, 6.0, 2.0))  # 0.9 m: 0.45 m to either side
    result = planner().plan(request(grid, (1.0, 2.0, 1.0), (7.0, 5.0, 1.0)))
    assert result.trajectory is not None
    position = sampled(result.trajectory)[0]
    inside = position[(position[:, 0] > 3.6) & (position[:, 0] < 4.4)]
    assert np.abs(inside[:, 1] - 3.45).max() < 0.1


def test_start_and_goal_between_the_same_walls_of_a_bend() -> None:
    grid = ~empty((6.0, 6.0, 2.0))
    grid[5:15, 5:55], grid[5:55, 45:55] = False, False  # an L of 1 m wide corridors
    grid[:, :, 0], grid[:, :, -1] = True, True
    result = planner().plan(request(grid, (1.0, 1.0, 1.0), (5.0, 5.0, 1.0)))
    assert result.trajectory is not None
    field = field_from(grid)
    assert field.distance_m(sampled(result.trajectory)[0]).min() > 0.3


def wall_ahead(distance_m: float) -> Bool:
    """A pillar 1.6 m wide, its face this far ahead of x = 2 m."""
    grid = empty((12.0, 8.0, 2.0))
    box(grid, (2.0 + distance_m, 3.2, 0.0), (2.6 + distance_m, 4.8, 2.0))
    return grid


@pytest.mark.parametrize("distance_m", [1.6, 2.0, 3.0])
@pytest.mark.parametrize("speed", [0.5, 1.5, 2.2])
def test_swings_round_what_it_flies_towards(distance_m: float, speed: float) -> None:
    asked = request(wall_ahead(distance_m), (2.0, 4.0, 1.0), (9.0, 4.0, 1.0), velocity=(speed, 0.0, 0.0))
    result = planner().plan(asked)
    assert result.status is PlanStatus.OK
    assert result.trajectory is not None
    position, velocity, acceleration = sampled(result.trajectory)
    assert asked.field.distance_m(position).min() >= 0.25
    assert np.linalg.norm(velocity, axis=1).max() <= 2.5 + 1e-6
    assert np.linalg.norm(acceleration, axis=1).max() <= 2.5 + 1e-6
    assert polyline_length_m(position) < 1.35 * 7.0


def test_what_cannot_be_avoided_is_not_clear() -> None:
    asked = request(wall_ahead(0.8), (2.0, 4.0, 1.0), (9.0, 4.0, 1.0), velocity=(2.4, 0.0, 0.0))
    result = planner().plan(asked)
    assert result.status is PlanStatus.NOT_CLEAR
    assert "clearance" in result.reason


def test_statuses() -> None:
    grid = empty((6.0, 4.0, 2.0))
    box(grid, (2.9, 0.0, 0.0), (3.1, 4.0, 2.0))
    here, wall, beyond = (1.0, 2.0, 1.0), (3.0, 2.0, 1.0), (5.0, 2.0, 1.0)
    assert planner().plan(request(grid, wall, here)).status is PlanStatus.START_BLOCKED
    assert planner().plan(request(grid, here, wall)).status is PlanStatus.GOAL_BLOCKED
    assert planner().plan(request(grid, here, beyond)).status is PlanStatus.NO_PATH
    too_fast = request(grid, here, (2.0, 3.0, 1.0), velocity=(0.0, 4.0, 0.0))
    assert planner().plan(too_fast).status is PlanStatus.LIMITS


def test_a_vehicle_at_a_wall_gets_away() -> None:
    grid = empty((6.0, 4.0, 2.0))
    box(grid, (3.0, 0.0, 0.0), (6.0, 4.0, 2.0))
    for gap_m in (0.05, 0.15, 0.25):
        result = planner().plan(request(grid, (3.0 - gap_m, 2.0, 1.0), (1.0, 1.0, 1.0)))
        assert result.trajectory is not None
        clearance = field_from(grid).distance_m(sampled(result.trajectory)[0])
        assert clearance.min() > gap_m - 0.03
        assert clearance[-1] > 1.0


def test_end_speed() -> None:
    moving = planner().plan(request(HALL, *FLIGHT, target=False))
    assert moving.trajectory is not None
    assert not moving.trajectory.at_rest
    end = sampled(moving.trajectory)[1][-1]
    np.testing.assert_allclose(end, [1.5, 0.0, 0.0], atol=0.1)
    assert np.linalg.norm(end) == pytest.approx(1.5)
    # a wall 0.4 m behind the goal: only what can be stopped from in what the limit leaves of that
    grid = HALL.copy()
    box(grid, (12.0, 0.0, 0.0), (12.2, 6.0, 3.0))
    careful = planner().plan(request(grid, *FLIGHT, target=False))
    assert careful.trajectory is not None
    speed = float(np.linalg.norm(sampled(careful.trajectory)[1][-1]))
    assert 0.0 < speed <= np.sqrt(2.0 * 2.5 * (0.5 - 0.26))


def test_goal_where_it_already_is() -> None:
    result = planner().plan(request(HALL, FLIGHT[0], FLIGHT[0]))
    assert result.status is PlanStatus.OK
    assert result.trajectory is not None
    assert np.ptp(sampled(result.trajectory)[0], axis=0).max() < 1e-6
    back = planner().plan(request(HALL, FLIGHT[0], FLIGHT[0], velocity=(1.5, 0.5, 0.0)))
    assert back.status is PlanStatus.OK


def test_conservative_plans_stay_in_known_space() -> None:
    grid = empty((8.0, 6.0, 2.0))
    unknown = np.zeros_like(grid)
    unknown[30:50, 0:40] = True  # the straight way is unseen; 2 m at the side are known
    field = field_from(grid, unknown=unknown)
    asked = request(grid, (1.0, 2.0, 1.0), (7.0, 2.0, 1.0), field=field)
    bold, careful = planner().plan(asked), planner(unknown="conservative").plan(asked)
    assert bold.trajectory is not None
    assert careful.trajectory is not None
    assert not field.observed(sampled(bold.trajectory)[0]).all()
    assert field.observed(sampled(careful.trajectory)[0]).all()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("min_clearance_m", 0.0),
        ("min_clearance_m", float("nan")),
        ("safe_clearance_m", 0.2),
        ("obstacle_weight", -1.0),
        ("end_speed_mps", float("inf")),
        ("duration_margin", 0.9),
        ("control_spacing_m", -0.5),
        ("first_iterations", 0),
        ("final_iterations", 2.5),
        ("tolerance", 0.0),
        ("unknown", "brave"),
        ("z_band_m", -0.1),
    ],
)
def test_bad_parameters_are_named(name: str, value: float | str) -> None:
    with pytest.raises(ConfigError, match=name):
        planner(**{name: value})
