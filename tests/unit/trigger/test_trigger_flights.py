"""What the shipped policies make of a real flight, and of space that only became freer."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import uavexp
from tests.components import build
from tests.logs import changed
from uavexp.braking import with_stop
from uavexp.check.hall import LIMITS, STRAIGHT, goal_at, observe, room
from uavexp.log import TrialLog
from uavexp.metrics.replanning import answers
from uavexp.types import Outcome, PlanStatus

REPLANNING = (
    "any_of",
    "collision_check",
    "distance",
    "expiry",
    "frontier_covered",
    "gain",
    "mcr",
    "mcr_adaptive",
    "tbr",
)
COLLISION_ONLY = (
    "collision_check",
    "expiry",
    "frontier_covered",
)  # they look for nothing else that changes
ONCE = ("risk", "ssp")  # risk looks at movers alone, and none are there


def flown(trigger: str, **more: Any) -> TrialLog:
    """A short flight among columns; the body counts as blocked by what is nearer than its radius."""
    trial = uavexp.fly(
        **{
            "trigger": trigger,
            "world": "random_columns",
            "world.size_m": [10.0, 7.0, 3.0],
            "world.density_per_m2": 0.3,
            "seed": 7,
            "stuck_s": 6.0,
        }
        | more
    )
    return changed(trial.log, body_radius_m=LIMITS.body_radius_m)


@pytest.mark.parametrize("trigger", REPLANNING)
def test_arrives(trigger: str) -> None:
    log = flown(trigger)
    assert log.outcome is Outcome.REACHED
    planned_s = min(one.effective_s for one in log.replans if one.status is PlanStatus.OK)
    assert np.isnan(log.ticks.remaining_clearance_m[log.ticks.tick_s < planned_s - 1e-6]).all()
    assert np.isfinite(log.ticks.remaining_clearance_m[log.ticks.tick_s >= planned_s][:5]).all()
    found = answers(log)
    if trigger in COLLISION_ONLY:
        assert found.unanswered == found.cleared == 0
        assert found.delay_s == 0.0 or found.episodes == 0


@pytest.mark.parametrize("trigger", ONCE)
def test_a_single_plan_stays_blocked(trigger: str) -> None:
    found = answers(flown(trigger, explorer="target_only"))
    assert np.isnan(found.delay_s)
    assert found.unanswered + found.cleared == found.episodes > 0


@pytest.mark.parametrize("trigger", [*REPLANNING, *ONCE])
def test_space_that_only_became_freer_is_no_reason(trigger: str) -> None:
    policy = build("trigger", trigger)
    policy.reset(LIMITS)
    policy.planned(with_stop(STRAIGHT, LIMITS), room(((3.0, 2.5, 0.0), (3.2, 2.7, 2.0))))
    assert not policy.decide(observe(room(), goal=goal_at(5.5), best=goal_at(5.5))).replan
