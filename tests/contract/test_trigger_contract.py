"""What every replanning policy keeps; options are found by glob."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import uavexp
from tests.components import build, check_yaml, numbers, options
from uavexp.braking import with_stop
from uavexp.check.fields import empty
from uavexp.check.hall import LIMITS, STRAIGHT, change, goal_at, observe, room
from uavexp.errors import ConfigError
from uavexp.field import DistanceField
from uavexp.metrics.replanning import CAUSES, blocked_delays
from uavexp.trajectory import Trajectory
from uavexp.types import Decision, Observation, Outcome, PlanStatus

pytestmark = pytest.mark.parametrize("option", options("trigger"))

FLOWN = with_stop(STRAIGHT, LIMITS)
SHIFT_M = np.array([3.7, -2.2, 0.5])
PILLAR = ((4.0, 2.0, 0.0), (4.2, 2.2, 2.0))


def maps() -> Iterator[DistanceField]:
    """The hall at 10 Hz: unknown recedes, at t = 2.5 s a pillar shows on the line, at 4 s it is gone."""
    for tick in range(60):
        unknown = empty((7.0, 4.0, 2.0))
        unknown[30 + tick :] = True
        yield room(*([PILLAR] if 15 <= tick < 30 else []), unknown=unknown)


def seen() -> Iterator[Observation]:
    """What a flight along the line sees from t = 1 s on; the best goal drifts away at t = 5 s."""
    fields = list(maps())
    for tick, (before, now) in enumerate(pairwise([fields[0], *fields])):
        best = goal_at(5.5 if tick < 40 else 4.9)
        time_s = 1.0 + 0.1 * tick
        yield observe(now, change(before, now), time_s, goal_at(5.5), best, FLOWN)


SEEN = tuple(seen())


def shifted(item: Any) -> Any:
    """The same, `SHIFT_M` away."""
    if isinstance(item, DistanceField):
        return replace(item, origin_m=item.origin_m + SHIFT_M)
    if isinstance(item, Trajectory):
        coefficients = item.coefficients.copy()
        coefficients[:, 0] += SHIFT_M
        return replace(item, coefficients=coefficients)
    if isinstance(item, Observation):
        goals = {
            name: replace(goal, position_m=goal.position_m + SHIFT_M)
            for name in ("goal", "best_goal")
            if (goal := getattr(item, name)) is not None
        }
        return replace(item, field=shifted(item.field), trajectory=shifted(FLOWN), **goals)
    raise TypeError(item)


def decisions(policy: Any, seen: tuple[Observation, ...] = SEEN) -> list[Decision]:
    """One flight's decisions; every replan brings the same way anew, as an obstinate planner would."""
    policy.reset(LIMITS)
    policy.planned(seen[0].trajectory, seen[0].field)
    made = []
    for observation in seen:
        made.append(policy.decide(observation))
        if made[-1].replan:
            policy.planned(observation.trajectory, observation.field)
    return made


def told(made: list[Decision]) -> list[tuple[bool, str, float]]:
    """Decisions as plain values."""
    return [(one.replan, one.cause, round(one.score, 6)) for one in made]


def test_yaml_lists_every_parameter(option: str) -> None:
    check_yaml("trigger", option)


def test_without_a_plan_there_is_nothing_to_replan(option: str) -> None:
    policy = build("trigger", option)
    policy.reset(LIMITS)
    blocked = observe(room(PILLAR), time_s=0.5, goal=None, best=goal_at(3.0))
    assert not policy.decide(replace(blocked, trajectory=None)).replan


def test_a_replan_names_a_known_cause_and_no_replan_names_none(option: str) -> None:
    for decision in decisions(build("trigger", option)):
        assert decision.cause in CAUSES if decision.replan else decision.cause == ""
        assert np.isfinite(decision.score)


def test_reset_forgets_the_last_trial(option: str) -> None:
    policy = build("trigger", option)
    first = told(decisions(policy))
    assert told(decisions(policy)) == first == told(decisions(build("trigger", option)))
    policy.reset(LIMITS)
    assert not policy.decide(observe(room(PILLAR), time_s=0.5)).replan


def test_the_live_map_may_change_under_a_plan(option: str) -> None:
    """The map's arrays are its own: what a policy compares with later it must have copied."""
    apart = build("trigger", option)
    apart.reset(LIMITS)
    apart.planned(FLOWN, SEEN[0].field)
    live = SEEN[0].field.copy()
    policy = build("trigger", option)
    policy.reset(LIMITS)
    policy.planned(FLOWN, live)
    for observation in SEEN[:30]:
        live.distance[:], live.state[:] = observation.field.distance, observation.field.state
        now = policy.decide(replace(observation, field=live))
        assert told([now]) == told([apart.decide(observation)])


def test_decisions_do_not_depend_on_where_the_world_stands(option: str) -> None:
    there = decisions(build("trigger", option), tuple(map(shifted, SEEN)))
    assert told(there) == told(decisions(build("trigger", option)))


def test_space_that_only_became_freer_is_no_reason(option: str) -> None:
    policy = build("trigger", option)
    policy.reset(LIMITS)
    policy.planned(FLOWN, room(((3.0, 2.5, 0.0), (3.2, 2.7, 2.0))))
    assert not policy.decide(observe(room(), goal=goal_at(5.5), best=goal_at(5.5))).replan


@pytest.mark.parametrize("value", [-1.0, float("nan"), float("inf")])
def test_refuses_bad_numbers(option: str, value: float) -> None:
    for name in numbers(build("trigger", option)):
        with pytest.raises(ConfigError, match=rf"{name} must .*got"):
            build("trigger", option, **{name: value})


def test_flies(option: str) -> None:
    """A real flight, and what its log tells of blocked trajectories."""
    once = option in ("ssp", "risk")  # risk looks at movers alone, and none are there
    trial = uavexp.fly(
        **{
            "trigger": option,
            "explorer": "target_only" if once else "frontier",
            "world": "random_columns",
            "world.size_m": [10.0, 7.0, 3.0],
            "world.density_per_m2": 0.3,
            "seed": 7,
            "stuck_s": 6.0,
        }
    )
    log = replace(trial.log, body_radius_m=LIMITS.body_radius_m)
    planned_s = min(one.effective_s for one in log.replans if one.status is PlanStatus.OK)
    assert len(log.remaining_clearance_m) == len(log.tick_s)
    assert np.isnan(log.remaining_clearance_m[log.tick_s < planned_s - 1e-6]).all()
    assert np.isfinite(log.remaining_clearance_m[log.tick_s >= planned_s][:5]).all()
    delays = blocked_delays(log)
    if once:
        assert np.isnan(delays["blocked_delay_s"])
        assert delays["blocked_unanswered"] + delays["blocked_cleared"] == delays["blocked_episodes"] > 0
        return
    assert trial.log.outcome is Outcome.REACHED
    if option in ("collision_check", "expiry", "frontier_covered"):  # they look for nothing else
        assert delays["blocked_unanswered"] == delays["blocked_cleared"] == 0
        assert delays["blocked_delay_s"] == 0.0 or delays["blocked_episodes"] == 0
