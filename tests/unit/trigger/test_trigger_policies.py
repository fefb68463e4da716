"""The policies of the field, each against its own definition."""

from __future__ import annotations

import numpy as np
import pytest

from uavexp.arrays import Bool
from uavexp.braking import with_stop
from uavexp.check.fields import empty
from uavexp.check.hall import LIMITS, STRAIGHT, goal_at, observe, room
from uavexp.field import DistanceField
from uavexp.trajectory import evaluate, sample_times
from uavexp.trigger.base import TriggerPolicy
from uavexp.trigger.collision_check import CollisionCheck
from uavexp.trigger.distance import Distance
from uavexp.trigger.expiry import Expiry
from uavexp.trigger.frontier_covered import FrontierCovered
from uavexp.trigger.path_cost import place_cost
from uavexp.types import Observation

FREE = room()
FLOWN = with_stop(STRAIGHT, LIMITS)
AHEAD = room(((4.0, 2.0, 1.0), (4.2, 2.2, 1.2)))  # met at t = 4.5 s
TICKS_S = np.arange(10, 81) * 0.1
NEW = (Distance, CollisionCheck, FrontierCovered, Expiry)


def fired(policy: TriggerPolicy, observation: Observation, at_plan: DistanceField = FREE) -> str:
    """Cause of the decision on a plan just made, "" for none."""
    policy.reset(LIMITS)
    policy.planned(FLOWN, at_plan)
    return policy.decide(observation).cause


def first_s(policy: TriggerPolicy, field: DistanceField = FREE, **seen: object) -> tuple[float, str]:
    """Time and cause of the first replan at 10 Hz, without a new plan; inf and "" when there is none."""
    policy.reset(LIMITS)
    policy.planned(FLOWN, FREE)
    for time_s in TICKS_S:
        decision = policy.decide(observe(field, time_s=float(time_s), **seen))
        if decision.replan:
            return float(time_s), decision.cause
    return np.inf, ""


def bare_cover(**values: float) -> FrontierCovered:
    """Cover alone: every other event switched off."""
    return FrontierCovered(**{"min_age_s": 0.0, "period_s": 0.0, "clearance_m": 0.0, **values})


@pytest.mark.parametrize("kind", NEW)
class TestEveryOne:
    def test_replans_before_a_frontier_is_reached(self, kind: type) -> None:
        late = {"distance_m": 99.0} if kind is Distance else {}
        late |= {"period_s": 0.0} if kind is FrontierCovered else {}
        assert first_s(kind(**late), goal=goal_at(5.5)) == (pytest.approx(5.6), "arrival")
        assert first_s(kind(**late, arrival_s=1.0), goal=goal_at(5.5)) == (pytest.approx(5.1), "arrival")

    def test_does_not_replan_before_the_target(self, kind: type) -> None:
        late = {"distance_m": 99.0} if kind is Distance else {}
        late |= {"period_s": 0.0} if kind is FrontierCovered else {}
        assert first_s(kind(**late), goal=goal_at(5.5, is_target=True))[1] == ""

    def test_waits_until_the_plan_is_flown(self, kind: type) -> None:
        assert fired(kind(), observe(AHEAD, time_s=0.9, goal=goal_at(0.6), best=goal_at(3.0))) == ""


class TestDistance:
    @pytest.mark.parametrize("distance_m", [0.5, 1.0, 2.3])
    def test_replans_at_the_first_check_after_so_many_metres(self, distance_m: float) -> None:
        expected_s = 1.0 + np.ceil(10 * distance_m - 1e-6) / 10  # at 1 m/s from t = 1 s
        assert first_s(Distance(distance_m=distance_m)) == (pytest.approx(expected_s), "distance")

    def test_does_not_look_at_the_map(self) -> None:
        assert first_s(Distance(), AHEAD) == first_s(Distance(), FREE)

    def test_hovering_at_the_end_is_no_distance(self) -> None:
        length_m = 5.0 + 1.0**2 / (2 * LIMITS.max_acceleration_mps2)  # at least, stopping at the limit
        assert first_s(Distance(distance_m=length_m + 1.0))[1] == ""


class TestCollisionCheck:
    def test_replans_at_once_on_an_obstacle_ahead(self) -> None:
        assert first_s(CollisionCheck(), AHEAD) == (pytest.approx(1.0), "collision")

    def test_looks_no_further_than_its_horizon(self) -> None:
        times_s = [first_s(CollisionCheck(horizon_s=h), AHEAD)[0] for h in (0.5, 1.0, 2.0, 4.0)]
        assert times_s == sorted(times_s, reverse=True)
        # the body circle meets the box's face 0.23 m before x = 4.0 m, at t = 4.27 s
        np.testing.assert_allclose(times_s, [3.8, 3.3, 2.3, 1.0], atol=0.11)

    def test_what_lies_behind_does_not_matter(self) -> None:
        assert fired(CollisionCheck(), observe(AHEAD, time_s=5.2)) == ""

    def test_an_obstacle_in_the_stop_behind_the_goal_does(self) -> None:
        assert fired(CollisionCheck(), observe(room(((5.8, 2.0, 1.0), (6.0, 2.2, 1.2))))) == "collision"

    def test_remembers_nothing_of_the_plan(self) -> None:
        """MCR lets a plan be as near as it was made; a collision check does not."""
        assert fired(CollisionCheck(), observe(AHEAD), at_plan=AHEAD) == "collision"

    def test_fires_more_with_a_larger_clearance(self) -> None:
        beside = room(((4.0, 2.4, 1.0), (4.2, 2.6, 1.2)))  # 0.35 m off the line
        causes = [fired(CollisionCheck(clearance_m=c), observe(beside)) for c in (0.1, 0.25, 0.45, 0.6)]
        assert causes == ["", "", "collision", "collision"]

    def test_unknown_space_is_no_obstacle(self) -> None:
        assert fired(CollisionCheck(), observe(room(unknown=~empty((7.0, 4.0, 2.0))))) == ""


class TestFrontierCovered:
    @staticmethod
    def seen_to(x_m: float) -> Bool:
        """Unknown beyond x: the frontier is a plane that recedes."""
        unknown = empty((7.0, 4.0, 2.0))
        unknown[round(10 * x_m) :] = True
        return unknown

    def cause(self, policy: FrontierCovered, seen_m: float, time_s: float = 2.0) -> str:
        before = room(unknown=self.seen_to(5.0))
        observation = observe(room(unknown=self.seen_to(seen_m)), time_s=time_s, goal=goal_at(5.0))
        return fired(policy, observation, at_plan=before)

    def test_replans_when_more_than_the_share_was_seen(self) -> None:
        # half a ball of 1 m: a slab of thickness h at its flat side holds 1.5 h - 0.5 h³ of it
        for thickness_m in (0.1, 0.2, 0.4, 0.7):
            share = 1.5 * thickness_m - 0.5 * thickness_m**3
            assert self.cause(bare_cover(covered_share=share - 0.04), 5.0 + thickness_m) == "covered"
            assert self.cause(bare_cover(covered_share=share + 0.04), 5.0 + thickness_m) == ""

    def test_a_share_of_one_is_never_exceeded(self) -> None:
        assert self.cause(bare_cover(covered_share=1.0), 7.0) == ""

    def test_forgetting_what_was_seen_covers_nothing(self) -> None:
        assert self.cause(bare_cover(covered_share=0.01), 4.5) == ""

    def test_a_young_plan_is_kept(self) -> None:
        assert self.cause(bare_cover(min_age_s=0.5), 6.0, time_s=1.4) == ""
        assert self.cause(bare_cover(min_age_s=0.5), 6.0, time_s=1.5) == "covered"

    def test_the_target_is_no_frontier(self) -> None:
        before, now = room(unknown=self.seen_to(5.0)), room(unknown=self.seen_to(6.0))
        target = goal_at(5.0, is_target=True)
        assert fired(bare_cover(), observe(now, time_s=2.0, goal=target), at_plan=before) == ""

    def test_a_goal_in_known_space_cannot_be_covered(self) -> None:
        assert fired(bare_cover(), observe(FREE, time_s=2.0, goal=goal_at(5.5))) == ""

    @pytest.mark.parametrize("period_s", [0.3, 1.5, 2.0])
    def test_the_clock_is_exact_and_can_be_switched_off(self, period_s: float) -> None:
        assert first_s(FrontierCovered(period_s=period_s)) == (pytest.approx(1.0 + period_s), "clock")
        assert first_s(FrontierCovered(period_s=0.0))[1] == ""

    def test_the_collision_check_can_be_switched_off(self) -> None:
        assert fired(FrontierCovered(), observe(AHEAD)) == "collision"
        assert fired(FrontierCovered(clearance_m=0.0), observe(AHEAD)) == ""


class TestExpiry:
    @pytest.mark.parametrize("expiry_s", [0.5, 1.3, 4.0])
    def test_a_plan_expires_at_the_first_check_when_it_is_that_old(self, expiry_s: float) -> None:
        assert first_s(Expiry(expiry_s=expiry_s)) == (pytest.approx(1.0 + expiry_s), "expired")

    def test_a_new_plan_starts_the_timer_anew(self) -> None:
        policy = Expiry(expiry_s=1.0)
        policy.planned(FLOWN, FREE)
        assert policy.decide(observe(FREE, time_s=2.0)).cause == "expired"
        later = type(FLOWN)(breaks_s=FLOWN.breaks_s + 1.03, coefficients=FLOWN.coefficients, at_rest=True)
        policy.planned(later, FREE)
        causes = [policy.decide(observe(FREE, time_s=t)).cause for t in (2.1, 3.0, 3.1)]
        assert causes == ["", "", "expired"]

    def test_an_invalid_plan_is_replaced_at_once(self) -> None:
        assert first_s(Expiry(), AHEAD) == (pytest.approx(1.0), "collision")
        assert first_s(Expiry(clearance_m=0.0), AHEAD)[1] == ""

    def test_any_other_goal_counts_and_the_same_one_does_not(self) -> None:
        for best, expected in ((goal_at(5.5), ""), (goal_at(5.51), "goal"), (None, "")):
            assert fired(Expiry(), observe(FREE, goal=goal_at(5.5), best=best)) == expected
        other = observe(FREE, goal=goal_at(5.5), best=goal_at(2.0))
        assert fired(Expiry(goal_updated=False), other) == ""

    def test_near_the_target_only_a_collision_counts(self) -> None:
        target, other = goal_at(5.5, is_target=True), goal_at(2.0)
        left_m = 5.5 - 0.5 - (5.0 - 1.0)  # at 5 s, of a plan flown at 1 m/s from 1 s on
        for nearby_m, expected in ((0.0, "goal"), (left_m - 0.3, "goal"), (left_m + 1.0, "")):
            seen = observe(FREE, time_s=5.0, goal=target, best=other)
            assert fired(Expiry(nearby_m=nearby_m), seen) == expected
        frontier = observe(FREE, time_s=5.0, goal=goal_at(5.5), best=other)
        assert fired(Expiry(nearby_m=9.0), frontier) == "goal"
        blocked = observe(AHEAD, goal=target, best=other)
        assert fired(Expiry(nearby_m=9.0), blocked) == "collision"

    def test_a_path_that_has_become_dearer_is_replaced(self) -> None:
        points_m = evaluate(FLOWN, sample_times(FLOWN, 1.0, 0.05))[0]
        costs = [place_cost(field.distance_m(points_m), LIMITS.body_radius_m) for field in (FREE, AHEAD)]
        rise = costs[1].sum() / costs[0].sum() - 1.0
        assert rise > 0.1
        for share, expected in ((rise - 0.01, "cost"), (rise + 0.01, "")):
            policy = Expiry(clearance_m=0.0, cost_rise=share)
            assert fired(policy, observe(AHEAD, time_s=1.0)) == expected
            assert fired(policy, observe(AHEAD, time_s=1.0), at_plan=AHEAD) == ""
        assert fired(Expiry(clearance_m=0.0, cost_rise=0.01), observe(AHEAD, time_s=5.9)) == ""  # passed


def test_a_place_costs_as_on_nav2_s_costmap() -> None:
    radius_m = 0.2
    cost = place_cost(np.array([0.0, 0.2, 0.5, 0.699, 0.7, 3.0]), radius_m)
    inflated = 0.8 * 252.0 / 50.0 * np.exp(-3.0 * np.array([0.0, 0.0, 0.3, 0.499]))
    np.testing.assert_allclose(cost, [*(1.0 + inflated), 1.0, 1.0])
