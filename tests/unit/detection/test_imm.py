"""Interacting multiple models: filterpy's estimator as oracle, closed forms, walls, worth."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter, IMMEstimator

from uavexp.arrays import Float
from uavexp.check.fields import box, empty, field_from
from uavexp.detection import imm
from uavexp.detection.interacting import InteractingFilter
from uavexp.detection.kalman import MotionModel, estimated
from uavexp.types import SWERVE_STEP_S

NOWHERE = imm.walls(None, np.zeros(3))
HALF_M = np.array([0.25, 0.25, 0.85])
MOTION = MotionModel(height_noise_m=0.08)
STEP_S = 0.1


def begun() -> tuple[Float, Float, Float]:
    states = np.tile([1.0, 2.0, 1.0, 0.9, 0.3, 0.0, 0.0, 0.0], (imm.MODELS, 1))
    covariance = np.diag(np.concatenate([np.full(3, 0.08**2), [1.0, 1.0, 0.09], imm.HABITS.prior]))
    return states, np.tile(covariance, (imm.MODELS, 1, 1)), np.array([0.5, 0.2, 0.2, 0.1])


class Oracle(ExtendedKalmanFilter):
    """One of the models in filterpy's terms."""

    def __init__(self, model: int, state: Float, covariance: Float) -> None:
        super().__init__(dim_x=8, dim_z=3)
        self.model, self.x, self.P = model, state.copy(), covariance.copy()
        self.R, self.H = 0.08**2 * np.eye(3), np.eye(3, 8)
        self.Q = imm.noise_of(model, STEP_S, imm.HABITS.density[model])

    def predict(self, u: Any = 0) -> None:
        self.confine()
        self.x, self.F = imm.moved(self.model, self.x, STEP_S)
        self.P = self.F @ self.P @ self.F.T + self.Q

    def update(self, z: Float) -> None:
        super().update(z, HJacobian=lambda x: self.H, Hx=lambda x: x[:3])
        self.confine()

    def confine(self) -> None:
        """What the model does not use is its prior (filterpy mixes it like everything else)."""
        imm._confine(self.model, self.x, self.P, imm.HABITS.prior)


def test_the_filter_is_that_of_filterpy() -> None:
    states, covariances, shares = begun()
    stays = math.exp(-imm.HABITS.leaves_hz * STEP_S)
    change = np.full((4, 4), (1.0 - stays) / 3.0) + (stays - (1.0 - stays) / 3.0) * np.eye(4)
    oracle = IMMEstimator([Oracle(m, states[m], covariances[m]) for m in range(4)], shares, change)
    rng = np.random.default_rng(0)
    for k in range(1, 25):
        angle = 0.15 * k
        seen = np.array([1.0 + math.sin(angle), 3.0 - math.cos(angle), 1.0]) + rng.normal(0.0, 0.08, 3)
        states, covariances, shares = imm.predict(states, covariances, shares, STEP_S, imm.HABITS, NOWHERE)
        states, covariances, shares = imm.observe(
            states, covariances, shares, seen, np.full(3, 0.08**2), imm.HABITS
        )
        oracle.predict()
        oracle.update(seen)
        for m in range(4):
            np.testing.assert_allclose(states[m], oracle.filters[m].x, rtol=1e-6, atol=1e-8)
            np.testing.assert_allclose(covariances[m], oracle.filters[m].P, rtol=1e-6, atol=1e-8)
        np.testing.assert_allclose(shares, oracle.mu, rtol=1e-5, atol=2e-4)  # ours gives none up
    assert shares[imm.TURNING] == shares.max()


@pytest.mark.parametrize("model", range(4))
@pytest.mark.parametrize("turn", [0.0, 0.8, -1.5])
def test_jacobian_is_the_derivative(model: int, turn: float) -> None:
    state = np.array([0.3, -0.2, 1.0, 0.7, -0.4, 0.1, turn, 0.6])
    _, jacobian = imm.moved(model, state, 0.25)
    for column in range(8):
        if (column == imm.TURN and turn == 0.0) or (model != imm.ACCELERATING and column == imm.ALONG):
            continue
        step = np.zeros(8)
        step[column] = 1e-6
        ahead, behind = (imm.moved(model, state + sign * step, 0.25)[0] for sign in (1.0, -1.0))
        np.testing.assert_allclose(jacobian[:, column], (ahead - behind) / 2e-6, atol=1e-6)


def test_a_turn_is_a_circle_and_an_acceleration_fades() -> None:
    circle = imm.moved(imm.TURNING, np.array([2.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.5, 0.0]), 1.2)[0]
    np.testing.assert_allclose(circle[:2], [2.0 * math.cos(0.6), 2.0 * math.sin(0.6)], atol=1e-12)
    faster = imm.moved(imm.ACCELERATING, np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.5]), 50.0)[0]
    np.testing.assert_allclose(faster[[3, 7]], [1.5, 0.0], atol=1e-9)  # 1 + 0.5 τ


def followed(path: Float, seed: int) -> tuple[InteractingFilter, Float]:
    """The filter after noisy sights of a path (K, 3), and the last place but one seen so."""
    rng = np.random.default_rng(seed)
    seen = path + rng.normal(0.0, 0.08, path.shape)
    filter_ = InteractingFilter(seen[0], MOTION)
    for place in seen[1:]:
        filter_.predict(STEP_S, HALF_M, None)
        filter_.observe(place)
    return filter_, seen


def errors_m(path: Callable[[Float], Float], known: int) -> tuple[float, float]:
    """Mean error 1 s ahead of the models and of the one Kalman filter."""
    times_s = STEP_S * np.arange(known)
    truth = path(np.array([times_s[-1] + 1.0]))[0]
    ours, single = [], []
    for seed in range(20):
        filter_, seen = followed(path(times_s), seed)
        place = filter_.position_m + filter_.velocity_mps + filter_.swerve_m(HALF_M, None)[4]
        position, velocity = estimated(times_s, seen, MOTION)
        ours.append(np.linalg.norm(place - truth))
        single.append(np.linalg.norm(position[-1] + velocity[-1] - truth))
    return float(np.mean(ours)), float(np.mean(single))


def test_circles_are_predicted_where_one_filter_goes_off_on_the_tangent() -> None:
    ours_m, single_m = errors_m(
        lambda t: np.stack([1.2 * np.cos(t), 1.2 * np.sin(t), 1.0 + 0.0 * t], axis=1), 40
    )
    assert ours_m < 0.3 * single_m


def test_straight_walks_are_predicted_no_worse() -> None:
    ours_m, single_m = errors_m(lambda t: np.stack([1.1 * t, -0.4 * t, 1.0 + 0.0 * t], axis=1), 30)
    assert ours_m < single_m


def test_a_mover_rebounds_at_a_mapped_wall() -> None:
    """At 1 m/s from 1.5 m before the wall's face, and 0.25 m wide: met after 1.23 s, back at 0.9 m/s."""
    grid = empty((6.0, 4.0, 3.0))
    box(grid, (4.0, 0.0, 0.0), (4.3, 4.0, 3.0))
    field = field_from(grid, max_distance_m=2.0)
    filter_ = InteractingFilter(np.array([0.5, 2.0, 1.5]), MOTION)
    for k in range(1, 21):
        filter_.predict(STEP_S, HALF_M, field)
        filter_.observe(np.array([0.5 + 0.1 * k, 2.0, 1.5]))
    ahead_s = SWERVE_STEP_S * np.arange(1, 11)
    places = filter_.position_m + ahead_s[:, None] * filter_.velocity_mps + filter_.swerve_m(HALF_M, field)
    meets_m = 4.0 - 0.25 - 0.02
    straight = 2.5 + ahead_s
    expected = np.where(straight <= meets_m, straight, meets_m - 0.9 * (straight - meets_m))
    np.testing.assert_allclose(places[:, 0], expected, atol=0.12)
    np.testing.assert_allclose(places[:, 1], 2.0, atol=0.02)
    blind = filter_.swerve_m(HALF_M, None)
    assert np.abs(blind).max() < 0.1


def test_a_place_that_is_not_finite_is_no_observation_and_staying_moves_all_models() -> None:
    filter_, _ = followed(np.tile([1.0, 2.0, 1.0], (5, 1)) + 0.1 * np.arange(5)[:, None], 1)
    before = filter_.position_m.copy()
    filter_.observe(np.array([np.nan, 0.0, 0.0]))
    np.testing.assert_array_equal(filter_.position_m, before)
    filter_.stay(np.array([3.0, 3.0, 1.0]))
    np.testing.assert_allclose(filter_.position_m, [3.0, 3.0, 1.0])
    assert filter_.is_sound(6.0, 2.0)
    assert not filter_.is_sound(0.01, 2.0)
