"""Where the vehicle looks: the yaw that is asked for, turned step by step."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba as nb

from uavexp.arrays import Float
from uavexp.geometry import wrap_angle

_AHEAD_M = 0.1  # a shorter way ahead has no direction
_GAIN_PER_S = 4.0  # from yaw error to yaw rate


@nb.njit(cache=True)
def bearing_rad(wanted_rad: float, ahead_m: Float) -> float:
    """Where to look: as wanted (NaN: no wish), else along the way to come (3,); NaN: as before."""
    if not math.isnan(wanted_rad):
        return wanted_rad
    if math.hypot(ahead_m[0], ahead_m[1]) < _AHEAD_M:
        return math.nan
    return math.atan2(ahead_m[1], ahead_m[0])


@nb.njit(cache=True)
def rate_to(bearing_rad: float, yaw_rad: float, most_radps: float) -> float:
    """How fast to turn towards a bearing, rad/s."""
    rate_radps = _GAIN_PER_S * wrap_angle(bearing_rad - yaw_rad)
    return float(min(max(rate_radps, -most_radps), most_radps))


@dataclass(slots=True, kw_only=True)
class Heading:
    """A yaw and how fast it may turn."""

    yaw_rad: float
    most_radps: float

    def turn(self, rate_radps: float, step_s: float) -> float:
        """Turn at this rate for one step; returns the rate."""
        self.yaw_rad = wrap_angle(self.yaw_rad + rate_radps * step_s)
        return rate_radps

    def turning_s(self, bearing_rad: float, within_rad: float) -> float:
        """Time to turn until the yaw is within an angle of a bearing, s."""
        error_rad = abs(float(wrap_angle(bearing_rad - self.yaw_rad)))
        return max(0.0, error_rad - within_rad) / self.most_radps
