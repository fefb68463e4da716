"""What a tracker asks of the filter of one mover, and the filters there are."""

from __future__ import annotations

from typing import Protocol

from uavexp.arrays import Float
from uavexp.detection.interacting import InteractingFilter
from uavexp.detection.kalman import Estimate, MotionFilter, MotionModel
from uavexp.field import DistanceField


class MoverFilter(Protocol):
    """Where one mover is, from positions observed one after the other; see `kalman.MotionFilter`."""

    @property
    def position_m(self) -> Float:
        """Believed centre (3,)."""

    @property
    def velocity_mps(self) -> Float:
        """Believed velocity (3,)."""

    @property
    def covariance(self) -> Float:
        """Of position and velocity (6, 6)."""

    @property
    def innovation_covariance(self) -> Float:
        """Of the next observation's difference from the prediction (3, 3)."""

    @property
    def seen_m(self) -> Float:
        """Where it was last observed (3,)."""

    def estimate(self, of: Estimate) -> tuple[Float, Float]:
        """Position (3,) and velocity (3,) to be published."""

    def swerve_m(self, half_size_m: Float, field: DistanceField | None) -> Float:
        """`Tracks.swerve_m` (K, 3) of a mover of this half size in this map."""

    def predict(self, period_s: float, half_size_m: Float, field: DistanceField | None) -> None:
        """Move on by a period > 0 s, as a mover of this half size in this map."""

    def stay(self, position_m: Float) -> None:
        """Be at a position (3,) after all, after `predict`."""

    def observe(self, position_m: Float) -> None:
        """Take in an observed centre (3,); not finite is no observation."""

    def is_sound(self, max_speed_mps: float, max_deviation_m: float) -> bool:
        """Whether state and covariance are finite, and speed and position within these limits."""


def new_filter(position_m: Float, motion: MotionModel, of: Estimate) -> MoverFilter:
    """A filter that begins at an observed position (3,)."""
    return InteractingFilter(position_m, motion) if of is Estimate.IMM else MotionFilter(position_m, motion)
