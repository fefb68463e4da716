"""Come to rest, and fly on from there: what planners do when they find no way with the speed they have."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from uavexp.arrays import Float
from uavexp.braking import braking_trajectory
from uavexp.planner.constraints import Constraints
from uavexp.trajectory import Trajectory, evaluate, join, sample_times
from uavexp.types import PlanRequest, PlanResult

_CHECK_S = 0.02


def braking(request: PlanRequest, constraints: Constraints) -> tuple[Trajectory, Float, str]:
    """The stop in a straight line, its way (P, 3), and where that is not clear; "" when it is."""
    state = (request.position_m, request.velocity_mps, request.acceleration_mps2)
    brake = braking_trajectory(request.time_s, *state, constraints.limits)
    way_m = evaluate(brake, sample_times(brake, brake.start_s, _CHECK_S))[0]
    return brake, way_m, constraints.shortfall(request, way_m)


def standing(request: PlanRequest, time_s: float, position_m: Float) -> PlanRequest:
    """The same request made later, at rest."""
    return replace(
        request,
        time_s=time_s,
        position_m=position_m,
        velocity_mps=np.zeros(3),
        acceleration_mps2=np.zeros(3),
    )


def stop_first(
    request: PlanRequest,
    stop: Trajectory,
    rest_m: Float,
    attempt: Callable[[PlanRequest], PlanResult],
    failed: PlanResult,
    reason: str,
) -> PlanResult:
    """Plan from where a stop ends, and join the two.

    Args:
        request: what was asked.
        stop: from the request's state to rest; its way is free.
        rest_m: (3,) where it ends.
        attempt: plans from there.
        failed: the failure of the direct attempt, which stays the answer when this fails, too.
        reason: given with the joined plan.
    """
    onward = attempt(standing(request, stop.end_s, rest_m))
    if onward.trajectory is None:
        return summed(failed, onward, reason)
    path_m = np.concatenate([request.position_m[None], onward.path_m])
    joined = replace(onward, trajectory=join(stop, onward.trajectory), path_m=path_m)
    return summed(failed, joined, reason)


def summed(failed: PlanResult, then: PlanResult, reason: str) -> PlanResult:
    """The second answer, for this reason, or the first failure when it is none; with the work of both."""
    answer = failed if then.trajectory is None else replace(then, reason=reason)
    return replace(
        answer,
        iterations=failed.iterations + then.iterations,
        expansions=failed.expansions + then.expansions,
        wall_search_s=failed.wall_search_s + then.wall_search_s,
        wall_optimise_s=failed.wall_optimise_s + then.wall_optimise_s,
    )
