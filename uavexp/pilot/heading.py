"""Where the vehicle looks: the yaw that is asked for, how fast to turn, and whether there is room to."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from uavexp.arrays import Float
from uavexp.field import DistanceField
from uavexp.geometry import wrap_angle
from uavexp.types import Limits

_AHEAD_M = 0.1  # a shorter way ahead has no direction
_CORNER_M = 0.02  # kept between the turning body and what is mapped
_SLOW_MPS = 1.0  # from here on the way has to be seen
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
def glanced_rad(way_rad: float, glance_rad: float, most_rad: float) -> float:
    """The bearing of the way (NaN: none), turned to somebody else by so much at most."""
    if math.isnan(way_rad):
        return glance_rad
    aside_rad = wrap_angle(glance_rad - way_rad)
    return float(wrap_angle(way_rad + min(max(aside_rad, -most_rad), most_rad)))


@nb.njit(cache=True)
def free_glance_rad(speed_mps: float) -> float:
    """By how much the yaw may leave the way of a slow flight: who stands need not see where to."""
    return math.pi * max(1.0 - speed_mps / _SLOW_MPS, 0.0)


@nb.njit(cache=True)
def rate_to(bearing_rad: float, yaw_rad: float, most_radps: float) -> float:
    """How fast to turn towards a bearing, rad/s."""
    rate_radps = _GAIN_PER_S * wrap_angle(bearing_rad - yaw_rad)
    return float(min(max(rate_radps, -most_radps), most_radps))


def room_to_turn(field: DistanceField, position_m: Float, limits: Limits) -> bool:
    """Whether the body can turn on the spot: the circle of its corners keeps off what is mapped."""
    angle = np.linspace(0.0, 2.0 * math.pi, 16, endpoint=False)
    circle = limits.body_radius_m * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(16)])
    half_m = np.array([0.0, 0.0, 0.5 * limits.body_size_m[2]])
    rings_m = np.concatenate([position_m + circle + share * half_m for share in (-1.0, 0.0, 1.0)])
    return bool(field.distance_m(rings_m).min() >= _CORNER_M)
