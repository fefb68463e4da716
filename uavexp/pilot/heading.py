"""Where the vehicle looks: the yaw that is asked for, turned step by step."""

from __future__ import annotations

import math
from dataclasses import dataclass

from uavexp.arrays import Float
from uavexp.geometry import wrap_angle
from uavexp.types import Goal

_AHEAD_M = 0.1  # a shorter way ahead has no direction
_GAIN_PER_S = 4.0  # from yaw error to yaw rate


@dataclass(slots=True, kw_only=True)
class Heading:
    """A yaw and how fast it may turn."""

    yaw_rad: float
    most_radps: float

    def turn_to(self, bearing_rad: float, step_s: float) -> float:
        """Turn towards a bearing (NaN: stay) for one step; returns the rate, rad/s."""
        if math.isnan(bearing_rad):
            return 0.0
        rate_radps = _GAIN_PER_S * float(wrap_angle(bearing_rad - self.yaw_rad))
        return self.turn(min(max(rate_radps, -self.most_radps), self.most_radps), step_s)

    def turn(self, rate_radps: float, step_s: float) -> float:
        """Turn at this rate for one step; returns the rate."""
        self.yaw_rad = wrap_angle(self.yaw_rad + rate_radps * step_s)
        return rate_radps

    def turning_s(self, bearing_rad: float, within_rad: float) -> float:
        """Time to turn until the yaw is within an angle of a bearing, s."""
        error_rad = abs(float(wrap_angle(bearing_rad - self.yaw_rad)))
        return max(0.0, error_rad - within_rad) / self.most_radps


def bearing_rad(goal: Goal | None, ahead_m: Float) -> float:
    """Where to look: as the goal asks, else along the path ahead; NaN: as before.

    Args:
        goal: g*, if there is one.
        ahead_m: (3,) the way to come.
    """
    if goal is not None and math.isfinite(goal.yaw_rad):
        return goal.yaw_rad
    if math.hypot(ahead_m[0], ahead_m[1]) < _AHEAD_M:
        return math.nan
    return math.atan2(ahead_m[1], ahead_m[0])
