"""Requests that no search can answer, told by their ends."""

from __future__ import annotations

import numpy as np

from uavexp.planner.constraints import Constraints
from uavexp.planner.find.base import FoundPath
from uavexp.types import PlanRequest, PlanStatus


def refusal(request: PlanRequest, constraints: Constraints) -> FoundPath | None:
    """Why start or goal make every search vain; None when they do not."""
    field, bounds, goal_m = request.field, request.flight_bounds_m, request.goal.position_m
    here, there = field.distance_m(np.stack([request.position_m, goal_m]))
    if here <= 0.0:
        reason = f"the start lies {-here:.2f} m inside an obstacle"
        return FoundPath(status=PlanStatus.START_BLOCKED, reason=reason)
    if there < constraints.min_clearance_m or np.any(goal_m < bounds[0]) or np.any(goal_m > bounds[1]):
        reason = f"the goal's clearance is {there:.2f} m, or it is outside"
        return FoundPath(status=PlanStatus.GOAL_BLOCKED, reason=reason)
    if constraints.known_only and not field.observed(goal_m[None])[0]:
        return FoundPath(status=PlanStatus.GOAL_BLOCKED, reason="the goal's voxel is unknown")
    return None
