"""What a planner's paths and curves keep, whatever finds and shapes them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from uavexp.arrays import Float
from uavexp.types import Limits, PlanRequest, PlanResult, PlanStatus

_FOR_ROOM = (PlanStatus.START_BLOCKED, PlanStatus.GOAL_BLOCKED, PlanStatus.NO_PATH, PlanStatus.NOT_CLEAR)
_SPARE = 1.05  # of the lesser speed, at which the vehicle may be when it is asked for
_START_SLACK_M = 0.01  # by which a start below the hard limit may come closer still


@dataclass(frozen=True, slots=True, kw_only=True)
class Constraints:
    """Fixed for a trial; predicted movers are told apart (`movers.moving`)."""

    limits: Limits
    min_clearance_m: float  # hard limit on the mapped distance of the body centre
    safe_clearance_m: float  # beyond it nothing is gained
    z_band_m: float  # the heights between start and goal may be left by this much
    known_only: bool  # unknown space is closed

    def narrowed(
        self, failed: PlanResult, request: PlanRequest, clearance_m: float, speed_mps: float
    ) -> Constraints | None:
        """A lesser clearance at a lesser speed, for where these found no way; None: it would not help."""
        too_fast = float(np.linalg.norm(request.velocity_mps)) > _SPARE * speed_mps
        if failed.status not in _FOR_ROOM or too_fast or not 0.0 < clearance_m < self.min_clearance_m:
            return None
        limits = replace(self.limits, max_speed_mps=min(speed_mps, self.limits.max_speed_mps))
        return replace(self, min_clearance_m=clearance_m, limits=limits)

    def shortfall(self, request: PlanRequest, points_m: Float) -> str:
        """Say where a curve through points (P, 3) from the request's start is not clear; "" when it is.

        A start below the limit may come no closer to the obstacle than its speed towards it makes
        unavoidable; once it has reached the limit it keeps it.
        """
        field, bounds = request.field, request.flight_bounds_m
        clearance = field.distance_m(points_m)
        enough = clearance >= self.min_clearance_m
        if not enough[0]:
            escaped = int(np.argmax(enough)) if enough.any() else len(points_m)
            towards = max(-float(field.gradient(points_m[:1])[0] @ request.velocity_mps), 0.0)
            stop_m = towards**2 / (2.0 * self.limits.max_acceleration_mps2)
            enough[:escaped] = clearance[:escaped] >= max(clearance[0] - stop_m - _START_SLACK_M, 0.0)
        if not enough.all():
            worst = int(np.argmin(np.where(enough, np.inf, clearance)))
            return f"clearance {clearance[worst]:.2f} m at {_text(points_m[worst])}"
        # a start outside the bounds may come back, not go further
        low, high = np.minimum(bounds[0], points_m[0]) - 1e-6, np.maximum(bounds[1], points_m[0]) + 1e-6
        if (points_m.min(axis=0) < low).any() or (points_m.max(axis=0) > high).any():
            outside = ((points_m < low) | (points_m > high)).any(axis=1)
            return f"leaves the flight bounds at {_text(points_m[int(np.argmax(outside))])}"
        if self.known_only:
            known = field.observed(points_m)
            known[: int(np.argmax(known))] = True  # a start in unknown space may leave it
            if not known.all():
                return f"enters unknown space at {_text(points_m[int(np.argmin(known))])}"
        return ""


def _text(point: Float) -> str:
    return "(" + ", ".join(f"{value:.2f}" for value in point) + ") m"
