"""The common way to time a geometric path, limits or not: a cubic spline through its corners.

The corners get the times at which a point would pass them that runs along the polyline, without
slowing down at corners, from rest to rest under the trapezoidal law of v_max and a_max; the clamped
cubic spline through them is flown. Nothing makes the spline keep the limits or the clearance: it is
what papers compare with when they count violations of geometric planners (paper 4 does not state its
law), and it is never a default.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import ClassVar

import numpy as np
from scipy.interpolate import CubicSpline

from uavexp.arrays import Float
from uavexp.parameters import NonNegative, option
from uavexp.planner.constraints import Constraints
from uavexp.planner.find.base import FoundPath
from uavexp.planner.movers.moving import MovingObstacles
from uavexp.planner.shape.base import ShapedPath
from uavexp.trajectory import Trajectory
from uavexp.types import Limits, PlanRequest, PlanStatus

_SHORTEST_M = 1e-3  # corners nearer than this are one
_SHORTEST_S = 0.1  # of a trajectory to where the vehicle already is


@option
class WaypointSpline:
    """Unchecked spline through the corners; see the module. Times that came with a path are not used."""

    sees_movers: ClassVar[bool] = False
    top_speed_mps: NonNegative = 0.0  # m/s, of the law along the polyline; 0: the vehicle's. With
    # planner.find.corner_speed_mps of straight edges corners are filtered and timed by one law [ours]

    def shape(
        self, request: PlanRequest, found: FoundPath, constraints: Constraints, movers: MovingObstacles
    ) -> ShapedPath:
        """Return a trajectory or the reason why there is none (`Shaper.shape`)."""
        del movers
        limits, path_m = constraints.limits, found.path_m
        if not (limits.max_speed_mps > 0.0 and limits.max_acceleration_mps2 > 0.0):
            reason = f"limits of {limits.max_speed_mps:g} m/s and {limits.max_acceleration_mps2:g} m/s²"
            return ShapedPath(status=PlanStatus.LIMITS, reason=reason)
        apart = np.linalg.norm(np.diff(path_m, axis=0), axis=1) > _SHORTEST_M
        corners = np.concatenate([path_m[:1], path_m[1:][apart]])
        if len(corners) < 2:
            corners = np.concatenate([path_m[:1], path_m[-1:]])
        slow = min(self.top_speed_mps or limits.max_speed_mps, limits.max_speed_mps)
        times = passing_times_s(corners, replace(limits, max_speed_mps=slow))
        spline = CubicSpline(times, corners, bc_type=((1, request.velocity_mps), (1, np.zeros(3))))
        trajectory = Trajectory(
            breaks_s=request.time_s + times,
            coefficients=np.ascontiguousarray(spline.c[::-1].transpose(1, 0, 2)),
            at_rest=True,
        )
        return ShapedPath(status=PlanStatus.OK, trajectory=trajectory)


def passing_times_s(corners_m: Float, limits: Limits) -> Float:
    """Times (P,) from 0 at which the trapezoidal law along a polyline (P, 3) passes its corners, s."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners_m, axis=0), axis=1))])
    total, speed, acceleration = along[-1], limits.max_speed_mps, limits.max_acceleration_mps2
    ramp = min(speed**2 / (2.0 * acceleration), 0.5 * total)
    top = math.sqrt(2.0 * acceleration * ramp)
    end = 2.0 * top / acceleration + (total - 2.0 * ramp) / speed
    speeding_up = np.sqrt(2.0 * along / acceleration)
    cruising = top / acceleration + (along - ramp) / speed
    slowing_down = end - np.sqrt(2.0 * np.maximum(total - along, 0.0) / acceleration)
    times: Float = np.where(
        along <= ramp, speeding_up, np.where(along < total - ramp, cruising, slowing_down)
    )
    times[-1] = max(end, _SHORTEST_S)
    return times
