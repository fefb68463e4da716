"""What a new plan gains, each part against its own formula."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from uavexp.check.hall import FLOWN, LIMITS, STRAIGHT, goal_at, observe, room
from uavexp.field import DistanceField
from uavexp.trajectory import Trajectory
from uavexp.trigger.gain import Gain, chance_of_stop, places_aside
from uavexp.types import Goal, Observation

RADIUS_M = LIMITS.body_radius_m
STOP_S = 2.0 * LIMITS.max_speed_mps / LIMITS.max_acceleration_mps2
FREE = room()
BESIDE = ((2.5, 2.4, 1.0), (2.7, 2.6, 1.2))  # 0.35 m off the line, met at t = 3 to 3.2 s
DOOR = (((2.5, 0.0, 0.0), (2.7, 1.7, 2.0)), ((2.5, 2.4, 0.0), (2.7, 4.0, 2.0)))  # 0.35 m on both sides
ACROSS = ((2.5, 0.0, 0.0), (2.7, 4.0, 2.0))


def score_s(seen: Observation, at_plan: DistanceField = FREE, **values: float) -> float:
    """The gain of one check on a plan just made, s."""
    policy = Gain(cost_s=1.0, **values)
    policy.reset(LIMITS)
    policy.planned(FLOWN, at_plan)
    return policy.decide(seen).score


def cause(seen: Observation, **values: float) -> str:
    policy = Gain(**values)
    policy.reset(LIMITS)
    policy.planned(FLOWN, FREE)
    return policy.decide(seen).cause


def goal(x: float, y: float = 2.05) -> Goal:
    return replace(goal_at(x), position_m=np.array([x, y, 1.05]))


class TestChanceOfAStop:
    def test_is_none_at_the_safe_clearance_and_one_at_the_body(self) -> None:
        clearance_m = np.array([0.9, 0.75, 0.5 * (0.75 + RADIUS_M), RADIUS_M, 0.0])
        np.testing.assert_allclose(chance_of_stop(clearance_m, 0.75, RADIUS_M), [0.0, 0.0, 1 / 16, 1.0, 1.0])

    def test_is_a_chance_also_for_a_body_as_large_as_what_is_held_for_safe(self) -> None:
        clearance_m = np.linspace(-0.1, 1.0, 12)
        for safe_m in (RADIUS_M, 0.5 * RADIUS_M):
            chance = chance_of_stop(clearance_m, safe_m, RADIUS_M)
            assert (chance[clearance_m >= safe_m] == 0.0).all()
            assert (chance[clearance_m <= safe_m - 0.01] == 1.0).all()

    def test_places_aside_lie_level_across_the_way(self) -> None:
        way = places_aside(np.array([[1.0, 2.0, 1.0]]), np.array([[0.0, 2.0, 0.5]]), 0.4)[0]
        np.testing.assert_allclose(way[:, 1:], [[2.0, 1.0]] * 9)
        np.testing.assert_allclose(way[:, 0], np.linspace(1.4, 0.6, 9))


class TestRisk:
    def test_is_the_chance_of_a_stop_that_a_step_aside_would_spare_times_its_cost(self) -> None:
        now = room(BESIDE)
        line_m = np.column_stack([1.0 + 0.05 * np.arange(31), np.full(31, 2.05), np.full(31, 1.05)])
        chance = chance_of_stop(now.distance_m(line_m), 0.75, RADIUS_M)
        most_m = np.max(
            [now.distance_m(line_m + np.array([0.0, y, 0.0])) for y in np.linspace(-0.5, 0.5, 11)], axis=0
        )
        spared = (chance - chance_of_stop(most_m, 0.75, RADIUS_M)).max()
        assert spared > 0.2
        assert score_s(observe(now), horizon_s=1.5) == pytest.approx(STOP_S * spared, rel=1e-6)

    def test_what_the_plan_was_made_with_asks_for_nothing(self) -> None:
        assert score_s(observe(room(BESIDE)), at_plan=room(BESIDE), horizon_s=1.5) == 0.0

    def test_a_door_that_no_step_aside_makes_wider_asks_for_nothing(self) -> None:
        door, pillar = (score_s(observe(room(*boxes)), horizon_s=1.5) for boxes in (DOOR, [BESIDE]))
        assert door < 0.1 * pillar

    def test_what_lies_beyond_the_horizon_waits(self) -> None:
        # 1.5 m ahead at 1 m/s; exposed from 0.65 m before it on
        assert score_s(observe(room(BESIDE)), horizon_s=0.5) == 0.0
        assert score_s(observe(room(ACROSS)), horizon_s=0.5) == 0.0

    def test_what_comes_to_touch_is_avoided_whole(self) -> None:
        assert score_s(observe(room(ACROSS)), horizon_s=1.5) == pytest.approx(STOP_S)
        assert cause(observe(room(ACROSS), time_s=2.0), cost_s=0.99 * STOP_S) == "map"
        assert cause(observe(room(ACROSS), time_s=2.0), cost_s=1.01 * STOP_S) == ""

    def test_what_lies_behind_does_not_matter(self) -> None:
        assert score_s(observe(room(BESIDE), time_s=4.5)) == 0.0


class TestTime:
    def test_a_goal_further_along_the_same_way_is_merged(self) -> None:
        assert score_s(observe(FREE, time_s=2.0, goal=goal(5.5), best=goal(6.8))) == pytest.approx(0.0)

    def test_a_goal_behind_is_lost_twice_the_way_flown(self) -> None:
        behind = observe(FREE, time_s=2.0, goal=goal(5.5), best=goal(0.2))
        assert score_s(behind, horizon_s=1.2) == pytest.approx(2.4)

    def test_at_twice_the_speed_the_same_time_is_lost_behind(self) -> None:
        faster = Trajectory(
            breaks_s=STRAIGHT.breaks_s,
            coefficients=STRAIGHT.coefficients * np.array([1.0, 2.0])[None, :, None],
            at_rest=False,
        )
        policy = Gain(cost_s=1.0, horizon_s=1.2)
        policy.reset(LIMITS)
        policy.planned(faster, FREE)
        behind = observe(FREE, time_s=2.0, goal=goal(5.5), best=goal(0.2), trajectory=faster)
        assert policy.decide(behind).score == pytest.approx(2.4)

    def test_a_goal_aside_is_lost_by_the_detour(self) -> None:
        aside = observe(FREE, time_s=2.0, goal=goal(5.5), best=goal(2.5, 3.25))
        detour_m = 1.2 - (math.hypot(1.0, 1.2) - math.hypot(0.2, 1.2))
        assert score_s(aside, horizon_s=1.2) == pytest.approx(detour_m)
        assert cause(aside, cost_s=0.9 * detour_m, horizon_s=1.2) == "goal"
        assert cause(aside, cost_s=1.1 * detour_m, horizon_s=1.2) == ""

    def test_the_stop_behind_the_plan_is_time_lost(self) -> None:
        """The last moment: the plan's end at t = 6 s comes within the horizon."""
        late = [
            score_s(observe(FREE, time_s=t, goal=goal(5.5), best=goal(6.9), trajectory=FLOWN), horizon_s=1.2)
            for t in (4.7, 5.0, 5.5, 6.0)
        ]
        assert late[0] == pytest.approx(0.0)
        assert late == sorted(late)
        assert late[-1] > 0.8

    def test_without_another_goal_no_time_is_lost(self) -> None:
        assert score_s(observe(FREE, time_s=5.9, goal=goal(5.5), best=goal(5.6))) == 0.0
        assert score_s(observe(FREE, time_s=5.9, goal=goal(5.5))) == 0.0


def test_waits_until_the_plan_is_flown() -> None:
    assert STRAIGHT.start_s == 1.0
    assert score_s(observe(room(ACROSS), time_s=0.9)) == 0.0
