"""What every replanning policy promises, on a flight along a hall whose map changes."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from uavexp.braking import with_stop
from uavexp.check.fields import empty
from uavexp.check.hall import LIMITS, STRAIGHT, change, goal_at, observe, room
from uavexp.check.promise import Make, keep, same, untouched
from uavexp.field import DistanceField
from uavexp.types import Decision, Goal, Observation

_FLOWN = with_stop(STRAIGHT, LIMITS)
_SHIFT_M = np.array([3.7, -2.2, 0.5])
_PILLAR = ((4.0, 2.0, 0.0), (4.2, 2.2, 2.0))
_SCORE = 1e-6  # by which the score may differ where the world stands elsewhere


def _maps() -> Iterator[DistanceField]:
    """The hall at 10 Hz: unknown recedes, at t = 2.5 s a pillar shows on the line, at 4 s it is gone."""
    for tick in range(60):
        unknown = empty((7.0, 4.0, 2.0))
        unknown[30 + tick :] = True
        yield room(*([_PILLAR] if 15 <= tick < 30 else []), unknown=unknown)


@functools.cache
def _seen() -> tuple[Observation, ...]:
    """What a flight along the line sees from t = 1 s on; the best goal drifts away at t = 5 s."""
    maps = list(_maps())
    return tuple(
        observe(
            now,
            change(before, now),
            time_s=1.0 + 0.1 * tick,
            goal=goal_at(5.5),
            best=goal_at(5.5 if tick < 40 else 4.9),
            trajectory=_FLOWN,
        )
        for tick, (before, now) in enumerate(pairwise([maps[0], *maps]))
    )


def _begun(make: Make) -> Any:
    policy = make()
    policy.reset(LIMITS)
    return policy


def _decisions(policy: Any, seen: tuple[Observation, ...]) -> list[Decision]:
    """One flight's decisions; every replan brings the same way anew, as an obstinate planner would."""
    policy.reset(LIMITS)
    policy.planned(seen[0].trajectory, seen[0].field)
    made = []
    for observation in seen:
        made.append(policy.decide(observation))
        if made[-1].replan:
            policy.planned(observation.trajectory, observation.field)
    return made


def _keep_same(have: list[Decision], want: list[Decision], where: str) -> None:
    for observation, one, other in zip(_seen(), have, want, strict=True):
        keep(
            same(one, other),
            f"at {observation.time_s:.1f} s it decides {_told(one)} {where}, {_told(other)} otherwise",
        )


def _told(decision: Decision) -> str:
    verdict = f"replan because of {decision.cause}" if decision.replan else "no replan"
    return f"{verdict} (score {decision.score:.3g})"


def decides_at_every_update(make: Make) -> None:
    """A decision with a finite score; a cause when it replans and none when it does not."""
    for observation, decision in zip(_seen(), _decisions(make(), _seen()), strict=True):
        at = f"at {observation.time_s:.1f} s"
        keep(isinstance(decision, Decision), f"{at} it returns {type(decision).__name__}")
        keep(np.isfinite(decision.score), f"{at} the score is {decision.score}")
        keep(bool(decision.cause) == decision.replan, f"{at} no replan has the cause {decision.cause!r}")


def asks_for_nothing_before_there_is_a_plan(make: Make) -> None:
    """There is nothing to replan, whatever the map says."""
    blocked = replace(observe(room(_PILLAR), time_s=0.5, best=goal_at(3.0)), trajectory=None)
    decision = _begun(make).decide(blocked)
    keep(not decision.replan, f"it decides {_told(decision)} before the first plan")


def forgets_the_last_trial_at_a_reset(make: Make) -> None:
    """The second flight of one object is the first of another."""
    policy, first = make(), _decisions(make(), _seen())
    _decisions(policy, _seen())
    _keep_same(_decisions(policy, _seen()), first, "in the second flight of the same object")


def copies_what_it_keeps_of_the_live_map(make: Make) -> None:
    """The map's arrays change under a plan: what is compared with later was copied."""
    apart, policy, live = _begun(make), _begun(make), _seen()[0].field.copy()
    apart.planned(_FLOWN, _seen()[0].field)
    policy.planned(_FLOWN, live)
    have, want = [], []
    for observation in _seen():
        live.distance[:], live.state[:] = observation.field.distance, observation.field.state
        have.append(policy.decide(replace(observation, field=live)))
        want.append(apart.decide(observation))
    _keep_same(have, want, "on a map that changes in place")


def decides_the_same_wherever_the_world_stands(make: Make) -> None:
    """A hall that stands elsewhere is the same hall."""
    here = _decisions(make(), _seen())
    there = _decisions(make(), tuple(map(_shifted, _seen())))
    for observation, one, other in zip(_seen(), here, there, strict=True):
        keep(
            (one.replan, one.cause) == (other.replan, other.cause) and abs(one.score - other.score) <= _SCORE,
            f"at {observation.time_s:.1f} s it decides {_told(one)} here, {_told(other)} elsewhere",
        )


def _shifted(seen: Observation) -> Observation:
    """The same, `_SHIFT_M` away."""
    coefficients = _FLOWN.coefficients.copy()
    coefficients[:, 0] += _SHIFT_M
    return replace(
        seen,
        state=replace(seen.state, position_m=seen.state.position_m + _SHIFT_M),
        reference=replace(seen.reference, position_m=seen.reference.position_m + _SHIFT_M),
        field=replace(seen.field, origin_m=seen.field.origin_m + _SHIFT_M),
        trajectory=replace(_FLOWN, coefficients=coefficients),
        goal=_shifted_goal(seen.goal),
        best_goal=_shifted_goal(seen.best_goal),
        flight_bounds_m=seen.flight_bounds_m + _SHIFT_M,
    )


def _shifted_goal(goal: Goal | None) -> Goal | None:
    return None if goal is None else replace(goal, position_m=goal.position_m + _SHIFT_M)


def writes_into_nothing_it_is_given(make: Make) -> None:
    """Map, plan and observation are the trial's own."""
    policy = _begun(make)
    with untouched(trajectory=_FLOWN, field=_seen()[0].field):
        policy.planned(_FLOWN, _seen()[0].field)
    for observation in _seen():
        with untouched(observation=observation):
            policy.decide(observation)
