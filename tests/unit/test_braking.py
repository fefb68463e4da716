"""Braking: continuous, within limits, and as short as they allow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavexp.arrays import Float
from uavexp.braking import braking_trajectory, stopping_distance_m
from uavexp.trajectory import Trajectory, evaluate
from uavexp.types import Limits

LIMITS = Limits(
    max_speed_mps=2.5, max_acceleration_mps2=2.5, max_body_rate_radps=2.0, body_size_m=(0.32, 0.32, 0.12)
)


def brake(velocity: Float, acceleration: Float) -> Trajectory:
    return braking_trajectory(3.0, np.array([1.0, -2.0, 1.5]), velocity, acceleration, LIMITS)


def sampled(trajectory: Trajectory) -> tuple[Float, Float, Float]:
    times = np.append(np.arange(trajectory.start_s, trajectory.end_s, 1e-3), trajectory.end_s)
    return evaluate(trajectory, times)


@pytest.mark.parametrize("speed", [0.01, 0.1, 0.5, 1.2, 2.5])
def test_stops_in_the_stated_distance(speed: float) -> None:
    direction = np.array([0.6, 0.0, 0.8])
    trajectory = brake(speed * direction, np.zeros(3))
    position, velocity, _ = sampled(trajectory)
    way = position - position[0]
    assert np.linalg.norm(way[-1]) == pytest.approx(stopping_distance_m(speed, LIMITS), rel=1e-9)
    np.testing.assert_allclose(way - np.outer(way @ direction, direction), 0.0, atol=1e-12)
    assert (np.diff(velocity @ direction) <= 1e-12).all()  # never speeds up
    assert np.linalg.norm(way[-1]) >= speed**2 / (2.0 * LIMITS.max_acceleration_mps2)


def test_is_close_to_the_shortest_stop_at_full_speed() -> None:
    ideal = 2.5**2 / (2.0 * 2.5)
    assert stopping_distance_m(2.5, LIMITS) < 1.15 * ideal


@pytest.mark.parametrize("speed", [5e-8, 5e-9, 0.0])
def test_who_could_stop_at_once_holds_its_place(speed: float) -> None:
    agile = replace(LIMITS, max_body_rate_radps=1e4)
    held = braking_trajectory(
        3.0, np.array([1.0, -2.0, 1.5]), np.array([speed, 0.0, 0.0]), np.zeros(3), agile
    )
    position, velocity, _ = sampled(held)
    np.testing.assert_allclose(position - position[0], 0.0, atol=1e-8)
    np.testing.assert_allclose(velocity, 0.0, atol=1e-7)


vectors = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))


@given(vectors, vectors, st.floats(0.0, 2.5), st.floats(0.0, 2.5))
def test_contract_from_any_state(
    along: tuple[float, float, float], push: tuple[float, float, float], speed: float, strength: float
) -> None:
    velocity = speed * np.array(along) / max(float(np.linalg.norm(along)), 1.0)
    acceleration = strength * np.array(push) / max(float(np.linalg.norm(push)), 1.0)
    trajectory = brake(velocity, acceleration)
    position, speeds, accelerations = sampled(trajectory)
    np.testing.assert_allclose(position[0], [1.0, -2.0, 1.5], atol=1e-12)
    np.testing.assert_allclose(speeds[0], velocity, atol=1e-6)
    np.testing.assert_allclose(accelerations[0], acceleration, atol=1e-5)
    np.testing.assert_allclose(speeds[-1], 0.0, atol=1e-8)
    np.testing.assert_allclose(accelerations[-1], 0.0, atol=1e-5)
    assert np.linalg.norm(accelerations, axis=1).max() <= LIMITS.max_acceleration_mps2 + 1e-6
    jerk = 9.81 * LIMITS.max_body_rate_radps
    allowed = np.linalg.norm(velocity) + np.linalg.norm(acceleration) ** 2 / (2.0 * jerk)
    assert np.linalg.norm(speeds, axis=1).max() <= allowed + 1e-6
    assert np.abs(np.diff(speeds, axis=0)).max() <= 2.6e-3  # no jumps at a 1 ms grid
    assert np.abs(np.diff(accelerations, axis=0)).max() <= 1.05e-3 * jerk
    assert trajectory.at_rest
    assert trajectory.duration_s < 1.6


def test_a_standing_vehicle_holds() -> None:
    trajectory = brake(np.zeros(3), np.zeros(3))
    position, speeds, accelerations = sampled(trajectory)
    assert np.ptp(position, axis=0).max() == 0.0
    assert not speeds.any()
    assert not accelerations.any()
