"""Thresholds that adapt: each of speed, visibility and recent change alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from uavexp.arrays import Bool
from uavexp.check.fields import empty
from uavexp.check.hall import FLOWN, LIMITS, goal_at, observe, room
from uavexp.field import DistanceField
from uavexp.trigger.mcr_adaptive import McrAdaptive
from uavexp.types import Observation

FREE = room()
TICK_S = 0.1


def moving(field: DistanceField, time_s: float, speed_mps: float = 1.0, **seen: object) -> Observation:
    found = observe(field, time_s=time_s, **seen)
    return replace(found, reference=replace(found.reference, velocity_mps=np.array([speed_mps, 0.0, 0.0])))


def beside(x_m: float, gap_m: float) -> DistanceField:
    """A pillar whose face is so far off the line."""
    return room(((x_m, 2.05 + gap_m, 0.0), (x_m + 0.2, 2.65 + gap_m, 2.0)))


def score(
    field: DistanceField, speed_mps: float = 1.0, at_plan: DistanceField = FREE, time_s: float = 2.0
) -> float:
    """Of the second of two checks; at the first nothing has changed."""
    policy = McrAdaptive()
    policy.reset(LIMITS)
    policy.planned(FLOWN, at_plan)
    policy.decide(moving(at_plan, time_s - TICK_S, speed_mps))
    return policy.decide(moving(field, time_s, speed_mps)).score


def seen_to(x_m: float) -> Bool:
    unknown = empty((7.0, 4.0, 2.0))
    unknown[round(10 * x_m) :] = True
    return unknown


@pytest.mark.parametrize("speed_mps", [0.5, 1.25, 2.5])
def test_looks_as_far_as_a_stop_and_an_answer_take(speed_mps: float) -> None:
    horizon_s = speed_mps / LIMITS.max_acceleration_mps2 + TICK_S
    near_m, far_m = 0.5 + horizon_s - 0.05, 0.5 + horizon_s + 0.75  # the line is flown at 1 m/s
    assert score(beside(1.0 + near_m, 0.15), speed_mps) > 1.0
    assert score(beside(1.0 + far_m, 0.15), speed_mps) == 0.0


def test_a_plan_may_lose_half_of_its_room() -> None:
    """The hall keeps the line at 0.75 m or more; its places may lose half of that less the radius."""
    may_m = 0.5 * (0.75 - LIMITS.body_radius_m)
    for gap_m in (0.4, 0.5, 0.65):
        now = beside(1.55, gap_m)
        lost_m = 0.75 - now.distance_m(np.array([[x, 2.05, 1.05] for x in np.arange(1.5, 2.0, 0.05)])).min()
        change = 1.0 <= score(now) / (lost_m / may_m) <= 2.0
        assert change, gap_m
    assert score(beside(1.55, 0.65)) < 1.0 < score(beside(1.55, 0.35))


def test_a_plan_through_a_door_may_lose_less_than_one_in_the_open() -> None:
    door, narrower = beside(1.6, 0.45), beside(1.6, 0.35)
    assert score(narrower, at_plan=door) > 0.5 * score(beside(1.6, 0.65))
    assert score(door, at_plan=door) == 0.0


def test_out_of_sight_it_may_lose_less() -> None:
    pillar = ((1.6, 2.55, 0.0), (1.8, 3.0, 2.0))
    speed_mps, horizon_s = 2.5, 1.1
    scores = [
        score(room(pillar, unknown=seen_to(x)), speed_mps, at_plan=room(unknown=seen_to(x)))
        for x in (6.9, 2.05)  # the second 0.55 s ahead, at 1 m/s
    ]
    assert scores[1] / scores[0] == pytest.approx(horizon_s / 0.55, rel=0.1)


def test_while_walls_grow_it_may_lose_less() -> None:
    """A wall that was there at the check before counts for less than one that comes now."""
    policy, seen = McrAdaptive(), beside(1.6, 0.5)
    policy.reset(LIMITS)
    policy.planned(FLOWN, FREE)
    policy.decide(moving(FREE, 1.9))
    scores = [policy.decide(moving(seen, 2.0)).score, policy.decide(moving(seen, 2.1)).score]
    scores.append(policy.decide(moving(seen, 2.2)).score)
    assert scores[0] > scores[1] > scores[2] > 0.0


def test_replans_for_another_goal_and_not_for_the_same() -> None:
    for best_m, expected in ((5.5, ""), (5.6, ""), (5.9, "goal")):
        policy = McrAdaptive()
        policy.reset(LIMITS)
        policy.planned(FLOWN, FREE)
        policy.decide(moving(FREE, 1.9))
        seen = moving(FREE, 2.0, goal=goal_at(5.5), best=goal_at(best_m))
        assert policy.decide(seen).cause == expected
