"""When a mission is over, and when its time is up; what share of the reachable volume was seen."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from tests.unit.trigger.test_trigger import LIMITS, change, goal_at, observe, room
from uavexp.field import DistanceField
from uavexp.mission.base import Flown
from uavexp.mission.explore import Explore
from uavexp.mission.goto import Goto
from uavexp.recorder import Recorder
from uavexp.scene import Scene
from uavexp.seen_share import reachable_m, seen_share, seen_so_far
from uavexp.types import Bodies, Observation, Outcome, Reference, State, World
from uavexp.world.random_columns import RandomColumns


@pytest.fixture(scope="module")
def hall() -> World:
    return RandomColumns(size_m=(8.0, 6.0, 3.0), density_per_m2=0.1).generate(np.random.default_rng(0))


def at(time_s: float, *, goal: bool = True) -> Observation:
    field = room()
    return observe(field, change(field, field), time_s=time_s, best=goal_at(1.0) if goal else None)


def flown(times_s: Sequence[float], position_m: Sequence[np.ndarray] | np.ndarray) -> Flown:
    upright = np.tile([1.0, 0.0, 0.0, 0.0], (len(times_s), 1))
    return Flown(np.array(times_s), np.array(position_m), upright, np.array(position_m))


def test_reached_is_within_the_tolerance_in_truth(hall: World) -> None:
    mission = Goto(tolerance_m=0.3)
    mission.reset(hall, Scene(hall), LIMITS)
    direction = np.array([0.6, 0.0, 0.8])
    places_m = hall.target_m + np.array([[0.302], [0.301], [0.299], [0.1]]) * direction
    assert mission.outcome(flown([1.0, 1.01, 1.02, 1.03], places_m), at(1.0)) == (2, Outcome.REACHED)
    assert mission.outcome(flown([1.0, 1.01], places_m[:2]), at(1.0)) is None
    assert mission.time_limit_s == pytest.approx(60.0 + 5.0 * hall.difficulty.shortest_path_m)


@pytest.mark.parametrize(("arrival", "step"), [("truth", 2), ("belief", 0)])
def test_reached_is_judged_in_the_frame_that_is_asked_for(hall: World, arrival: str, step: int) -> None:
    mission = Goto(arrival=arrival)
    mission.reset(hall, Scene(hall), LIMITS)
    way = flown([1.0, 1.01, 1.02], hall.target_m + np.array([[0.5], [0.4], [0.0]]))
    way = way._replace(estimated_position_m=way.position_m - [0.4, 0.4, 0.4])
    assert mission.outcome(way, at(1.0)) == (step, Outcome.REACHED)


def test_explored_is_no_goal_for_the_patience(hall: World) -> None:
    mission = Explore(patience_s=2.0)
    mission.reset(hall, Scene(hall), LIMITS)
    assert mission.target_m is None
    position = hall.start_m
    for begin_s in np.arange(0.0, 4.6, 0.2):
        two_s = [begin_s, begin_s + 0.1]
        assert mission.outcome(flown(two_s, [position] * 2), at(begin_s, goal=begin_s < 3.0)) is None
    assert mission.outcome(flown([4.6, 4.8, 4.95, 5.0], [position] * 4), at(4.6, goal=False)) == (
        2,
        Outcome.EXPLORED,
    )


def test_standing_still_is_measured_over_the_whole_window() -> None:
    recorder = Recorder(1001, 0.01)
    zero = np.zeros(3)
    reference = Reference(position_m=zero, velocity_mps=zero, acceleration_mps2=zero, yaw_rad=0.0)
    state = State(
        position_m=zero, velocity_mps=zero, quaternion_wxyz=np.array([1.0, 0, 0, 0]), body_rate_radps=zero
    )
    for step in range(1001):
        moved = replace(state, position_m=np.array([min(step, 500) * 0.01, 0.0, 0.0]))
        recorder.step(step, moved, moved, reference, Bodies.none())
        if step < 400:
            assert math.isinf(recorder.moved_m(step, 400))
    assert recorder.moved_m(1000, 400) == 0.0
    assert recorder.moved_m(1000, 700) == pytest.approx(2.0)
    assert recorder.moved_m(500, 400) == pytest.approx(4.0)


@pytest.mark.parametrize(("seen", "share"), [(0, 0.0), (1, 1.0)])
def test_seen_share_is_nothing_or_all(hall: World, seen: int, share: float) -> None:
    shape = tuple(int(n) for n in np.ceil((hall.bounds_m[1] - hall.bounds_m[0]) / 0.1))
    field = DistanceField(
        origin_m=hall.bounds_m[0],
        voxel_size_m=0.1,
        max_distance_m=2.0,
        distance=np.full(shape, 2.0, dtype=np.float32),
        state=np.full(shape, seen, dtype=np.uint8),
    )
    cells_m = reachable_m(hall, Scene(hall), LIMITS)
    assert seen_share(field, cells_m) == share
    voxels = np.flatnonzero(field.state).astype(np.int32)
    halves = [voxels[::2], voxels[1::2], voxels[:0]]
    so_far = seen_so_far(field, cells_m, halves)
    assert so_far[-1] == so_far[1] == share
    assert so_far[0] <= share
    nothing_m = reachable_m(hall, Scene(hall), replace(LIMITS, body_size_m=(90.0, 90.0, 0.12)))
    assert nothing_m.shape == (0, 3)
    assert np.isnan(seen_share(field, nothing_m))
    assert np.isnan(seen_so_far(field, nothing_m, halves)).all()


def test_a_flight_at_one_height_has_a_reachable_volume(hall: World) -> None:
    low, high = hall.flight_bounds_m
    at_m = hall.start_m[2]
    level = replace(hall, flight_bounds_m=np.array([[*low[:2], at_m - 0.01], [*high[:2], at_m + 0.01]]))
    cells_m = reachable_m(level, Scene(level), LIMITS)
    assert len(cells_m) > 0
    np.testing.assert_allclose(cells_m[:, 2], at_m)


def test_home_is_flown_to_when_nothing_is_left_and_ends_the_mission(hall: World) -> None:
    mission = Explore(patience_s=2.0, return_home=True)
    mission.reset(hall, Scene(hall), LIMITS)
    away = hall.start_m + np.array([3.0, 0.0, 0.0])
    assert mission.home_m is None
    assert mission.outcome(flown([3.0, 3.1], [away] * 2), at(3.0, goal=False)) is None
    assert mission.home_m is not None
    np.testing.assert_array_equal(mission.home_m, hall.start_m)
    assert mission.outcome(flown([3.2, 3.3], [away] * 2), at(3.2)) is None
    near = hall.start_m + np.array([0.2, 0.0, 0.0])
    assert mission.outcome(flown([3.4, 3.5], [away, near]), at(3.4)) == (1, Outcome.EXPLORED)
    assert mission.target_m is None


def test_a_home_that_cannot_be_reached_ends_the_mission_after_the_patience(hall: World) -> None:
    mission = Explore(patience_s=2.0, return_home=True)
    mission.reset(hall, Scene(hall), LIMITS)
    away = hall.start_m + np.array([3.0, 0.0, 0.0])
    assert mission.outcome(flown([3.0], [away]), at(3.0, goal=False)) is None
    assert mission.outcome(flown([4.9, 5.1], [away] * 2), at(4.9, goal=False)) == (1, Outcome.EXPLORED)
