"""What every planner promises; to refuse is allowed, wherever something is in the way."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from uavexp.arrays import Float
from uavexp.check.fields import field_from
from uavexp.check.hall import LIMITS
from uavexp.check.promise import Make, keep, same, untouched
from uavexp.check.requests import (
    among_shelves,
    ask,
    follow_on,
    hopeless,
    in_empty_space,
    obstacle_course,
)
from uavexp.trajectory import Trajectory, evaluate
from uavexp.types import PlanRequest, PlanResult, PlanStatus

_STEP_S = 1e-3  # between the moments at which a trajectory is looked at
_PLACE_M = 1e-6  # and m/s, and a tenth of it in m/s²: how far from the state asked for is still there
_SHARE = 1e-4  # of a limit, by which rounding and sampling may exceed it
_JUMP_MPS2 = 0.01


@dataclass(frozen=True, slots=True)
class _Plan:
    """A request that was answered with a trajectory, looked at every millisecond."""

    name: str
    request: PlanRequest
    trajectory: Trajectory
    time_s: Float  # (N,)
    position_m: Float  # (N, 3)
    velocity_mps: Float  # (N, 3)
    acceleration_mps2: Float  # (N, 3)


def _planner(make: Make) -> Any:
    planner = make()
    planner.reset(LIMITS, np.random.default_rng(7))
    return planner


@functools.lru_cache(maxsize=1)
def _answers(make: Make) -> tuple[tuple[str, PlanRequest, PlanResult], ...]:
    """Every request of an ordinary flight and its answer; each plan among shelves is replanned in flight."""
    planner, answers = _planner(make), []
    for number, request in enumerate([*in_empty_space(), *among_shelves(0, 6)]):
        answers.append((f"request {number}", request, planner.plan(request)))
    for name, request, result in answers[:3] + answers[3::3]:
        for again in range(2):
            if not isinstance(result, PlanResult) or result.trajectory is None:
                break
            request = follow_on(request, result.trajectory)
            result = planner.plan(request)
            answers.append((f"replan {again + 1} of {name}", request, result))
    return tuple(answers)


def _plans(make: Make) -> Iterator[_Plan]:
    for name, request, result in _answers(make):
        if result.trajectory is not None:
            times = np.arange(result.trajectory.start_s, result.trajectory.end_s, _STEP_S)
            times = np.append(times, result.trajectory.end_s)
            yield _Plan(name, request, result.trajectory, times, *evaluate(result.trajectory, times))


def _keep_below(limit: float, unit: str, plan: _Plan, values: Float) -> None:
    worst = int(np.argmax(values))
    keep(
        values[worst] <= limit * (1.0 + _SHARE),
        f"{values[worst]:.4g} {unit} at {plan.time_s[worst]:.2f} s of {plan.name}, limit {limit:g} {unit}",
    )


def _keep_equal(what: str, unit: str, plan: _Plan, have: Float, want: Float, within: float) -> None:
    apart = float(np.linalg.norm(have - want))
    keep(apart <= within, f"{what} of {plan.name} is {apart:.3g} {unit} from the one asked for")


def answers_every_request_with_a_plan_or_a_reason(make: Make) -> None:
    """A hard problem is a status and a sentence, never an exception."""
    for name, _, result in _answers(make):
        keep(isinstance(result, PlanResult), f"{name} is answered with {type(result).__name__}")
        keep(result.status is PlanStatus.OK or result.reason != "", f"{name} is refused without a reason")


def finds_a_way_where_nothing_is_mapped(make: Make) -> None:
    """In empty space, far from every limit, there is no reason to refuse."""
    for name, _, result in _answers(make)[:3]:
        keep(result.trajectory is not None, f"{name}, through empty space, is refused: {result.reason}")


def begins_in_the_state_it_is_asked_from(make: Make) -> None:
    """Position, velocity and acceleration are continuous where the plan takes over."""
    for plan in _plans(make):
        late_s = plan.trajectory.start_s - plan.request.time_s
        keep(late_s == 0.0, f"{plan.name} begins {late_s:.3g} s after the time asked for")
        _keep_equal("position", "m", plan, plan.position_m[0], plan.request.position_m, _PLACE_M)
        _keep_equal("velocity", "m/s", plan, plan.velocity_mps[0], plan.request.velocity_mps, _PLACE_M)
        wanted = plan.request.acceleration_mps2
        _keep_equal("acceleration", "m/s²", plan, plan.acceleration_mps2[0], wanted, 10.0 * _PLACE_M)


def ends_at_the_goal(make: Make) -> None:
    """At rest when the goal is the target, and says so."""
    for plan in _plans(make):
        target = plan.request.goal.is_target
        _keep_equal("end", "m", plan, plan.position_m[-1], plan.request.goal.position_m, _PLACE_M)
        keep(plan.trajectory.at_rest or not target, f"{plan.name} leads to the target but not to rest")
        if plan.trajectory.at_rest:
            _keep_equal("end velocity", "m/s", plan, plan.velocity_mps[-1], np.zeros(3), _PLACE_M)


def keeps_the_speed_limit(make: Make) -> None:
    """Along the whole trajectory."""
    for plan in _plans(make):
        _keep_below(LIMITS.max_speed_mps, "m/s", plan, np.linalg.norm(plan.velocity_mps, axis=1))


def keeps_the_acceleration_limit(make: Make) -> None:
    """Along the whole trajectory."""
    for plan in _plans(make):
        acceleration = np.linalg.norm(plan.acceleration_mps2, axis=1)
        _keep_below(LIMITS.max_acceleration_mps2, "m/s²", plan, acceleration)


def never_jumps(make: Make) -> None:
    """Position, velocity and acceleration go on from piece to piece."""
    for plan in _plans(make):
        breaks_s, units = plan.trajectory.breaks_s[1:-1], ("m", "m/s", "m/s²")
        before, after = (evaluate(plan.trajectory, breaks_s + shift_s) for shift_s in (-1e-7, 1e-7))
        for unit, left, right in zip(units, before, after, strict=True):
            jump = np.linalg.norm(right - left, axis=1)
            worst = int(np.argmax(jump)) if jump.size else 0
            keep(
                jump.max(initial=0.0) < _JUMP_MPS2,
                f"a jump by {jump.max(initial=0.0):.3g} {unit} "
                f"at {plan.trajectory.breaks_s[1 + worst]:.2f} s of {plan.name}",
            )


def keeps_clear_of_what_is_mapped(make: Make) -> None:
    """The body's circle meets no mapped obstacle; every request starts clear of them."""
    for plan in _plans(make):
        clear_m = plan.request.field.distance_m(plan.position_m)
        worst = int(np.argmin(clear_m))
        keep(
            clear_m[worst] > LIMITS.body_radius_m,
            f"{clear_m[worst]:.3f} m from an obstacle at {plan.time_s[worst]:.2f} s of {plan.name}, "
            f"the body's radius is {LIMITS.body_radius_m:.3f} m",
        )


def stays_within_the_flight_bounds(make: Make) -> None:
    """All of the trajectory."""
    for plan in _plans(make):
        low, high = plan.request.flight_bounds_m
        beyond_m = np.maximum(low - plan.position_m, plan.position_m - high).max(axis=1)
        worst = int(np.argmax(beyond_m))
        keep(
            beyond_m[worst] <= 0.0,
            f"{beyond_m[worst]:.3f} m outside at {plan.time_s[worst]:.2f} s of {plan.name}",
        )


def refuses_what_cannot_be_flown(make: Make) -> None:
    """Whatever the status, no trajectory leads out of, into or through a wall."""
    planner = _planner(make)
    for words, request in hopeless().items():
        status = planner.plan(request).status
        keep(status is not PlanStatus.OK, f"{words} is answered with a plan")


def gives_the_same_plan_whatever_was_asked_before(make: Make) -> None:
    """Same generator, same request, same bits; clock times apart."""
    requests = [in_empty_space()[2], *among_shelves(2, 3)]
    used = _planner(make)
    for request in requests:
        used.plan(request)
    for number, request in enumerate(requests):
        again, fresh = used.plan(request), _planner(make).plan(request)
        keep(same(again, fresh), f"request {number} is answered otherwise after {len(requests)} others")


def moves_along_with_a_shifted_world(make: Make) -> None:
    """A hall that stands elsewhere is flown in the same way, to 5 cm."""
    grid, start, goal = obstacle_course()
    velocity, shift = np.array([0.6, -0.3, 0.0]), np.array([3.0, -7.0, 0.5])
    here = _planner(make).plan(ask(field_from(grid), start, goal, velocity_mps=velocity))
    elsewhere = ask(field_from(grid, origin_m=shift), start + shift, goal + shift, velocity_mps=velocity)
    there = _planner(make).plan(elsewhere)
    keep(here.status is there.status, f"{here.status} here, {there.status} elsewhere")
    if here.trajectory is None or there.trajectory is None:
        return
    times = here.trajectory.start_s + np.linspace(0.0, here.trajectory.duration_s, 100)
    moved = evaluate(there.trajectory, times)[0] - shift - evaluate(here.trajectory, times)[0]
    apart_m = float(np.linalg.norm(moved, axis=1).max())
    keep(apart_m <= 0.05, f"it flies {apart_m:.3f} m aside in a hall that stands elsewhere")


def writes_into_nothing_it_is_given(make: Make) -> None:
    """The map and the reference's state are the trial's own."""
    planner = _planner(make)
    for request in [in_empty_space()[2], *among_shelves(3, 2)]:
        with untouched(request=request):
            planner.plan(request)
