"""Shapers asked without a planner."""

from __future__ import annotations

from uavexp.arrays import Float
from uavexp.planner.constraints import Constraints
from uavexp.planner.find.base import FoundPath
from uavexp.planner.movers.moving import MovingObstacles
from uavexp.planner.shape.base import ShapedPath, Shaper
from uavexp.types import Limits, PlanRequest, PlanStatus, Tracks

NO_MOVERS = MovingObstacles(tracks=Tracks.none(), body_radius_m=0.0, margin_m=0.0, horizon_s=0.0)


def shaped(
    shaper: Shaper, request: PlanRequest, path_m: Float, limits: Limits, times_s: Float | None = None
) -> ShapedPath:
    """What a shaper makes of a path (P, 3), found with these times or none, 0.26 m off everything."""
    kept = Constraints(
        limits=limits, min_clearance_m=0.26, safe_clearance_m=0.75, z_band_m=0.3, known_only=False
    )
    found = FoundPath(status=PlanStatus.OK, path_m=path_m, times_s=times_s)
    return shaper.shape(request, found, kept, NO_MOVERS)
