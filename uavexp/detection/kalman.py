"""One Kalman filter per mover (paper 2, §4.1): position and velocity, position observed.

Constant velocity driven by white acceleration of spectral density q (Bar-Shalom, Li and
Kirubarajan 2001, §6.2.2): for a step of τ s, Q = q [[τ³/3, τ²/2], [τ²/2, τ]] on each axis. The
paper raises the process noise "during high-curvature manoeuvres": here q is multiplied by
the fading average of the normalised innovation squared over its expectation 3 (ibid.,
§11.2), within [1, `adaptivity`]. So q is the base value while the model holds, and grows with
the misfit while it does not.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from functools import lru_cache
from typing import Annotated, Any, NamedTuple

import numpy as np

from uavexp.arrays import Float
from uavexp.field import DistanceField
from uavexp.parameters import FINITE, Positive, at_least


class Estimate(StrEnum):
    """Where a mover's velocity comes from."""

    KALMAN = "kalman"
    RAW = "raw"  # the last two observed positions: the baseline
    IMM = "imm"  # interacting multiple models (`interacting`), which predict a path as well


_H = np.eye(3, 6)
_UPRIGHT = 0.1  # q upwards over q level: little that moves in a building climbs or sinks all of a sudden
_EXPECTED = 3.0  # of the normalised innovation squared of a position


class MotionModel(NamedTuple):
    """What the filter assumes, SI."""

    position_noise_m: float = 0.08  # of an observed centre, standard deviation per level axis
    height_noise_m: float = 0.25  # the same upwards, where the part in sight varies most
    speed_mps: float = 1.0  # standard deviation per level axis of a velocity nothing is known of
    climb_mps: float = 0.3  # the same upwards
    acceleration_density: float = 0.1  # q of the level axes, m²/s³
    adaptivity: float = 20.0  # q is raised at most so many times; 1: never
    fading: float = 0.3  # share of the average innovation that is kept at an observation


@dataclass(slots=True, kw_only=True)
class FilterParameters:
    """Parameters that every detection with filters has."""

    position_noise_m: Positive = 0.08  # m, standard deviation of an observed centre, per axis [ours]
    acceleration_density: Positive = 0.1  # m²/s³, q of the process noise on the level axes,
    # while the model holds [ours]
    adaptivity: Annotated[float, at_least(1), FINITE] = 20.0  # 1, q is raised at most so many times while
    # innovations are large (paper: during manoeuvres); 1: never
    estimate: Estimate = (
        Estimate.KALMAN
    )  # kalman (paper) | raw: velocities from the last two observed places,
    # the baseline | imm: interacting multiple models of steady, turning, accelerating and manoeuvring movers
    # that rebound at mapped walls [ours]


@lru_cache(maxsize=64)
def _step(period_s: float) -> tuple[Float, Float]:
    """Transition (6, 6), and process noise (6, 6) for q = 1."""
    transition, noise = np.eye(6), np.zeros((6, 6))
    transition[:3, 3:] = period_s * np.eye(3)
    noise[:3, :3] = period_s**3 / 3.0 * np.eye(3)
    noise[:3, 3:] = noise[3:, :3] = period_s**2 / 2.0 * np.eye(3)
    noise[3:, 3:] = period_s * np.eye(3)
    noise[[2, 5]] *= _UPRIGHT
    return transition, noise


def _new_filter(position_m: Float, motion: MotionModel) -> Any:
    """A filterpy filter that has seen one position."""
    from filterpy.kalman import KalmanFilter  # a second of import that flights without movers are spared

    kalman = KalmanFilter(dim_x=6, dim_z=3)  # F, H and Q by hand: filterpy's helpers err off the line
    kalman.x = np.concatenate([position_m, np.zeros(3)])
    noise = np.array([motion.position_noise_m, motion.position_noise_m, motion.height_noise_m])
    speed = np.array([motion.speed_mps, motion.speed_mps, motion.climb_mps])
    kalman.P = np.diag(np.concatenate([noise**2, speed**2]))
    kalman.H, kalman.R = _H, np.diag(noise**2)
    return kalman


@dataclass(slots=True)
class MotionFilter:
    """The filter of one mover; begins at an observed position, at rest."""

    first_m: Float  # (3,)
    motion: MotionModel
    misfit: float = 1.0  # fading average of the normalised innovation squared over its expectation
    _kalman: Any = field(init=False, repr=False)
    _seen_m: Float = field(init=False, repr=False)  # (3,) last observed
    _raw_mps: Float = field(init=False, repr=False)  # (3,) from the last two observed
    _unseen_s: float = field(init=False, repr=False, default=0.0)

    def __post_init__(self) -> None:
        self._kalman = _new_filter(self.first_m, self.motion)
        self._seen_m, self._raw_mps = np.array(self.first_m), np.zeros(3)

    @property
    def position_m(self) -> Float:
        """Believed centre (3,)."""
        return np.asarray(self._kalman.x[:3])

    @property
    def velocity_mps(self) -> Float:
        """Believed velocity (3,)."""
        return np.asarray(self._kalman.x[3:])

    @property
    def covariance(self) -> Float:
        """Of position and velocity (6, 6)."""
        return np.asarray(self._kalman.P)

    @property
    def innovation_covariance(self) -> Float:
        """Of the next observation's difference from the prediction (3, 3)."""
        return np.asarray(self._kalman.P[:3, :3] + self._kalman.R)

    @property
    def seen_m(self) -> Float:
        """Where it was last observed (3,)."""
        return self._seen_m

    def estimate(self, of: Estimate) -> tuple[Float, Float]:
        """Position (3,) and velocity (3,) now, from the filter or from the last two observed positions."""
        if of is Estimate.KALMAN:
            return self.position_m, self.velocity_mps
        return self._seen_m + self._unseen_s * self._raw_mps, self._raw_mps

    def swerve_m(self, half_size_m: Float, field: DistanceField | None) -> Float:
        """None (0, 3): it goes on at constant velocity."""
        return np.zeros((0, 3))

    def predict(self, period_s: float, half_size_m: Float, field: DistanceField | None) -> None:
        """Move on by a period > 0 s, whatever its size and the map."""
        self._unseen_s += period_s
        density = self.motion.acceleration_density * min(max(self.misfit, 1.0), self.motion.adaptivity)
        transition, noise = _step(round(period_s, 6))
        self._kalman.predict(F=transition, Q=density * noise)

    def stay(self, position_m: Float) -> None:
        """Be at a position (3,) after all, after `predict`; the raw estimate goes on."""
        self._kalman.x[:3] = position_m

    def observe(self, position_m: Float) -> None:
        """Take in an observed centre (3,); not finite is no observation (filterpy would believe it)."""
        if not np.isfinite(position_m).all():
            return
        self._kalman.update(position_m)
        if self._unseen_s > 0.0:
            self._raw_mps = (position_m - self._seen_m) / self._unseen_s
        self._seen_m, self._unseen_s = np.array(position_m), 0.0
        innovation, inverse = self._kalman.y, self._kalman.SI
        share = 1.0 - self.motion.fading
        self.misfit += share * (float(innovation @ inverse @ innovation) / _EXPECTED - self.misfit)

    def is_sound(self, max_speed_mps: float, max_deviation_m: float) -> bool:
        """Whether state and covariance are finite, and speed and position within these limits."""
        return is_sound(self._kalman.x, self._kalman.P, max_speed_mps, max_deviation_m)


def is_sound(state: Float, covariance: Float, max_speed_mps: float, max_deviation_m: float) -> bool:
    """Whether a state (6,) and its covariance are finite, and speed and position within these limits."""
    if not (np.isfinite(state).all() and np.isfinite(covariance).all()):
        return False
    variance = np.diagonal(covariance)
    return bool(
        np.linalg.norm(state[3:]) <= max_speed_mps
        and variance.min() >= 0.0
        and variance[:3].max() <= max_deviation_m**2
    )


def estimated(
    times_s: Float,
    positions_m: Float,
    motion: MotionModel | None = None,
    of: Estimate = Estimate.KALMAN,
) -> tuple[Float, Float]:
    """Position and velocity, each (K, 3), that are believed at each observation.

    Args:
        times_s: (K,) increasing, s.
        positions_m: (K, 3) observed; rows of NaN are missed.
        motion: what is assumed.
        of: the filter's, or from the last two observed positions.
    """
    filter_: MotionFilter | None = None
    believed = np.full((2, len(times_s), 3), np.nan)
    for k, position_m in enumerate(positions_m):
        if filter_ is not None:
            filter_.predict(float(times_s[k] - times_s[k - 1]), np.zeros(3), None)
            filter_.observe(position_m)
        elif np.isfinite(position_m).all():
            filter_ = MotionFilter(position_m, motion or MotionModel())
        if filter_ is not None:
            believed[:, k] = filter_.estimate(of)
    return believed[0], believed[1]
