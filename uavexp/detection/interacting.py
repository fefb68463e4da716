"""One filter of interacting multiple models per mover (`imm`), and the path that it predicts."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from uavexp.arrays import Float
from uavexp.detection import imm
from uavexp.detection.kalman import Estimate, MotionModel, is_sound
from uavexp.field import DistanceField
from uavexp.types import SWERVE_STEP_S

_STEPS = 10  # of a predicted path: 2 s, as far as planners look
_SHARES = np.array([0.5, 0.2, 0.2, 0.1])  # of the models, before anything is known
_FILTER_S = 0.1  # longest time step of the filter: at walls it makes a difference


@dataclass(slots=True)
class InteractingFilter:
    """The filter of one mover; begins at an observed position, at rest. See `kalman.MotionFilter`."""

    first_m: Float  # (3,)
    motion: MotionModel
    seen_m: Float = field(init=False)  # (3,) where it was last observed
    _models: tuple[Float, Float, Float] = field(init=False, repr=False)  # states, covariances, shares
    _mean: Float = field(init=False, repr=False)  # (6,) of position and velocity
    _spread: Float = field(init=False, repr=False)  # (6, 6)

    def __post_init__(self) -> None:
        speed = np.array([self.motion.speed_mps, self.motion.speed_mps, self.motion.climb_mps])
        covariance = np.diag(np.concatenate([self._variance, speed**2, imm.HABITS.prior]))
        states = np.tile(np.append(self.first_m, np.zeros(5)), (imm.MODELS, 1))
        self._take((states, np.tile(covariance, (imm.MODELS, 1, 1)), _SHARES))
        self.seen_m = np.array(self.first_m)

    @property
    def position_m(self) -> Float:
        """Believed centre (3,)."""
        return self._mean[:3]

    @property
    def velocity_mps(self) -> Float:
        """Believed velocity (3,)."""
        return self._mean[3:]

    @property
    def covariance(self) -> Float:
        """Of position and velocity (6, 6)."""
        return self._spread

    @property
    def innovation_covariance(self) -> Float:
        """Of the next observation's difference from the prediction (3, 3)."""
        return self._spread[:3, :3] + np.diag(self._variance)

    @property
    def shares(self) -> Float:
        """Probability of each model (4,)."""
        return self._models[2]

    def estimate(self, of: Estimate) -> tuple[Float, Float]:
        """Position (3,) and velocity (3,) now."""
        return self.position_m, self.velocity_mps

    def swerve_m(self, half_size_m: Float, field: DistanceField | None) -> Float:
        """`Tracks.swerve_m` (K, 3) of a mover of this half size among these walls."""
        walls, (states, _, shares) = imm.walls(field, half_size_m), self._models
        places_m = imm.ahead(states, shares, 0.5 * SWERVE_STEP_S, 2 * _STEPS, walls)[1::2]
        ahead_s = SWERVE_STEP_S * np.arange(1.0, _STEPS + 1.0)[:, None]
        return np.asarray(places_m - self.position_m - ahead_s * self.velocity_mps)

    def predict(self, period_s: float, half_size_m: Float, field: DistanceField | None) -> None:
        """Move on by a period > 0 s, as a mover of this half size among these walls."""
        walls, steps = imm.walls(field, half_size_m), int(np.ceil(period_s / _FILTER_S - 1e-6))
        for _ in range(steps):
            self._take(imm.predict(*self._models, period_s / steps, imm.HABITS, walls))

    def stay(self, position_m: Float) -> None:
        """Be at a position (3,) after all, after `predict`."""
        self._models[0][:, :3] += position_m - self.position_m
        self._take(self._models)

    def observe(self, position_m: Float) -> None:
        """Take in an observed centre (3,); not finite is no observation."""
        if not np.isfinite(position_m).all():
            return
        self._take(imm.observe(*self._models, position_m, self._variance, imm.HABITS))
        self.seen_m = np.array(position_m)

    def is_sound(self, max_speed_mps: float, max_deviation_m: float) -> bool:
        """Whether state and covariance are finite, and speed and position within these limits."""
        return is_sound(self._mean, self._spread, max_speed_mps, max_deviation_m)

    @property
    def _variance(self) -> Float:
        """Of an observed position (3,)."""
        level, upright = self.motion.position_noise_m, self.motion.height_noise_m
        return np.array([level, level, upright]) ** 2

    def _take(self, models: tuple[Float, Float, Float]) -> None:
        self._models = models
        self._mean, self._spread = imm.merged(*models)
