"""The spline's matrices and bounds against plain evaluation, and the timing's closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from uavexp.arrays import Float
from uavexp.planner.shape.timing import place_by_time, resample, smooth, time_profile
from uavexp.planner.spline.cubic import (
    make_cubic,
    peak_acceleration,
    peak_speed,
    pin_ends,
    sample_spline,
)
from uavexp.planner.spline.uniform import SAMPLES, power_matrix, to_trajectory
from uavexp.trajectory import evaluate, join

H_S = 0.4


def random_control(seed: int, count: int = 12) -> Float:
    return np.random.default_rng(seed).normal(size=(count, 3))


@pytest.mark.parametrize("count", [10, 17])
def test_model_matches_the_curve(count: int) -> None:
    control, model = random_control(0, count), make_cubic(count)
    trajectory = to_trajectory(power_matrix(3), control, H_S, 0.0, False)
    segments = count - 3
    # Gauss-Legendre on each segment is exact for the square of a linear function
    nodes, weights = np.polynomial.legendre.leggauss(3)
    times = (np.arange(segments)[:, None] + 0.5 * (nodes + 1.0)).ravel() * H_S
    square = (evaluate(trajectory, times)[2] ** 2).sum(axis=1).reshape(segments, -1)
    energy = float((square * weights).sum() * 0.5 * H_S)
    assert np.einsum("ia,ij,ja", control, model.effort, control) / H_S**3 == pytest.approx(energy, rel=1e-9)
    samples = (np.arange(SAMPLES * segments) + 0.5) * H_S / SAMPLES
    np.testing.assert_allclose(model.samples @ control, evaluate(trajectory, samples)[0], atol=1e-12)


def test_curve_is_twice_continuously_differentiable() -> None:
    trajectory = to_trajectory(power_matrix(3), random_control(1), H_S, 5.0, False)
    inner = trajectory.breaks_s[1:-1]
    for before, after in zip(
        evaluate(trajectory, inner - 1e-9), evaluate(trajectory, inner + 1e-9), strict=True
    ):
        np.testing.assert_allclose(before, after, atol=1e-6)


def test_pinned_ends_are_the_states() -> None:
    control = random_control(2)
    start, end = random_control(3, 3), random_control(4, 3)
    pin_ends(control, H_S, start, end)
    trajectory = to_trajectory(power_matrix(3), control, H_S, 0.0, False)
    ends = np.array([trajectory.start_s, trajectory.end_s])
    for order, values in enumerate(evaluate(trajectory, ends)):
        np.testing.assert_allclose(values, [start[order], end[order]], atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_peaks_bound_the_curve_tightly(seed: int) -> None:
    control = random_control(seed)
    trajectory = to_trajectory(power_matrix(3), control, H_S, 0.0, False)
    times = np.linspace(trajectory.start_s, trajectory.end_s, 20_001)
    _, velocity, acceleration = evaluate(trajectory, times)
    fastest = np.linalg.norm(velocity, axis=1).max()
    strongest = np.linalg.norm(acceleration, axis=1).max()
    assert fastest <= peak_speed(control, H_S) <= 1.05 * fastest
    assert strongest <= peak_acceleration(control, H_S) * (1.0 + 1e-12)
    assert peak_acceleration(control, H_S) <= strongest * 1.001


def test_sampled_points_are_on_the_curve() -> None:
    control = random_control(6)
    trajectory = to_trajectory(power_matrix(3), control, H_S, 0.0, False)
    times = np.linspace(trajectory.start_s, trajectory.end_s, 5 * 9 + 1)
    np.testing.assert_allclose(sample_spline(control, 5), evaluate(trajectory, times)[0], atol=1e-12)


def test_joined_trajectories_follow_each_other() -> None:
    first, second = (
        to_trajectory(power_matrix(3), random_control(7), H_S, 0.0, True),
        to_trajectory(power_matrix(3), random_control(8), 0.3, 3.6, False),
    )
    both = join(first, second)
    times = np.linspace(0.0, second.end_s, 200)
    expected = np.where(times[:, None] < 3.6, evaluate(first, times)[0], evaluate(second, times)[0])
    np.testing.assert_allclose(evaluate(both, times)[0], expected, atol=1e-12)
    assert both.at_rest == second.at_rest


def test_resampling_keeps_ends_and_spacing() -> None:
    corner = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 2.05, 0.0]])
    points = resample(corner, 0.1)
    assert len(points) == 32
    np.testing.assert_allclose(points[[0, -1]], corner[[0, -1]])
    assert np.linalg.norm(np.diff(points, axis=0), axis=1).max() <= 0.1
    np.testing.assert_allclose(resample(corner[[0, 0]], 0.1), 0.0)  # a path of no length


def test_smoothing_keeps_ends_and_straight_lines() -> None:
    line = np.linspace([0.0, 0.0, 0.0], [3.0, 1.0, 0.5], 31)
    np.testing.assert_allclose(smooth(line, 20), line, atol=1e-12)
    stairs = line + 0.05 * (np.arange(31) % 2)[:, None]
    assert np.linalg.norm(np.diff(smooth(stairs, 20), axis=0), axis=1).sum() < 1.01 * np.sqrt(10.25)


def test_straight_line_takes_the_trapezoidal_time() -> None:
    line = np.linspace([0.0, 0.0, 0.0], [10.0, 0.0, 0.0], 101)
    # L / v + v / a from rest to rest, L / v + v / (2 a) from rest only
    assert time_profile(line, 0.0, 0.0, 2.5, 2.5)[-1] == pytest.approx(10.0 / 2.5 + 2.5 / 2.5, rel=1e-3)
    assert time_profile(line, 0.0, 2.5, 2.5, 2.5)[-1] == pytest.approx(10.0 / 2.5 + 0.5, rel=1e-3)
    # too short to reach the speed: 2 sqrt(L / a)
    assert time_profile(line[:11], 0.0, 0.0, 2.5, 2.5)[-1] == pytest.approx(
        2.0 * np.sqrt(1.0 / 2.5), rel=1e-3
    )


def test_circle_is_flown_at_the_centripetal_speed() -> None:
    angle = np.linspace(0.0, 1.5 * np.pi, 95)
    circle = np.stack([np.cos(angle), np.sin(angle), np.zeros(95)], axis=1)
    fastest = np.sqrt(2.5 * 1.0)
    times = time_profile(circle, 9.0, 9.0, 9.0, 2.5)
    assert times[-1] == pytest.approx(1.5 * np.pi / fastest, rel=0.02)


def test_control_points_are_placed_by_time() -> None:
    line = np.linspace([0.0, 0.0, 0.0], [10.0, 0.0, 0.0], 101)
    times = np.linspace(0.0, 5.0, 101)
    placed = place_by_time(line, times, 13, 1.0, 2.0)
    np.testing.assert_allclose(placed[1:-1, 0], np.arange(11.0))
