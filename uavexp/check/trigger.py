"""What every replanning policy promises, on a flight along a hall whose map changes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from uavexp.check.hall import FLOWN, LIMITS, PILLAR, elsewhere, flight, goal_at, observe, room
from uavexp.check.promise import Make, keep, same, untouched
from uavexp.types import Decision, Observation

_SCORE = 1e-6  # by which the score may differ where the world stands elsewhere


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
    for observation, one, other in zip(flight(), have, want, strict=True):
        keep(
            same(one, other),
            f"at {observation.time_s:.1f} s it decides {_told(one)} {where}, {_told(other)} otherwise",
        )


def _told(decision: Decision) -> str:
    verdict = f"replan because of {decision.cause}" if decision.replan else "no replan"
    return f"{verdict} (score {decision.score:.3g})"


def decides_at_every_update(make: Make) -> None:
    """A decision with a finite score; a cause when it replans and none when it does not."""
    for observation, decision in zip(flight(), _decisions(make(), flight()), strict=True):
        at = f"at {observation.time_s:.1f} s"
        keep(isinstance(decision, Decision), f"{at} it returns {type(decision).__name__}")
        keep(np.isfinite(decision.score), f"{at} the score is {decision.score}")
        keep(bool(decision.cause) == decision.replan, f"{at} no replan has the cause {decision.cause!r}")


def asks_for_nothing_before_there_is_a_plan(make: Make) -> None:
    """There is nothing to replan, whatever the map says."""
    blocked = replace(observe(room(PILLAR), time_s=0.5, best=goal_at(3.0)), trajectory=None)
    decision = _begun(make).decide(blocked)
    keep(not decision.replan, f"it decides {_told(decision)} before the first plan")


def forgets_the_last_trial_at_a_reset(make: Make) -> None:
    """The second flight of one object is the first of another."""
    policy, first = make(), _decisions(make(), flight())
    _decisions(policy, flight())
    _keep_same(_decisions(policy, flight()), first, "in the second flight of the same object")


def copies_what_it_keeps_of_the_live_map(make: Make) -> None:
    """The map's arrays change under a plan: what is compared with later was copied."""
    apart, policy, first = _begun(make), _begun(make), flight()[0].field
    distance, state = first.distance.copy(), first.state.copy()
    live = replace(first, distance=distance, state=state)
    apart.planned(FLOWN, first)
    policy.planned(FLOWN, live)
    have, want = [], []
    for observation in flight():
        distance[:], state[:] = observation.field.distance, observation.field.state
        have.append(policy.decide(replace(observation, field=live)))
        want.append(apart.decide(observation))
    _keep_same(have, want, "on a map that changes in place")


def decides_the_same_wherever_the_world_stands(make: Make) -> None:
    """A hall that stands elsewhere is the same hall."""
    here = _decisions(make(), flight())
    there = _decisions(make(), tuple(map(elsewhere, flight())))
    for observation, one, other in zip(flight(), here, there, strict=True):
        keep(
            (one.replan, one.cause) == (other.replan, other.cause) and abs(one.score - other.score) <= _SCORE,
            f"at {observation.time_s:.1f} s it decides {_told(one)} here, {_told(other)} elsewhere",
        )


def writes_into_nothing_it_is_given(make: Make) -> None:
    """Map, plan and observation are the trial's own."""
    policy = _begun(make)
    with untouched(trajectory=FLOWN, field=flight()[0].field):
        policy.planned(FLOWN, flight()[0].field)
    for observation in flight():
        with untouched(observation=observation):
            policy.decide(observation)
