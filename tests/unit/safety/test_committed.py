"""Committed stops: against closed forms, and against an oracle that looks at every voxel of the body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.unit.pilot.test_holding import BOUNDS, START, TARGET, see
from uavexp.check.fields import box, empty, field_from
from uavexp.check.hall import LIMITS, hovering, observe
from uavexp.explorer.target_only import TargetOnly
from uavexp.field import DistanceField
from uavexp.pace import Pace, evaluate_paced
from uavexp.pilot.base import Crew
from uavexp.pilot.holding import Holding
from uavexp.pilot.holding_pilot import HoldingPilot
from uavexp.planner.min_acc import MinAcc
from uavexp.recorder import Stopwatch
from uavexp.safety.base import Flyable
from uavexp.safety.committed import Committed
from uavexp.trajectory import Trajectory
from uavexp.trigger.mcr import Mcr
from uavexp.trigger.ssp import Ssp
from uavexp.trigger.tbr import Tbr
from uavexp.types import PlanStatus, Reference

SIZE_M = (10.0, 4.0, 2.0)
RULES = Committed()
PLANNED = (1.0, 0.0)  # the rate of a plan that is flown as it is


def hall(*, seen_to_m: float = 10.0, walls: tuple[tuple[float, float], ...] = ()) -> DistanceField:
    """A hall seen up to some x, with walls across (from y, to y) at x = 6 m."""
    grid, unknown = empty(SIZE_M), empty(SIZE_M)
    for low, high in walls:
        box(grid, (6.0, low, 0.0), (6.2, high, 2.0))
    unknown[round(seen_to_m * 10) :] = True
    return field_from(grid, unknown=unknown)


def straight(speed_mps: float, from_m: float = 1.0, to_m: float = 9.0, y_m: float = 2.05) -> Trajectory:
    """Along x at a constant speed, from t = 0; what it does at its end is not asked for."""
    return Trajectory(
        breaks_s=np.array([0.0, (to_m - from_m) / speed_mps]),
        coefficients=np.array([[[from_m, y_m, 1.05], [speed_mps, 0.0, 0.0]]]),
        at_rest=False,
    )


def asked(plan: Trajectory, field: DistanceField, rules: Committed = RULES, error_m: float = 0.0) -> Flyable:
    """How it may be flown from its start on."""
    start_m = plan.coefficients[0, 0]
    reference = Reference(
        position_m=start_m, velocity_mps=plan.coefficients[0, 1], acceleration_mps2=np.zeros(3), yaw_rad=0.0
    )
    seen = replace(observe(field, time_s=0.0), reference=reference)
    state = hovering(start_m + np.array([0.0, error_m, 0.0]))
    seen = replace(seen, state=replace(state, velocity_mps=reference.velocity_mps))
    return rules.begin(LIMITS).flyable(plan, 0.0, PLANNED, seen)


def flown(plan: Trajectory, pace: Pace, times_s: np.ndarray) -> tuple[np.ndarray, ...]:
    return evaluate_paced(plan.breaks_s, plan.coefficients, (pace.times_s, pace.own_s, pace.rate), times_s)[
        1:
    ]


def is_verified(field: DistanceField, point_m: np.ndarray) -> bool:
    """By looking at all voxels of the map, one after the other in numpy."""
    centre_m = field.voxel_centres_m(np.arange(field.state.size))
    apart_m = np.abs(centre_m - point_m)
    radius_m = LIMITS.body_radius_m
    inside = np.hypot(apart_m[:, 0], apart_m[:, 1]) <= radius_m
    inside &= apart_m[:, 2] <= 0.5 * LIMITS.body_size_m[2] + 0.5 * field.voxel_size_m
    return bool((field.state.ravel()[inside] != 0).all() and field.distance_m(point_m[None])[0] >= 0.22)


def test_where_all_is_seen_and_clear_it_is_flown_as_planned() -> None:
    found = asked(straight(2.0), hall())
    assert found.refused == ""
    short = found.pace.times_s < 0.3
    np.testing.assert_allclose(found.pace.rate[short], 1.0)
    np.testing.assert_allclose(found.pace.own_s[short], found.pace.times_s[short])


def test_a_plan_may_begin_and_end_at_any_time() -> None:
    field, guard = hall(), RULES.begin(LIMITS)
    seen = replace(observe(field, time_s=0.0), state=hovering(np.array([1.0, 2.05, 1.05])))
    for start_s in np.arange(0.0, 60.0, 0.1):  # the last sample of some is their end, but for rounding
        plan = straight(2.0, to_m=1.6)
        plan = replace(plan, breaks_s=start_s + plan.breaks_s)
        for now_s in (*np.arange(start_s, plan.end_s, 0.02), np.nextafter(plan.end_s, 0.0)):
            pace = guard.flyable(plan, float(now_s), PLANNED, seen).pace
            assert np.isfinite(pace.times_s).all()
            assert (np.diff(pace.own_s) > 0.0).all()


@pytest.mark.parametrize("seen_to_m", [2.0, 3.0, 4.0])
def test_it_rests_before_what_was_not_seen_from_no_more_than_can_be_stopped(seen_to_m: float) -> None:
    plan = straight(1.2)
    pace = asked(plan, hall(seen_to_m=seen_to_m)).pace
    at_m, velocity, acceleration, _ = flown(plan, pace, np.linspace(0.0, pace.rests_s, 400))
    speed, left_m = velocity[:, 0], at_m[-1, 0] - at_m[:, 0]
    furthest_m = seen_to_m - LIMITS.body_radius_m
    assert furthest_m - RULES.spare_m - 0.1 - 0.03 <= at_m[-1, 0] <= furthest_m - RULES.spare_m + 0.1
    assert speed[-1] == 0.0
    assert (np.diff(speed) <= 5e-3).all()
    comfort = RULES.comfort_share * LIMITS.max_acceleration_mps2
    assert np.abs(acceleration[:, 0]).max() <= 1.02 * comfort
    assert (speed**2 <= 2.0 * comfort * left_m + 0.02).all()


def test_the_acceleration_turns_no_faster_than_it_may() -> None:
    plan = straight(1.5)
    pace = asked(plan, hall(seen_to_m=4.0)).pace
    times_s = np.linspace(0.0, pace.rests_s - 0.4, 400)
    _, _, acceleration, jerk = flown(plan, pace, times_s)
    most = RULES.turn_share * 9.81 * LIMITS.max_body_rate_radps
    assert np.abs(np.gradient(acceleration[:, 0], times_s)).max() <= 1.3 * most
    assert np.abs(jerk[:, 0]).max() <= 1.3 * most


def weaving(jerk_mps3: float) -> Trajectory:
    """At 1.5 m/s along x, swaying in y for 4 s with this jerk to and fro, 0.1 s each."""
    signs, lasts_s = np.tile([1.0, -1.0, -1.0, 1.0], 10), 0.1
    y = np.array([2.05, 0.0, 0.0])  # place, speed, acceleration
    rows = np.zeros((40, 4, 3))
    for n, jerk in enumerate(signs * jerk_mps3):
        rows[n, 0] = 1.0 + 1.5 * lasts_s * n, y[0], 1.05
        rows[n, 1] = 1.5, y[1], 0.0
        rows[n, 2:, 1] = y[2] / 2.0, jerk / 6.0
        y = np.array(
            [
                y[0] + lasts_s * (y[1] + lasts_s * (y[2] / 2.0 + lasts_s * jerk / 6.0)),
                y[1] + lasts_s * (y[2] + lasts_s * jerk / 2.0),
                y[2] + lasts_s * jerk,
            ]
        )
    return Trajectory(breaks_s=np.arange(41) * lasts_s, coefficients=rows, at_rest=False)


def test_where_a_plan_turns_the_thrust_too_fast_it_is_flown_slower() -> None:
    """Jerk goes with the third power of the rate; what turns it gently enough keeps its pace."""
    most = RULES.plan_turn_share * 9.81 * LIMITS.max_body_rate_radps
    for share, rate in ((0.9, 1.0), (1.6, 1.6 ** (-1.0 / 3.0))):
        pace = asked(weaving(share * most), hall()).pace
        soon = (pace.own_s > 0.6) & (pace.own_s < 0.9)
        np.testing.assert_allclose(pace.rate[soon], rate, atol=0.01)


def test_a_plan_that_could_not_be_stopped_is_refused_and_a_slower_one_is_not() -> None:
    field = hall(seen_to_m=2.0)  # 0.77 m of way
    assert "2.40 m/s" in asked(straight(2.4), field).refused
    fastest = np.sqrt(2.0 * LIMITS.max_acceleration_mps2 * (1.0 - LIMITS.body_radius_m - RULES.spare_m))
    assert asked(straight(1.15 * fastest), field).refused
    assert not asked(straight(0.85 * fastest), field).refused


def test_a_wall_that_shows_too_late_is_stopped_before_as_hard_as_may_be() -> None:
    plan = straight(2.0, from_m=5.1)
    found = asked(plan, hall(walls=((0.0, 4.0),)))
    assert found.refused
    at_m, _, acceleration, _ = flown(plan, found.pace, np.linspace(0.0, found.pace.rests_s, 200))
    assert at_m[-1, 0] - 5.1 == pytest.approx(2.0**2 / (2.0 * LIMITS.max_acceleration_mps2), abs=0.06)
    assert acceleration[:, 0].min() == pytest.approx(-LIMITS.max_acceleration_mps2, rel=0.02)


def test_a_narrow_place_is_flown_slowly_and_no_narrower_one_at_all() -> None:
    middle_m, rules = 2.05, Committed(margin_m=0.05)
    for gap_m, passes in ((1.0, True), (0.5, True), (0.3, False)):
        walls = ((0.0, middle_m - 0.5 * gap_m), (middle_m + 0.5 * gap_m, 4.0))
        field = hall(walls=walls)
        plan = straight(1.5, from_m=4.0, y_m=middle_m)
        pace = asked(plan, field, rules).pace
        at_m, velocity, _, _ = flown(plan, pace, np.linspace(0.0, min(pace.rests_s, 4.0), 400))
        assert (at_m[:, 0].max() > 6.3) == passes
        clearance_m = field.distance_m(at_m)
        narrow = clearance_m < LIMITS.body_radius_m + rules.margin_m
        assert narrow.any() == (gap_m == 0.5)
        assert velocity[narrow, 0].max(initial=0.0) <= 1.15 * rules.narrow_speed_mps
        assert clearance_m.min() >= 0.21


def test_a_place_whose_surroundings_were_not_seen_is_left_slowly_once_its_middle_was() -> None:
    grid, unknown = empty(SIZE_M), empty(SIZE_M)
    unknown[:12, :] = True
    unknown[8:12, 19:22, 9:12] = False  # seen where the centre passes
    plan = straight(1.0, from_m=0.95)
    rest = replace(plan, coefficients=plan.coefficients * np.array([[[1.0], [0.0]]]))
    starts = Trajectory(
        breaks_s=np.array([0.0, 2.0]),
        coefficients=np.array([[[0.95, 2.05, 1.05], [0.0] * 3, [0.5, 0.0, 0.0]]]),
        at_rest=False,
    )
    assert asked(rest, field_from(grid, unknown=unknown)).refused == ""
    pace = asked(starts, field_from(grid, unknown=unknown)).pace
    at_m, velocity, _, _ = flown(starts, pace, np.linspace(0.0, 3.0, 300))
    among = at_m[:, 0] < 1.2 + LIMITS.body_radius_m - 0.15
    assert velocity[among, 0].max() <= RULES.creep_mps * 1.2
    assert at_m[-1, 0] > 1.6
    unknown[8:12] = True
    pace = asked(starts, field_from(grid, unknown=unknown)).pace
    assert flown(starts, pace, np.array([3.0]))[0][0, 0] <= 0.96, "nor was its middle"


def test_time_runs_slower_for_a_vehicle_that_is_not_where_it_should_be() -> None:
    rates = [
        float(asked(straight(1.0), hall(), error_m=share * RULES.stop_error_m).pace.at(2.0)[1])
        for share in (0.4, 0.75, 1.1)
    ]
    assert rates[0] == 1.0
    assert 0.4 < rates[1] < 0.6
    assert rates[2] == 0.0


def flies(
    trigger: Ssp | Mcr | Tbr, until_s: float, sees_m: float
) -> tuple[HoldingPilot, np.ndarray, list[bool]]:
    """References of a flight along a hall with a door, of which the vehicle sees so far ahead."""
    planner, explorer = MinAcc(), TargetOnly()
    planner.reset(LIMITS, np.random.default_rng(0))
    explorer.reset(1.0, LIMITS)
    trigger.reset(LIMITS)
    crew = Crew(
        explorer=explorer, trigger=trigger, planner=planner, guard=RULES.begin(LIMITS), limits=LIMITS,
        watch=Stopwatch(), latency_s=0.03, start_m=START, start_yaw_rad=0.0, flight_bounds_m=BOUNDS,
    )  # fmt: skip
    pilot, furthest_m, at_m, verified = Holding(settle_s=0.0).begin(crew), 1.6, [], []
    walls = ((0.0, 2.4), (3.8, 4.0))
    field = hall(seen_to_m=furthest_m, walls=walls)
    for step in range(round(until_s / 0.01)):
        reference = pilot.reference(step * 0.01, 0.01)
        if step % 10 == 0:
            furthest_m = max(furthest_m, float(reference.position_m[0]) + sees_m)
            field = hall(seen_to_m=round(min(furthest_m, 10.0), 1), walls=walls if furthest_m > 6.0 else ())
            seen = replace(see(field, step * 0.01, reference), trajectory=pilot.trajectory)
            if step % 20 == 0:
                pilot.explore(seen)
            pilot.decide(replace(seen, best_goal=pilot.best_goal, goal=pilot.goal))
            verified.append(is_verified(field, reference.position_m))
        at_m.append(reference.position_m)
    return pilot, np.array(at_m), verified


@pytest.mark.parametrize("trigger", [Mcr(), Tbr(interval_s=0.5), Ssp()], ids=["mcr", "tbr", "ssp"])
def test_no_reference_is_in_a_place_that_was_not_verified(trigger: Ssp | Mcr | Tbr) -> None:
    """Whatever the policy, and though the wall shows a metre ahead, through a plan that goes through it."""
    pilot, at_m, verified = flies(trigger, 24.0, sees_m=1.0)
    assert all(verified)
    np.testing.assert_allclose(at_m[-1], TARGET, atol=0.05)
    steps_m = np.linalg.norm(np.diff(at_m, axis=0), axis=1)
    assert steps_m.max() <= LIMITS.max_speed_mps * 0.01
    assert np.abs(np.diff(steps_m)).max() <= 1.3 * LIMITS.max_acceleration_mps2 * 0.01**2
    assert pilot.failure == ""


def test_who_is_held_asks_for_another_plan_and_then_for_another_goal() -> None:
    """A sensor that never shows what is ahead."""
    pilot, at_m, verified = flies(Ssp(), 6.0, sees_m=0.3)
    assert all(verified)
    assert at_m[-1, 0] < 1.6
    held = [one for one in pilot.replans if one.cause == "held"]
    assert held[0].time_s > 0.6
    assert len(pilot.replans) > len(held) >= 1
    assert any(one.status is not PlanStatus.OK for one in pilot.replans) or pilot.failure or len(held) > 1


def smooth(from_m: float, to_m: float, lasts_s: float) -> Trajectory:
    """Along x from rest to rest, with continuous acceleration."""
    way_m = to_m - from_m
    rows = np.zeros((6, 3))
    rows[0] = from_m, 2.05, 1.05
    rows[3:, 0] = 10.0 * way_m / lasts_s**3, -15.0 * way_m / lasts_s**4, 6.0 * way_m / lasts_s**5
    return Trajectory(breaks_s=np.array([0.0, lasts_s]), coefficients=rows[None], at_rest=True)


def peak_jerk_mps3(plan: Trajectory, pace: Pace, from_s: float, to_s: float) -> float:
    times_s = np.linspace(from_s, to_s, 400)
    acceleration = flown(plan, pace, times_s)[2]
    return float(np.abs(np.gradient(acceleration[:, 0], times_s)).max())


def test_a_short_way_that_is_seen_is_begun_no_faster_than_it_can_be_left() -> None:
    """Half a metre of six: begun as planned it would brake as hard at once, and the vehicle not follow."""
    plan, field = smooth(1.0, 7.0, 4.0), hall(seen_to_m=1.6)
    pace = asked(plan, field).pace
    at_m, _, acceleration, _ = flown(plan, pace, np.linspace(0.0, pace.rests_s - 0.2, 600))
    assert 1.15 < at_m[-1, 0] < 1.6
    assert np.abs(acceleration).max() < 0.3 * LIMITS.max_acceleration_mps2
    assert peak_jerk_mps3(plan, pace, 0.0, pace.rests_s - 0.2) < 0.6 * 9.81 * LIMITS.max_body_rate_radps


def test_a_flight_that_was_slowed_catches_up_without_a_jolt_as_the_plan_s_rate_is_there() -> None:
    plan, rules = straight(2.0), RULES
    seen = observe(hall(), time_s=0.0)
    reference = replace(seen.reference, position_m=np.array([1.0, 2.05, 1.05]), velocity_mps=np.zeros(3))
    seen = replace(seen, reference=reference, state=hovering(reference.position_m))
    pace = rules.begin(LIMITS).flyable(plan, 0.0, (0.6, 0.0), seen).pace
    most = rules.turn_share * 9.81 * LIMITS.max_body_rate_radps
    there_s = pace.times_s[int(np.argmax(pace.rate))]
    assert pace.rate.max() > 0.95
    assert there_s > 0.5
    assert peak_jerk_mps3(plan, pace, 0.05, there_s) <= 4.0 * most  # 9 where it ends at once


def test_an_error_slows_the_more_the_less_room_the_body_has() -> None:
    walls = ((0.0, 1.75), (2.35, 4.0))  # 0.3 m beside the way, from 6 m on
    for error_m, wide, narrow in ((0.0, 1.0, 1.0), (0.1, 1.0, 0.6), (0.2, 0.4, 0.0)):
        plan = straight(0.5, from_m=5.9)
        for field, rate in ((hall(), wide), (hall(walls=walls), narrow)):
            pace = asked(plan, field, error_m=error_m).pace
            slowest = pace.rate[pace.times_s < 1.5].min()
            assert slowest <= rate + 0.05
            assert rate < 1.0 or slowest > 0.95
