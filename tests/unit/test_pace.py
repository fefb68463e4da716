"""A paced trajectory is the same curve in another time: against numeric derivatives."""

from __future__ import annotations

import numpy as np
import pytest

from uavexp.pace import AS_PLANNED, Pace, delayed, evaluate_paced, pace_over
from uavexp.trajectory import Trajectory, derivative, evaluate


def curve(seed: int) -> Trajectory:
    """One quintic, so that every derivative is smooth."""
    rng = np.random.default_rng(seed)
    scale = np.array([1.0, 1.0, 2.0, 6.0, 24.0, 99.0])[:, None]
    return Trajectory(
        breaks_s=np.array([1.0, 4.0]), coefficients=rng.normal(size=(1, 6, 3)) / scale, at_rest=False
    )


def arrays(pace: Pace) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return pace.times_s, pace.own_s, pace.rate


def smooth(own_s: np.ndarray) -> np.ndarray:
    return 0.6 + 0.35 * np.cos(2.0 * own_s)


@pytest.mark.parametrize("seed", range(3))
def test_velocity_acceleration_and_jerk_are_the_derivatives_of_the_position(seed: int) -> None:
    trajectory, own_s = curve(seed), np.linspace(1.0, 4.0, 151)
    pace = pace_over(1.0, own_s, smooth(own_s))
    h = 1e-3
    times_s = np.arange(1.3, 3.5, h)
    _, position, velocity, acceleration, jerk = evaluate_paced(
        trajectory.breaks_s, trajectory.coefficients, arrays(pace), times_s
    )
    for value, change, within in (
        (position, velocity, 1e-4),
        (velocity, acceleration, 0.1),
        (acceleration, jerk, 0.5),
    ):
        scale = np.abs(change).max()
        assert np.abs(np.gradient(value, h, axis=0) - change)[2:-2].max() <= within * scale


def test_its_way_is_the_trajectorys_and_its_own_time_the_integral_of_the_rate() -> None:
    trajectory, own_s = curve(5), np.linspace(1.0, 4.0, 151)
    pace = pace_over(1.0, own_s, smooth(own_s))
    middle_s = np.linspace(1.0, 4.0, 100_001)
    taken_s = 1.0 + float((1.0 / smooth(middle_s)).mean()) * 3.0
    assert pace.times_s[-1] == pytest.approx(taken_s, abs=1e-3)
    seen_s, position, *_ = evaluate_paced(
        trajectory.breaks_s, trajectory.coefficients, arrays(pace), np.linspace(1.0, pace.times_s[-1], 50)
    )
    np.testing.assert_allclose(position, evaluate(trajectory, seen_s)[0], atol=1e-12)
    assert (np.diff(seen_s) > 0.0).all()


def test_as_planned_is_the_trajectory_to_the_bit() -> None:
    trajectory, times_s = curve(7), np.linspace(1.0, 5.0, 200)
    own_s, *values, jerk = evaluate_paced(
        trajectory.breaks_s, trajectory.coefficients, arrays(AS_PLANNED), times_s
    )
    assert own_s.tobytes() == times_s.tobytes()
    for one, other in zip(values, evaluate(trajectory, times_s), strict=True):
        assert one.tobytes() == other.tobytes()
    assert jerk.tobytes() == derivative(trajectory, times_s, 3).tobytes()


def test_a_pace_that_rests_stays_where_it_rests_and_is_the_curve_delayed_from_then_on() -> None:
    trajectory = curve(9)
    pace = pace_over(1.0, np.array([1.0, 1.5, 2.0, 2.5]), np.array([1.0, 0.5, 0.0, 0.0]), early_s=0.1)
    assert pace.rests_s == pytest.approx(1.0 + 0.5 / 0.75 + 0.4 / 0.25)
    own_s, rate, _ = pace.at(9.0)
    assert (own_s, rate) == pytest.approx((1.9, 0.0))
    late = delayed(trajectory, 9.0 - own_s)
    here = evaluate(late, np.array([9.0]))[0]
    _, there, velocity, *_ = evaluate_paced(
        trajectory.breaks_s, trajectory.coefficients, arrays(pace), np.array([9.0])
    )
    np.testing.assert_allclose(here, there, atol=1e-12)
    assert not velocity.any()
    assert late.coefficients is trajectory.coefficients


def test_who_stands_already_has_a_pace_of_one_knot() -> None:
    pace = pace_over(3.0, np.array([3.0, 3.02]), np.array([0.0, 0.0]), early_s=0.02)
    assert (len(pace.rate), pace.rests_s, pace.own_s[0]) == (1, 3.0, 3.0)


def test_a_rate_that_is_only_rounding_before_the_rest_is_the_rest() -> None:
    """Two knots at one time used to stop the flight with a division by zero."""
    own_s, rate = np.array([1.0, 1.02, 1.04, 1.06]), np.array([0.8, 0.6, 1e-8, 0.0])
    pace = pace_over(1.0, own_s, rate, early_s=0.02)
    assert (np.diff(pace.times_s) > 0.0).all()
    assert pace.rests_s == pace.times_s[-1]
    assert pace.own_s[-1] == pytest.approx(1.04)
    assert np.isfinite(pace.at(float(pace.times_s[-1]) + 1.0)).all()
