"""Shaper `time_law`: the straight ways of a path, each flown from rest to rest.

On a way of length d the distance is d (10 s³ - 15 s⁴ + 6 s⁵), s = t / T: velocity and acceleration are
zero at both ends, so both are continuous at every corner, and the path is not left by a hair. T is
the least that keeps all three peaks, in closed form: speed 15/8 d/T, acceleration 10/√3 d/T², jerk
60 d/T³ (the jerk being what turning the thrust vector at the vehicle's body-rate limit gives, `brake`).

A vehicle that moves brakes in a straight line first, and goes on from where it stands: straight to the
path where that is free, else back the way it came.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from uavexp.arrays import Float
from uavexp.braking import jerk_mps3
from uavexp.parameters import option
from uavexp.planner.constraints import Constraints
from uavexp.planner.find.base import FoundPath
from uavexp.planner.movers.moving import MovingObstacles
from uavexp.planner.shape.base import ShapedPath
from uavexp.planner.shape.course import Given, space_of
from uavexp.planner.shape.shortcut import shortcut
from uavexp.planner.shape.stop_first import braking, standing
from uavexp.trajectory import Trajectory, join
from uavexp.types import Limits, PlanRequest, PlanStatus

_SHORTEST_M = 1e-6  # a shorter way is none
_SHORTEST_S = 0.1  # of a trajectory to where the vehicle already is
_POWERS = np.array([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])


@option
class TimeLaw:
    """Rests at every corner; see the module. Times that came with a path are not used."""

    sees_movers: ClassVar[bool] = False

    def shape(
        self, request: PlanRequest, found: FoundPath, constraints: Constraints, movers: MovingObstacles
    ) -> ShapedPath:
        """Return a trajectory or the reason why there is none (`Shaper.shape`)."""
        del movers
        if found.motion is not None:
            return ShapedPath(status=PlanStatus.OK, trajectory=found.motion)
        limits, path_m = constraints.limits, found.path_m
        if not (limits.max_speed_mps > 0.0 and limits.max_acceleration_mps2 > 0.0):
            reason = f"limits of {limits.max_speed_mps:g} m/s and {limits.max_acceleration_mps2:g} m/s²"
            return ShapedPath(status=PlanStatus.LIMITS, reason=reason)
        if not np.any(request.velocity_mps) and not np.any(request.acceleration_mps2):
            return ShapedPath(status=PlanStatus.OK, trajectory=stop_and_go(path_m, request.time_s, limits))
        brake, way, blocked = braking(request, constraints)
        if blocked:
            return ShapedPath(status=PlanStatus.NOT_CLEAR, reason=f"braking: {blocked}")
        given = Given(standing(request, brake.end_s, way[-1]), path_m, None, constraints)
        path = shortcut(np.concatenate([way[::-1], path_m[1:]]), space_of(given, 0.0))
        onward = stop_and_go(path, brake.end_s, limits)
        return ShapedPath(status=PlanStatus.OK, trajectory=join(brake, onward), reason="brakes first")


def stop_and_go(path_m: Float, start_s: float, limits: Limits) -> Trajectory:
    """Trajectory along a polyline (P, 3) that rests at its every point, as fast as the limits allow.

    Args:
        path_m: (P, 3).
        start_s: absolute time at its first point.
        limits: of the vehicle.
    """
    steps = np.diff(path_m, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    kept = lengths > _SHORTEST_M
    if not kept.any():
        kept[0], steps[0] = True, path_m[-1] - path_m[0]
    durations = np.maximum(_durations(lengths[kept], limits), _SHORTEST_S if kept.sum() == 1 else 0.0)
    coefficients = _POWERS[:, None] / durations[:, None, None] ** np.arange(6)[:, None] * steps[kept][:, None]
    coefficients[:, 0] = path_m[:-1][kept]
    breaks = start_s + np.concatenate([[0.0], np.cumsum(durations)])
    return Trajectory(breaks_s=breaks, coefficients=coefficients, at_rest=True)


def _durations(lengths_m: Float, limits: Limits) -> Float:
    """Least duration (K,) of each way, s."""
    by_speed = 15.0 / 8.0 * lengths_m / limits.max_speed_mps
    by_acceleration = np.sqrt(10.0 / math.sqrt(3.0) * lengths_m / limits.max_acceleration_mps2)
    by_jerk = np.cbrt(60.0 * lengths_m / jerk_mps3(limits))
    return np.asarray(np.maximum(by_speed, np.maximum(by_acceleration, by_jerk)))
