"""The merit against SciPy's spline and quadrature; by what factor a curve is too fast, by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import BSpline

from uavexp.arrays import Float
from uavexp.check.fields import box, empty, field_from
from uavexp.check.hall import LIMITS
from uavexp.planner.shape.excess import limit_excess
from uavexp.planner.shape.scp_step import Merit, merit
from uavexp.planner.spline.uniform import SAMPLES, make_uniform
from uavexp.trajectory import Trajectory

COUNT, H_S, SAFE_M, HARD_M = 11, 0.6, 1.2, 0.3


def control_points() -> Float:
    along = np.linspace(1.0, 4.0, COUNT)
    return np.stack([along, 2.0 + 0.2 * np.sin(along), np.full(COUNT, 1.0)], axis=1)


def judged(weight: float) -> Merit:
    grid = empty((5.0, 4.0, 2.0))
    box(grid, (2.0, 2.6, 0.0), (3.0, 3.0, 2.0))
    field, spline = field_from(grid), make_uniform(3, COUNT)
    return Merit(
        h=H_S, energy=spline.effort, position=spline.samples, distance=field.distance,
        origin_m=field.origin_m, voxel_m=field.voxel_size_m, obstacle_weight=weight, safe_m=SAFE_M,
        hard_m=HARD_M, least_m=0.26, tether_m=np.zeros((len(spline.samples), 3)),
        tether_weight=np.zeros(len(spline.samples)), limits=np.array([1e3, 1e3]), movers=np.zeros((0, 12)),
    )  # fmt: skip


def curve() -> BSpline:
    return BSpline(H_S * np.arange(-3, COUNT + 1.0), control_points(), 3)


def test_without_obstacles_the_merit_is_the_integral_of_the_squared_acceleration() -> None:
    spline = curve()
    energy = sum(
        quad(lambda t: float((spline(t, nu=2) ** 2).sum()), H_S * m, H_S * (m + 1))[0]
        for m in range(COUNT - 3)
    )
    assert merit(control_points(), judged(0.0)) == pytest.approx(energy, rel=1e-6)


def test_the_obstacles_weight_is_what_multiplies_their_cost() -> None:
    by, spline = judged(1.0), curve()
    times_s = H_S * (np.arange((COUNT - 3) * SAMPLES) + 0.5) / SAMPLES
    from uavexp.field import value_at

    felt = np.array([value_at(by.distance, by.origin_m, by.voxel_m, *point) for point in spline(times_s)])
    soft, hard = np.maximum(1.0 - felt / SAFE_M, 0.0), np.maximum((HARD_M - felt) / SAFE_M, 0.0)
    cost = float((soft**2 + 10.0 * hard**2).sum() * H_S / SAMPLES)
    bare = merit(control_points(), judged(0.0))
    assert cost > 0.1
    for weight in (1.0, 7.0):
        assert merit(control_points(), judged(weight)) - bare == pytest.approx(weight * cost, rel=1e-5)


@pytest.mark.parametrize("factor", [0.5, 2.0, 4.0])
def test_what_is_too_strong_is_slowed_by_the_root_of_it(factor: float) -> None:
    """From rest a(t) = j t, so at the end a = j T, v = j T²/2: flown s times slower it is a / s²."""
    duration_s = 0.2
    jerk = factor * LIMITS.max_acceleration_mps2 / duration_s
    assert 0.5 * jerk * duration_s**2 < LIMITS.max_speed_mps * min(1.0, factor)
    curve = np.zeros((1, 4, 3))
    curve[0, 3, 0] = jerk / 6.0
    trajectory = Trajectory(breaks_s=np.array([0.0, duration_s]), coefficients=curve, at_rest=False)
    assert limit_excess(trajectory, LIMITS, 0.1) == pytest.approx(np.sqrt(factor), rel=2e-3)


def test_what_is_too_fast_is_slowed_by_as_much() -> None:
    curve = np.zeros((1, 4, 3))
    duration_s, top = 20.0, 1.5 * LIMITS.max_speed_mps
    curve[0, 3, 1] = 2.0 * top / duration_s**2 / 6.0
    trajectory = Trajectory(breaks_s=np.array([0.0, duration_s]), coefficients=curve, at_rest=False)
    assert limit_excess(trajectory, LIMITS, 0.1) == pytest.approx(1.5, rel=2e-3)
