"""Places that movers come to are told from those that stay free; the vehicle steps out of their way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.inspections import START_M, building
from tests.unit.mission.test_inspect_mission import begun, seen_at, state
from tests.unit.trigger.test_trigger import LIMITS
from uavexp.arrays import Float
from uavexp.mission import give_way
from uavexp.planner.movers.moving import turns_s
from uavexp.trajectory import Trajectory
from uavexp.types import Observation, Tracks

HALL = building()  # 6 m by 4 m, a partition at x = 3 m for y < 2.6 m
KEEP_M = LIMITS.body_radius_m + 0.5
HALF_M = np.array([0.25, 0.25, 0.85])


def walking(*movers: tuple[Float, Float]) -> Tracks:
    """People at places and velocities on the floor, (x, y) each."""
    count = len(movers)
    return Tracks(
        time_s=0.0,
        identity=np.arange(count),
        position_m=np.array([[*place, HALF_M[2]] for place, _ in movers]).reshape(-1, 3),
        velocity_mps=np.array([[*velocity, 0.0] for _, velocity in movers]).reshape(-1, 3),
        covariance=np.zeros((count, 6, 6)),
        half_size_m=np.tile(HALF_M, (count, 1)),
    )


def room_m(tracks: Tracks, place_m: Float, from_m: Float, *, way: bool = False) -> float:
    turns = turns_s(tracks, HALL.field, give_way.HORIZON_S)
    return float(give_way.rooms_m(tracks, turns, from_m, place_m[None], LIMITS, way)[0])


def test_a_mover_turns_where_its_way_meets_a_wall() -> None:
    tracks = walking(([1.5, 2.0], [1.0, 0.0]), ([1.5, 2.0], [0.0, 0.3]), ([0.45, 2.0], [0.5, 0.0]))
    turns = turns_s(tracks, HALL.field, give_way.HORIZON_S)
    # the partition's face at x = 3 m, less the body's half width and the margin, 1.1 m away
    assert turns[0] == pytest.approx(1.1, abs=give_way.STEP_S + 0.06)
    assert np.isinf(turns[1:]).all()  # the second comes to none, the third walks away from one


def test_a_place_on_a_movers_way_is_not_free_and_one_beside_it_is() -> None:
    tracks = walking(([0.8, 3.5], [1.0, 0.0]))
    ahead, beside = np.array([2.0, 3.5, 1.2]), np.array([2.0, 1.0, 1.2])
    assert room_m(tracks, ahead, ahead) < 0.0
    assert room_m(tracks, beside, beside) > KEEP_M


def test_a_place_that_is_reached_only_after_the_horizon_counts_as_free() -> None:
    tracks = walking(([5.4, 3.5], [0.0, 0.0]))
    assert np.isinf(room_m(tracks, np.array([5.4, 3.5, 1.2]), np.array([0.5, 3.5, 1.2])))


def test_behind_the_turn_a_mover_may_be_anywhere_its_speed_takes_it() -> None:
    tracks = walking(([2.3, 1.0], [1.0, 0.0]))
    behind = np.array([1.2, 1.0, 1.2])
    turn_s = turns_s(tracks, HALL.field, give_way.HORIZON_S)[0]
    straight = give_way.rooms_m(tracks, np.array([np.inf]), behind, behind[None], LIMITS, way=False)[0]
    assert straight == pytest.approx(2.3 - 1.2 - HALF_M[0], abs=0.01)  # it only goes away
    left_s = give_way.HORIZON_S - turn_s
    assert room_m(tracks, behind, behind) == pytest.approx(
        straight + turn_s - 1.0 * left_s - 0.1 * give_way.HORIZON_S, abs=0.15
    )


def test_the_step_aside_leaves_the_movers_way() -> None:
    tracks = walking(([0.6, 1.0], [0.8, 0.0]))
    here = np.array([1.8, 1.1, 1.2])
    grid = np.stack(np.meshgrid(np.arange(0.5, 2.6, 0.2), np.arange(0.5, 3.6, 0.2), [1.2]), axis=-1)
    aside = give_way.aside_m(tracks, HALL.field, here, grid.reshape(-1, 3), KEEP_M, LIMITS)
    assert room_m(tracks, aside, here) > max(room_m(tracks, here, here), 0.0) + 0.5
    assert np.linalg.norm(aside - here) <= 2.5
    nobody = give_way.aside_m(Tracks.none(), HALL.field, here, grid.reshape(-1, 3), KEEP_M, LIMITS)
    np.testing.assert_array_equal(nobody, here)


def among(tracks: Tracks, time_s: float, here_m: Float) -> Observation:
    return replace(seen_at(time_s, state(here_m)), tracks=replace(tracks, time_s=time_s))


def test_a_step_aside_that_is_under_way_is_not_changed_for_one_hardly_better() -> None:
    tracks, here = walking(([1.0, 2.0], [0.8, 0.0])), np.array([2.2, 2.0, 1.2])
    sides = np.array([[2.2, 3.2, 1.2], [2.2, 0.82, 1.2]])
    chosen = [
        give_way.aside_m(tracks, HALL.field, here, sides, KEEP_M, LIMITS, under_way).round(2).tolist()
        for under_way in (None, *sides)
    ]
    assert chosen[1:] == sides.tolist()
    assert chosen[0] in sides.tolist()


def test_staying_is_staying_where_the_vehicle_is_meant_to_be() -> None:
    """A hold at where the vehicle finds itself would run away with its error."""
    _, guide = begun(rounds=0)
    guide.reset(1.2, LIMITS)
    far = walking((np.array([5.4, 3.5]), np.zeros(2)))
    here = START_M + np.array([0.0, 0.0, 0.4])
    for error_m in ([0.1, -0.05, 0.08], [-0.1, 0.1, 0.0], [0.0, 0.0, 0.2]):
        seen = among(far, 0.0, here + np.array(error_m))
        seen = replace(seen, reference=replace(seen.reference, position_m=here))
        np.testing.assert_array_equal(guide._place_m(0, seen, lambda _: False), here)


def test_over_the_head_of_who_comes_is_a_place_to_step_aside_to() -> None:
    _, guide = begun(rounds=0)
    corner = np.array([0.45, 0.45, 1.2])
    tracks = walking(([1.2, 1.2], [-0.6, -0.6]))
    places = guide._refuges_m(among(tracks, 0.0, corner))
    cornered = places[(np.abs(places[:, :2] - corner[:2]) < 0.4).all(axis=1)]
    aside = give_way.aside_m(tracks, HALL.field, corner, cornered, KEEP_M, LIMITS)
    assert aside[2] == pytest.approx(HALL.flight_bounds_m[1, 2])


def test_a_stop_to_which_somebody_comes_waits_and_then_others_come_first() -> None:
    _, guide = begun(rounds=0)
    guide.reset(1.2, LIMITS)
    first = int(guide.plan.order[0])
    place = guide.plan.viewpoints.position_m[first]
    there = walking((place[:2], np.array([0.0, 0.0])))
    at_once = guide.select(among(there, 0.0, place))
    assert at_once is not None
    assert np.linalg.norm(at_once.position_m[:2] - place[:2]) > KEEP_M  # aside
    later = guide.select(among(there, 10.0, START_M + np.array([0.0, 0.0, 0.9])))
    assert later is not None
    assert not np.array_equal(later.position_m, place)
    gone = guide.select(among(Tracks.none(), 10.2, place))
    assert gone is not None
    assert not guide.finished
    assert np.isinf(guide.visited_s[first])  # put behind, not given up


def test_a_stop_at_which_somebody_stays_is_given_up_after_waiting_twice() -> None:
    _, guide = begun(rounds=0, patience_s=5.0)
    guide.reset(1.2, LIMITS)
    stops, order = guide.plan.viewpoints, guide.plan.order
    for stop in order[:-1]:
        guide.reject(stops.position_m[stop], 0.0)
        guide.reject(stops.position_m[stop], 0.0)
    last_m = stops.position_m[order[-1]]
    there = walking((last_m[:2], np.array([0.0, 0.0])))
    aside_m, waited_s = last_m + np.array([0.0, 1.0, 0.0]), 0.0
    while not guide.finished and waited_s < 60.0:
        guide.select(among(there, waited_s, aside_m))
        waited_s += 1.0 / guide.rate_hz
    assert waited_s == pytest.approx(2 * 5.0, abs=1.0)
    assert np.isinf(guide.visited_s[order[-1]])


def test_what_is_flown_is_judged_with_the_hold_at_its_end() -> None:
    tracks = walking(([0.8, 3.5], [1.0, 0.0]))
    turns = turns_s(tracks, HALL.field, give_way.HORIZON_S)
    for y_m in (3.5, 2.5, 1.0):
        place = np.array([2.0, y_m, 1.2])
        hold = Trajectory(breaks_s=np.array([0.0, 0.3]), coefficients=place[None, None], at_rest=True)
        stay_m = room_m(tracks, place, place)
        assert give_way.room_along_m(tracks, turns, hold, 0.0) == pytest.approx(stay_m, abs=0.02)
    assert give_way.room_along_m(tracks, turns, hold, 5.0) == pytest.approx(stay_m, abs=0.02)  # held on
