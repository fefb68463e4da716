"""Drift against the closed form of its random walk; perfect against the truth."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from uavexp.errors import ConfigError
from uavexp.estimator.drift import Drift
from uavexp.estimator.perfect import Perfect
from uavexp.geometry import quaternion_from_yaw, rotation_from_quaternion, wrap_angle, yaw_of
from uavexp.types import State

ORIGIN = State(
    position_m=np.zeros(3),
    velocity_mps=np.zeros(3),
    quaternion_wxyz=quaternion_from_yaw(0.4),
    body_rate_radps=np.zeros(3),
)


def errors(estimator: Drift, seed: int, count: int, step_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Position (T, 3) and yaw (T,) errors of an estimator that is told to stand still."""
    believe = estimator.begin(np.random.default_rng(seed))
    states = [believe(ORIGIN, step_s) for _ in range(count)]
    yaw = np.array([wrap_angle(yaw_of(s.quaternion_wxyz) - 0.4) for s in states])
    return np.array([s.position_m for s in states]), yaw


def test_perfect_is_the_truth():
    assert Perfect().begin(np.random.default_rng(0))(ORIGIN, 0.01) is ORIGIN


def test_drift_rates_keep_their_bounds():
    estimator = Drift(position_drift_mps=0.05, max_position_drift_mps=0.05, max_yaw_drift_radps=0.002)
    position, yaw = errors(estimator, 0, 3000, 0.01)
    speed = np.linalg.norm(np.diff(position, axis=0, prepend=0.0), axis=1) / 0.01
    assert speed.max() <= 0.05 + 1e-9
    assert (speed > 0.0499).mean() > 0.05  # the bound is at work
    assert np.abs(np.diff(yaw, prepend=0.0)).max() / 0.01 <= 0.002 + 1e-9


@pytest.mark.parametrize("step_s", [0.02, 0.2])
def test_spread_is_that_of_the_gauss_markov_walk_whatever_the_step(step_s):
    tau, rms, end_s = 1.0, 0.03, 6.0
    estimator = Drift(
        position_drift_mps=rms,
        max_position_drift_mps=1.0,
        yaw_drift_radps=rms,
        max_yaw_drift_radps=1.0,
        correlation_time_s=tau,
    )
    runs = [
        errors(estimator, seed, round(end_s / step_s), step_s) for seed in range(400 if step_s > 0.1 else 100)
    ]
    spread = 2.0 * tau * (end_s - tau * (1.0 - math.exp(-end_s / tau)))
    position2 = np.mean([position[-1] ** 2 for position, _ in runs])
    yaw2 = np.mean([yaw[-1] ** 2 for _, yaw in runs])
    assert position2 == pytest.approx(rms**2 / 3.0 * spread, rel=0.25)
    assert yaw2 == pytest.approx(rms**2 * spread, rel=0.4)


def test_believed_body_rate_is_the_turning_of_the_believed_attitude():
    believe = Drift(yaw_drift_radps=0.1, max_yaw_drift_radps=0.5).begin(np.random.default_rng(3))
    tilted = State(
        position_m=np.zeros(3),
        velocity_mps=np.zeros(3),
        quaternion_wxyz=np.array([math.cos(0.3), 0.0, math.sin(0.3), 0.0]),
        body_rate_radps=np.zeros(3),
    )
    before, after = (believe(tilted, 1e-3) for _ in range(2))
    a, b = (rotation_from_quaternion(s.quaternion_wxyz) for s in (before, after))
    turn = a.T @ b
    rate = 0.5 / 1e-3 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    np.testing.assert_allclose(rate, before.body_rate_radps, atol=1e-6)
    assert np.linalg.norm(rate) > 1e-3


def test_no_drift_is_the_truth():
    still = Drift(position_drift_mps=0.0, yaw_drift_radps=0.0)
    position, yaw = errors(still, 0, 100, 0.01)
    assert np.abs(position).max() == 0.0
    assert np.abs(yaw).max() < 1e-15


def test_refuses_a_bound_below_the_rms():
    with pytest.raises(
        ConfigError, match=r"max_position_drift_mps must be >= the rms drift of 0.1, got 0.05"
    ):
        Drift(position_drift_mps=0.1)


@pytest.mark.parametrize("estimator", [Perfect(), Drift()], ids=["perfect", "drift"])
def test_believed_velocity_is_the_rate_of_believed_position(estimator):
    step_s, velocity, believed = 0.01, np.array([0.5, 0.0, -0.5]), []
    believe = estimator.begin(np.random.default_rng(1))
    for k in range(100):
        truth = replace(ORIGIN, position_m=k * step_s * velocity, velocity_mps=velocity)
        believed.append(believe(truth, step_s))
    for before, after in pairwise(believed):
        rate = (after.position_m - before.position_m) / step_s
        np.testing.assert_allclose(rate, before.velocity_mps, atol=1e-9)
