"""The path of a corridor, and when its points are passed.

Straight ways where they are free, timed as early as the limits allow. A start that moves off the path
is led back to it in an arc, where that is free, so that the corridor begins where the vehicle goes.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np

from uavexp.arrays import Float
from uavexp.planner.constraints import Constraints
from uavexp.planner.find.free_space import FreeSpace, free_space, straight_is_free
from uavexp.planner.shape.shortcut import shortcut
from uavexp.planner.shape.start import TANGENT_M
from uavexp.planner.shape.timing import STEP_M, resample, smooth, time_profile
from uavexp.types import PlanRequest

_RESERVE_M = 0.1  # clearance of straight ways above the limit: room to round their corners
_SMOOTHING_ROUNDS = 10  # of the path that is timed: takes its corners and staircase out
_SWERVES = (1.0, 2.0)  # decelerations tried, as shares of the limit, of a velocity that is off the path


class Timed(NamedTuple):
    """A path with the times at which it is passed."""

    points: Float  # (P, 3)
    times: Float  # (P,) s from the start, increasing


class Given(NamedTuple):
    """What is to be shaped, and within what."""

    request: PlanRequest
    path: Float  # (P, 3)
    times: Float | None
    constraints: Constraints


def space_of(given: Given, reserve_m: float) -> FreeSpace:
    """Free space for the way from start to goal, at so much more than the clearance asked for."""
    request, kept = given.request, given.constraints
    ends = np.stack([request.position_m, request.goal.position_m])
    clearance_m = kept.min_clearance_m + reserve_m
    return free_space(request.field, ends, request.flight_bounds_m, clearance_m, math.inf, kept.known_only)


def course(given: Given, end_mps: float, straight: bool) -> Timed:
    """The path with its times: those it came with, or the time-optimal traversal from this start.

    Args:
        given: what is to be shaped.
        end_mps: speed at the end.
        straight: along straight ways, where they are free, and not the searched path itself.
    """
    if given.times is not None and straight:
        return Timed(given.path, given.times)
    points = shortcut(resample(given.path, STEP_M), space_of(given, _RESERVE_M)) if straight else given.path
    raw = resample(points, STEP_M)
    path = smooth(raw, _SMOOTHING_ROUNDS)
    velocity, limits = given.request.velocity_mps, given.constraints.limits
    ahead = path[min(round(TANGENT_M / STEP_M), len(path) - 1)] - path[0]
    length = float(np.linalg.norm(ahead))
    ahead = ahead / length if length > 1e-9 else np.zeros(3)
    along = float(velocity @ ahead)
    aside = velocity - max(along, 0.0) * ahead
    fastest = (limits.max_speed_mps, limits.max_acceleration_mps2)
    times = time_profile(path, max(along, 0.0), end_mps, *fastest)
    # a vehicle moving away needs v/a to stop and sqrt(2) v/a to come back
    across = float(np.linalg.norm(aside + max(-along, 0.0) * ahead))
    lost = (across + (1.0 + math.sqrt(2.0)) * max(-along, 0.0)) / limits.max_acceleration_mps2
    total = float(times[-1])
    times = times * ((total + lost) / total) if total > 0.0 else times + lost
    for harder in _SWERVES:
        swerved = _swerved(raw, times, aside, harder * limits.max_acceleration_mps2)
        if _is_free(swerved, given):
            return Timed(swerved, times)
    return Timed(raw, times)


def _swerved(points: Float, times: Float, aside_mps: Float, max_acceleration_mps2: float) -> Float:
    """The points where a vehicle would be that begins with a velocity off the path and returns to it.

    The offset t (1 - t / d)² times that velocity has the deceleration 4 v / d at the start.
    """
    duration = 4.0 * float(np.linalg.norm(aside_mps)) / max_acceleration_mps2
    if duration == 0.0:
        return points
    offset = times * np.maximum(1.0 - times / duration, 0.0) ** 2
    return np.asarray(points + offset[:, None] * aside_mps)


def _is_free(points: Float, given: Given) -> bool:
    """Whether the polyline (P, 3) is clear."""
    space = space_of(given, 0.0)
    return all(straight_is_free(space, a, b)[0] for a, b in itertools.pairwise(points))


def at_shares(timed: Timed, shares: Float) -> Float:
    """Points (S, 3) of a timed path at shares (S,) of its duration."""
    at = shares * timed.times[-1]
    return np.stack([np.interp(at, timed.times, timed.points[:, axis]) for axis in range(3)], axis=1)
