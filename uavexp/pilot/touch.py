"""Touching: the vehicle is kept from following, and nothing is mapped where it does not get on.

A vehicle that lags without being held catches up: its speed grows. One that stands against something stands,
however far the reference is. What it stands against is not in the map, or no plan would have led there: a
plate seen edge-on, a wall nearer than the sensor's least range. While movers are about, nothing is noted:
what was touched may have been one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from uavexp.arrays import Float
from uavexp.geometry import yaw_of
from uavexp.types import Limits, Observation

_ERROR_M = 0.12  # from the reference, below it the controller's own
_STILL_MPS = 0.15
_SLIDING_MPS, _CLOSING_MPS = (
    0.6,
    0.1,
)  # of one that has fallen behind at once: along, and towards the reference
_HELD_S = 0.29  # for so long: three ESDF updates
_MAPPED_M = 0.1  # an obstacle mapped so near is the one that is touched
BALL_M, _LARGEST_M = 0.2, 0.8  # radius of what is noted
_NEIGHBOUR_M = 1.5  # what is touched again so near is the same, and larger than was noted
_GAP_M = 0.03  # between the body and that


@dataclass(frozen=True, slots=True)
class Touch:
    """Whether something is touched."""

    since_s: float = math.inf  # the vehicle does not get on

    def felt(self, observation: Observation) -> Touch:
        """The same after another look."""
        lag_m = observation.reference.position_m - observation.state.position_m
        lags = float(np.linalg.norm(lag_m)) >= _ERROR_M and len(observation.tracks) == 0
        still = lags and float(np.linalg.norm(observation.state.velocity_mps)) <= _STILL_MPS
        return replace(self, since_s=min(self.since_s, observation.time_s) if still else math.inf)

    def holds(self, time_s: float) -> bool:
        """Whether it has been so for long enough."""
        return time_s - self.since_s >= _HELD_S


def is_stopped_short(observation: Observation) -> bool:
    """Whether a vehicle that has fallen behind does not come nearer: one that was free would."""
    velocity = observation.state.velocity_mps
    slow = float(np.linalg.norm(velocity)) <= _SLIDING_MPS and len(observation.tracks) == 0
    return slow and float(velocity @ _towards(observation)) <= _CLOSING_MPS


def ball_m(here_m: Float, before_m: list[Float]) -> float:
    """Radius of what is noted: twice as large for each earlier touch near by."""
    near = sum(float(np.linalg.norm(here_m - other_m)) < _NEIGHBOUR_M for other_m in before_m)
    return float(min(BALL_M * 2.0**near, _LARGEST_M))


def touched_m(observation: Observation, limits: Limits, radius_m: float) -> Float | None:
    """Centre (3,) of a ball that holds the vehicle; None: what does is mapped."""
    towards = _towards(observation)
    here_m, reach_m = observation.state.position_m, _reach_m(observation, towards, limits)
    surface_m = here_m + reach_m * towards
    if float(observation.field.distance_m(surface_m[None])[0]) < _MAPPED_M:
        return None
    return np.asarray(here_m + (reach_m + _GAP_M + radius_m) * towards)


def _towards(observation: Observation) -> Float:
    """Direction (3,) from the vehicle to its reference."""
    lag_m = observation.reference.position_m - observation.state.position_m
    return np.asarray(lag_m / max(float(np.linalg.norm(lag_m)), 1e-9))


def _reach_m(observation: Observation, towards: Float, limits: Limits) -> float:
    """From the body's centre to its surface, in a direction (3,)."""
    yaw = yaw_of(observation.state.quaternion_wxyz)
    c, s = math.cos(yaw), math.sin(yaw)
    own = np.abs([c * towards[0] + s * towards[1], c * towards[1] - s * towards[0], towards[2]])
    return float((0.5 * np.array(limits.body_size_m) / np.maximum(own, 1e-6)).min())
