"""The pilot with the real planner in small rooms: latency, continuity, failure, brake, retry."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from tests.unit.trigger.test_trigger import LIMITS, change, observe
from uavexp.braking import stopping_distance_m, with_stop
from uavexp.check.fields import box, empty, field_from
from uavexp.explorer.target_only import TargetOnly
from uavexp.field import DistanceField
from uavexp.pilot.base import Crew
from uavexp.pilot.holding import Holding
from uavexp.pilot.holding_pilot import HoldingPilot
from uavexp.planner.min_acc import MinAcc
from uavexp.recorder import Stopwatch
from uavexp.safety.brake import Brake
from uavexp.safety.none import NoBrake
from uavexp.trajectory import Trajectory, evaluate, hover_before
from uavexp.trigger.mcr import Mcr
from uavexp.trigger.ssp import Ssp
from uavexp.trigger.tbr import Tbr
from uavexp.types import Goal, Observation, PlanStatus, Reference, State

START, TARGET = np.array([1.0, 2.0, 1.0]), np.array([9.0, 2.0, 1.0])
BOUNDS = np.array([[0.0, 0.0, 0.0], [10.0, 4.0, 2.0]])


def room(*, walled: bool = False) -> DistanceField:
    grid = empty((10.0, 4.0, 2.0))
    if walled:
        box(grid, (6.0, 0.0, 0.0), (6.2, 4.0, 2.0))
    return field_from(grid)


def make(
    trigger: Tbr | Ssp | Mcr, safety: NoBrake | Brake | None = None, latency_s: float = 0.03
) -> HoldingPilot:
    planner, explorer, safety = MinAcc(), TargetOnly(), safety or NoBrake()
    planner.reset(LIMITS, np.random.default_rng(0))
    explorer.reset(1.0, LIMITS)
    trigger.reset(LIMITS)
    crew = Crew(
        explorer=explorer,
        trigger=trigger,
        planner=planner,
        guard=safety.begin(LIMITS),
        limits=LIMITS,
        watch=Stopwatch(),
        latency_s=latency_s,
        start_m=START,
        start_yaw_rad=0.0,
        flight_bounds_m=BOUNDS,
    )
    return Holding(settle_s=0.0).begin(crew)


def see(field: DistanceField, time_s: float, reference: Reference) -> Observation:
    """The vehicle is exactly where the reference is."""
    state = State(
        position_m=reference.position_m,
        velocity_mps=reference.velocity_mps,
        quaternion_wxyz=np.array([1.0, 0.0, 0.0, 0.0]),
        body_rate_radps=np.zeros(3),
    )
    seen = observe(field, change(field, field), time_s=time_s)
    return replace(seen, state=state, reference=reference, target_m=TARGET, flight_bounds_m=BOUNDS)


def fly(pilot: HoldingPilot, fields: dict[float, DistanceField], until_s: float) -> np.ndarray:
    """References (N, 3) every 10 ms; the map changes at the given times."""
    positions = []
    for step in range(round(until_s / 0.01)):
        time_s = step * 0.01
        field = fields[max(t for t in fields if t <= time_s)]
        reference = pilot.reference(time_s, 0.01)
        seen = replace(see(field, time_s, reference), trajectory=pilot.trajectory)
        if step % 20 == 0:
            pilot.explore(seen)
        if step % 10 == 0:
            pilot.decide(replace(seen, best_goal=pilot.best_goal, goal=pilot.goal))
        positions.append(reference.position_m)
    return np.array(positions)


def speeds(positions: np.ndarray) -> np.ndarray:
    return np.linalg.norm(np.diff(positions, axis=0), axis=1) / 0.01


def test_a_plan_takes_effect_after_the_latency_and_not_before() -> None:
    pilot = make(Ssp())
    positions = fly(pilot, {0.0: room()}, 6.0)
    np.testing.assert_allclose(positions[:4], np.broadcast_to(START, (4, 3)), atol=1e-12)
    assert pilot.trajectory is not None
    assert pilot.trajectory.start_s == pytest.approx(0.03)
    np.testing.assert_allclose(positions[-1], TARGET, atol=1e-6)


def test_replans_join_without_a_jump_in_position_or_speed() -> None:
    pilot = make(Tbr(interval_s=0.5))
    positions = fly(pilot, {0.0: room()}, 6.0)
    assert len(pilot.replans) > 5
    assert np.abs(np.diff(speeds(positions))).max() <= 2.5 * 0.01 * 1.05
    np.testing.assert_allclose(positions[-1], TARGET, atol=1e-3)


def test_without_a_plan_it_brakes_within_the_stopping_distance_holds_and_goes_on_when_it_can() -> None:
    pilot = make(Tbr(interval_s=1.0))
    positions = fly(pilot, {0.0: room(), 1.95: room(walled=True), 6.0: room()}, 12.0)
    failed = next(replan for replan in pilot.replans if replan.status is not PlanStatus.OK)
    at_failure = round(failed.time_s / 0.01)
    stop_m = stopping_distance_m(float(speeds(positions)[at_failure]), LIMITS)
    held = positions[590]
    assert np.linalg.norm(held - positions[at_failure]) <= stop_m * 1.1 + 0.15
    np.testing.assert_allclose(positions[500:595], np.broadcast_to(held, (95, 3)), atol=1e-9)
    assert any(replan.cause == "retry" and replan.status is PlanStatus.OK for replan in pilot.replans)
    np.testing.assert_allclose(positions[-1], TARGET, atol=1e-3)
    assert pilot.failure == ""


def test_failed_requests_are_bounded_by_the_explorers_rate() -> None:
    pilot = make(Ssp())
    fly(pilot, {0.0: room(walled=True)}, 10.0)
    assert not pilot.ever_planned
    assert pilot.failure
    assert 1 <= len(pilot.replans) <= 51


def test_safety_stops_before_the_wall_that_single_shot_would_fly_into() -> None:
    for safety, stops in ((NoBrake(), False), (Brake(stop_at_unknown=False), True)):
        pilot = make(Ssp(), safety)
        positions = fly(pilot, {0.0: room(), 1.5: room(walled=True)}, 8.0)
        assert bool(positions[:, 0].max() < 6.0 - LIMITS.body_radius_m) is stops


def test_a_plan_in_flight_does_not_undo_the_brake() -> None:
    """It used to be adopted after the brake had fired, and flew on through the wall."""
    pilot = make(Tbr(interval_s=2.0), Brake(stop_at_unknown=False), latency_s=0.2)
    positions = fly(pilot, {0.0: room(), 2.05: room(walled=True)}, 8.0)
    assert positions[:, 0].max() < 6.0 - LIMITS.body_radius_m


def test_after_a_failure_every_policy_gets_the_same_number_of_tries() -> None:
    tries = set()
    for trigger in (Tbr(interval_s=1.0), Mcr()):
        pilot = make(trigger)
        fly(pilot, {0.0: room(), 1.95: room(walled=True)}, 6.0)
        tries.add(sum(replan.time_s > 3.0 for replan in pilot.replans))
    assert len(tries) == 1


def test_a_moving_end_is_followed_by_a_stop() -> None:
    moving = Trajectory(
        breaks_s=np.array([0.0, 2.0]),
        coefficients=np.array([[[0.0, 0.0, 1.0], [1.5, 0.0, 0.0]]]),
        at_rest=False,
    )
    flown = with_stop(moving, LIMITS)
    position, velocity, acceleration = evaluate(flown, np.linspace(0.0, flown.end_s, 2001))
    assert np.abs(np.diff(velocity[:, 0])).max() < 0.01
    assert np.linalg.norm(velocity[-1]) < 1e-9
    assert np.abs(acceleration).max() <= 2.5 + 1e-9
    assert position[-1, 0] == pytest.approx(3.0 + stopping_distance_m(1.5, LIMITS), abs=1e-6)
    assert with_stop(flown, LIMITS) is flown


@pytest.mark.parametrize("yaw_rad", [0.5, 2.0, -3.0])
def test_from_standstill_it_looks_before_it_flies(yaw_rad: float) -> None:
    """It used to leave sideways into space the camera had never seen."""
    pilot = make(Ssp())
    pilot.steering.yaw_rad = yaw_rad
    moving_m = []
    for step in range(600):
        time_s = step * 0.01
        reference = pilot.reference(time_s, 0.01)
        seen = replace(see(room(), time_s, reference), trajectory=pilot.trajectory)
        if step % 20 == 0:
            pilot.explore(seen)
        if np.linalg.norm(reference.position_m - START) > 1e-6:
            moving_m.append(abs(reference.yaw_rad))  # the way is along x
    assert moving_m[0] <= 0.6 + 1.8 * 0.02
    assert pilot.trajectory is not None
    waited_s = max(0.0, abs(yaw_rad) - 0.6) / 1.8
    moves_s = 6.0 - 0.01 * len(moving_m)
    assert moves_s == pytest.approx(0.03 + waited_s, abs=0.03)
    np.testing.assert_allclose(pilot.reference(9.0, 0.01).position_m, TARGET, atol=1e-6)


def test_a_hover_before_a_flight_shifts_it_and_nothing_else() -> None:
    pilot = make(Ssp())
    fly(pilot, {0.0: room()}, 0.1)
    flown = pilot.trajectory
    assert flown is not None
    later = hover_before(flown, 0.7)
    times_s = np.linspace(flown.start_s, flown.end_s, 50)
    for before, after in zip(evaluate(flown, times_s), evaluate(later, times_s + 0.7), strict=True):
        np.testing.assert_allclose(after, before, atol=1e-9)
    np.testing.assert_allclose(evaluate(later, np.array([flown.start_s + 0.3]))[0][0], START)
    assert later.start_s == flown.start_s
    assert hover_before(flown, 0.0) is flown
    assert hover_before(flown, 2.5e-16) is flown, "it would end when it begins"


@pytest.mark.parametrize("trigger", [Ssp(), Mcr(), Tbr(interval_s=100.0)], ids=["ssp", "mcr", "tbr"])
def test_a_vehicle_left_behind_stops_its_reference_and_plans_from_where_it_is(
    trigger: Ssp | Mcr | Tbr,
) -> None:
    """Whatever holds it, and whatever the policy."""
    pilot, field, held_m = make(trigger), room(), START + np.array([0.5, 0.1, 0.0])
    fly(pilot, {0.0: field}, 0.1)
    for step in range(10, 400):
        reference = pilot.reference(step * 0.01, 0.01)
        away_m = float(np.linalg.norm(reference.position_m - held_m))
        seen = replace(see(field, step * 0.01, reference), trajectory=pilot.trajectory)
        seen = replace(seen, state=replace(seen.state, position_m=held_m, velocity_mps=np.zeros(3)))
        if step % 10 == 0:
            pilot.decide(seen)
        if pilot.replans[-1].cause == "noted":
            break
    assert 0.12 <= away_m < 0.4 + 2.5 * 0.1
    assert pilot.replans[-1].status is PlanStatus.OK
    next_m = [pilot.reference((step + 1 + k) * 0.01, 0.01).position_m for k in range(5)]
    assert np.linalg.norm(np.array(next_m) - held_m, axis=1).max() < 0.01
    assert pilot.trajectory is not None
    np.testing.assert_allclose(evaluate(pilot.trajectory, np.array([0.0]))[0][0], held_m, atol=1e-9)


def test_told_not_to_recover_it_flies_its_one_plan_on_whatever_holds_it() -> None:
    """Paper 1's single shot: no plan but the first, and the reference goes to its end."""
    pilot, field, held_m = make(Ssp()), room(), START + np.array([0.5, 0.1, 0.0])
    pilot.rules = replace(pilot.rules, recovers=False)
    fly(pilot, {0.0: field}, 0.1)
    for step in range(10, 3000):
        reference = pilot.reference(step * 0.01, 0.01)
        seen = replace(see(field, step * 0.01, reference), trajectory=pilot.trajectory)
        seen = replace(seen, state=replace(seen.state, position_m=held_m, velocity_mps=np.zeros(3)))
        if step % 10 == 0:
            pilot.decide(seen)
            pilot.explore(seen)
    assert [replan.cause for replan in pilot.replans] == ["first"]
    np.testing.assert_allclose(reference.position_m, TARGET, atol=1e-6)


class _Hesitant(TargetOnly):
    """Keeps a goal off the target until a plan asks for the best one."""

    def select(self, observation: Observation, *, fresh: bool = False) -> Goal | None:
        place_m = TARGET if fresh else TARGET - np.array([3.0, 0.0, 0.0])
        return Goal(position_m=place_m, is_target=fresh, score=0.0)


@pytest.mark.parametrize("fresh_goal", [True, False])
def test_a_request_takes_the_best_goal_or_the_kept_one_as_it_is_told(fresh_goal: bool) -> None:
    pilot = make(Ssp())
    pilot.rules = Holding(settle_s=0.0, fresh_goal=fresh_goal)
    pilot.crew = replace(pilot.crew, explorer=_Hesitant())
    pilot.explore(see(room(), 0.0, pilot.reference(0.0, 0.01)))
    expected = TARGET if fresh_goal else TARGET - np.array([3.0, 0.0, 0.0])
    assert np.allclose(pilot.replans[0].goal_m, expected)


@dataclass(slots=True)
class AlwaysThere:
    """An explorer that offers the same place for ever; `rejected` counts refusals."""

    place_m: np.ndarray
    rejected: int = 0

    def select(self, observation: Observation, *, fresh: bool = False) -> Goal | None:
        return Goal(position_m=self.place_m, is_target=False, score=0.0)

    def reject(self, position_m: np.ndarray, time_s: float) -> None:
        self.rejected += 1


def test_a_vehicle_that_stands_at_the_end_of_its_plan_asks_for_a_way_to_the_goal_that_is_left() -> None:
    """A map-change trigger never asks: the goal is the one it flew to, which is set aside."""
    pilot = make(Mcr())
    explorer = AlwaysThere(np.array([3.0, 2.0, 1.0]))
    pilot.crew = replace(pilot.crew, explorer=explorer)
    fly(pilot, {0.0: room()}, 16.0)
    held = [replan.time_s for replan in pilot.replans if replan.cause == "held"]
    assert len(held) >= 2
    assert held[0] >= 2.0 * pilot.rules.recover_after_s
    assert explorer.rejected >= 1
