"""The spline through corners: its times against the trapezoidal law, its limits broken at corners."""

from __future__ import annotations

import numpy as np
import pytest

from tests.shaped import shaped
from tests.unit.trigger.test_trigger import LIMITS
from uavexp.planner.shape.waypoint_spline import WaypointSpline, passing_times_s
from uavexp.trajectory import evaluate, sample_times
from uavexp.types import Goal, PlanRequest, PlanStatus

V, A = LIMITS.max_speed_mps, LIMITS.max_acceleration_mps2


def request(path: np.ndarray) -> PlanRequest:
    zero = np.zeros(3)
    return PlanRequest(
        time_s=3.0,
        position_m=path[0],
        velocity_mps=zero,
        acceleration_mps2=zero,
        goal=Goal(position_m=path[-1], is_target=True, score=0.0),
        field=None,  # type: ignore[arg-type]  # it looks at no map
        flight_bounds_m=np.array([[-99.0] * 3, [99.0] * 3]),
    )


def spline(path: np.ndarray):
    result = shaped(WaypointSpline(), request(path), path, LIMITS)
    assert result.status is PlanStatus.OK
    assert result.trajectory is not None
    return result.trajectory


@pytest.mark.parametrize("length_m", [0.5, V**2 / A, 20.0])
def test_a_straight_way_takes_the_time_of_the_trapezoid(length_m: float) -> None:
    ends = np.array([[0.0, 0.0, 1.0], [length_m, 0.0, 1.0]])
    ramp_m = V**2 / A
    least = 2.0 * np.sqrt(length_m / A) if length_m <= ramp_m else 2.0 * V / A + (length_m - ramp_m) / V
    assert passing_times_s(ends, LIMITS)[-1] == pytest.approx(least)


def test_corners_on_a_line_are_passed_when_the_trapezoid_is_there() -> None:
    x = np.linspace(0.0, 12.0, 25)
    times = passing_times_s(np.stack([x, 0 * x, 0 * x], axis=1), LIMITS)
    assert np.all(np.diff(times) > 0.0)
    cruising = (x > 0.5 * V**2 / A) & (x < 12.0 - 0.5 * V**2 / A)
    assert np.diff(x[cruising]) / np.diff(times[cruising]) == pytest.approx(V)
    assert x[x < 0.5 * V**2 / A] == pytest.approx(0.5 * A * times[x < 0.5 * V**2 / A] ** 2)


def test_it_passes_every_corner_from_rest_to_rest() -> None:
    path = np.array([[0.0, 0.0, 1.0], [4.0, 0.0, 1.0], [4.0, 3.0, 1.5], [8.0, 3.0, 1.0]])
    trajectory = spline(path)
    position, velocity, _ = evaluate(trajectory, trajectory.breaks_s)
    assert position == pytest.approx(path)
    assert velocity[[0, -1]] == pytest.approx(np.zeros((2, 3)), abs=1e-9)
    assert trajectory.start_s == 3.0


def test_a_right_angle_breaks_the_limits() -> None:
    path = np.array([[0.0, 0.0, 1.0], [6.0, 0.0, 1.0], [6.0, 6.0, 1.0]])
    trajectory = spline(path)
    _, velocity, acceleration = evaluate(trajectory, sample_times(trajectory, trajectory.start_s, 1e-3))
    speed, size = np.linalg.norm(velocity, axis=1), np.linalg.norm(acceleration, axis=1)
    assert size.max() > 1.05 * A or speed.max() > 1.05 * V


@pytest.mark.parametrize("top_mps", [0.5, 1.0])
def test_a_slower_law_runs_along_the_polyline_at_its_speed(top_mps: float) -> None:
    """Corners that are filtered at 1 m/s are timed at 1 m/s: no faster, and no longer than that asks."""
    path = np.array([[0.0, 0.0, 1.0], [6.0, 0.0, 1.0], [6.0, 6.0, 1.0], [12.0, 6.0, 1.0]])
    result = shaped(WaypointSpline(top_speed_mps=top_mps), request(path), path, LIMITS)
    assert result.trajectory is not None
    assert result.trajectory.duration_s == pytest.approx(18.0 / top_mps + top_mps / A)
    slow = result.trajectory
    _, _, acceleration = evaluate(slow, sample_times(slow, slow.start_s, 1e-3))
    usual = spline(path)
    _, _, stronger = evaluate(usual, sample_times(usual, usual.start_s, 1e-3))
    assert np.linalg.norm(acceleration, axis=1).max() <= np.linalg.norm(stronger, axis=1).max()
