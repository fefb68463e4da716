"""A planning request: what the planner is asked, and what the safety lets be flown of its answer."""

from __future__ import annotations

from dataclasses import replace

from uavexp.answers import ask
from uavexp.arrays import Float
from uavexp.braking import with_stop
from uavexp.pace import AS_PLANNED
from uavexp.pilot.base import Crew
from uavexp.pilot.flown import Flown, is_held
from uavexp.pilot.recovering import Recovering
from uavexp.pilot.steering import Steering
from uavexp.trajectory import hover_before
from uavexp.types import Goal, Observation, PlanRequest, PlanResult, PlanStatus, Squeeze

GOALS_FAULT = (PlanStatus.GOAL_BLOCKED, PlanStatus.NO_PATH, PlanStatus.NOT_CLEAR)  # another may do
ANYWAY = (*GOALS_FAULT, PlanStatus.LIMITS, PlanStatus.SOLVER)  # the same for a vehicle that is lost

Motion = tuple[Float, Float, Float]  # position, velocity and acceleration (3,)


def plan_request(
    crew: Crew, observation: Observation, start: Motion, goal: Goal, squeeze: Squeeze | None
) -> PlanRequest:
    """What the planner is asked: from a motion on that is there when the latency has passed."""
    position_m, velocity_mps, acceleration_mps2 = start
    return PlanRequest(
        time_s=observation.time_s + crew.latency_s, position_m=position_m, velocity_mps=velocity_mps,
        acceleration_mps2=acceleration_mps2, goal=goal, field=observation.field,
        flight_bounds_m=crew.flight_bounds_m, tracks=observation.tracks, squeeze=squeeze,
    )  # fmt: skip


def planned(
    crew: Crew,
    steering: Steering,
    recovery: Recovering,
    request: PlanRequest,
    observation: Observation,
    wanted_rad: float,
) -> tuple[PlanResult, Flown | None]:
    """The planner's answer, and what is to be flown of it: nothing where the safety refuses.

    Args:
        crew: planner and guard.
        steering: which turns the vehicle first.
        recovery: which of a vehicle that is lost notes where it is held.
        request: from `plan_request`.
        observation: now.
        wanted_rad: the yaw that the goal asks for; NaN: none.
    """
    result = ask(PlanResult, crew.planner.plan, request)
    crew.watch.add("search", result.wall_search_s)
    crew.watch.add("optimise", result.wall_optimise_s)
    plan = result.trajectory
    if plan is None:
        return result, None
    turn_s = steering.first_s(plan, wanted_rad)
    flown = with_stop(hover_before(plan, turn_s), crew.limits)
    rate = AS_PLANNED.at(plan.start_s)[1:]
    way = crew.guard.flyable(flown, plan.start_s, rate, observation, squeeze=request.squeeze)
    refused = way.refused
    if not refused and recovery.lost and is_held(flown, way.pace):
        recovery.note_hold(flown, flown.start_s)
        refused = "the safety holds it where it stands"
    if refused:
        return replace(result, status=PlanStatus.LIMITS, trajectory=None, reason=refused), None
    moves_s = plan.start_s + turn_s
    goal, squeeze = request.goal, request.squeeze
    return result, Flown(trajectory=flown, goal=goal, moves_s=moves_s, pace=way.pace, squeeze=squeeze)
