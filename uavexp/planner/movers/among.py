"""Planning among movers with a planner that knows no time.

It is given the map with every mover where the vehicle would meet it at one pace or another
(`moving.stamped`), and its plan is judged at the true instants (`moving.shortfall`). What does not
pass is planned in the map as it is, for in time there may be a way; then from where the vehicle
has stopped or stepped aside (`escape`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from uavexp.field import DistanceField
from uavexp.planner.clearance import shortfall
from uavexp.planner.movers.escape import safest_stop
from uavexp.planner.movers.moving import MovingObstacles
from uavexp.planner.shape.stop_first import stop_first, summed
from uavexp.trajectory import evaluate
from uavexp.types import Limits, PlanRequest, PlanResult, PlanStatus

Plan = Callable[[PlanRequest], PlanResult]
_PACES = (0.9, 0.5)  # of the speed limit, at which the vehicle may come to where it meets a mover
_CHECK_S = 0.02
_CARE_M = 0.5  # beyond the least clearance, up to which a mover in the map is felt


def plan_among(
    request: PlanRequest,
    plan: Plan,
    limits: Limits,
    *,
    margin_m: float,
    horizon_s: float,
    min_clearance_m: float,
    known_only: bool,
) -> PlanResult:
    """Plan with movers as obstacles in time; without movers, or with no horizon, `plan` alone.

    Args:
        request: what is asked, with the tracks.
        plan: the planner, which looks at the request's map only.
        limits: of the vehicle.
        margin_m: kept from movers beyond the body's radius.
        horizon_s: for which predictions count; 0: movers are ignored.
        min_clearance_m: that the planner keeps from the map.
        known_only: whether unknown space is closed.
    """
    moving = MovingObstacles(
        tracks=request.tracks,
        field=request.field,
        body_radius_m=limits.body_radius_m,
        margin_m=margin_m,
        horizon_s=horizon_s,
    )
    if not len(moving) or horizon_s <= 0.0:
        return plan(request)

    def met(asked: PlanRequest, speed_mps: float) -> DistanceField:
        return moving.stamped(
            asked,
            speed_mps=speed_mps,
            acceleration_mps2=limits.max_acceleration_mps2,
            least_m=min_clearance_m,
            safe_m=min_clearance_m + _CARE_M,
            solid=True,
        )

    def attempt(asked: PlanRequest) -> PlanResult:
        """Plan around where movers are met at one pace after the other, then in the map as it is."""
        result: PlanResult | None = None
        for pace in (*_PACES, None):
            map_ = asked.field if pace is None else met(asked, pace * limits.max_speed_mps)
            answer = _judged(plan(replace(asked, field=map_)), asked, moving, limits)
            result = answer if result is None else summed(result, answer, answer.reason)
            if result.trajectory is not None:
                return result
        assert result is not None
        return result

    result = attempt(request)
    if result.trajectory is not None:
        return result
    stop, aside = safest_stop(
        request,
        moving,
        lambda points_m: shortfall(
            request, points_m, min_clearance_m, limits.max_acceleration_mps2, known_only
        ),
        limits,
    )
    rest_m = evaluate(stop, np.array([stop.end_s]))[0][0]
    reason = "steps aside first" if aside else "brakes first"
    return stop_first(request, stop, rest_m, attempt, result, reason)


def _judged(result: PlanResult, request: PlanRequest, moving: MovingObstacles, limits: Limits) -> PlanResult:
    """The answer, or that its trajectory comes too near to a mover."""
    if result.trajectory is None:
        return result
    times_s = request.time_s + np.arange(0.0, moving.horizon_s, _CHECK_S)
    points_m = evaluate(result.trajectory, times_s)[0]
    reason = moving.shortfall(points_m, times_s, limits.max_acceleration_mps2)
    if not reason:
        return result
    return replace(result, status=PlanStatus.NOT_CLEAR, trajectory=None, reason=reason)
