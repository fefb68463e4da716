"""When a mission is over, and when its time is up; what share of the reachable volume was seen."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.unit.trigger.test_trigger import LIMITS, change, goal_at, observe, room
from uavexp.field import DistanceField
from uavexp.mission.explore import Explore
from uavexp.mission.goto import Goto
from uavexp.recorder import Recorder, seen_share
from uavexp.scene import Scene
from uavexp.types import Bodies, Observation, Outcome, Reference, State, World
from uavexp.world.random_columns import RandomColumns


@pytest.fixture(scope="module")
def hall() -> World:
    return RandomColumns(size_m=(8.0, 6.0, 3.0), density_per_m2=0.1).generate(np.random.default_rng(0))


def at(time_s: float, *, goal: bool = True) -> Observation:
    field = room()
    return observe(field, change(field, field), time_s=time_s, best=goal_at(1.0) if goal else None)


def hover(position_m: np.ndarray) -> State:
    zero = np.zeros(3)
    return State(
        position_m=position_m,
        velocity_mps=zero,
        quaternion_wxyz=np.array([1.0, 0.0, 0.0, 0.0]),
        body_rate_radps=zero,
    )


def test_reached_is_within_the_tolerance_in_truth(hall: World) -> None:
    mission = Goto(tolerance_m=0.3)
    mission.reset(hall, Scene(hall), LIMITS)
    direction = np.array([0.6, 0.0, 0.8])
    assert mission.outcome(hover(hall.target_m + 0.299 * direction), at(1.0)) is Outcome.REACHED
    assert mission.outcome(hover(hall.target_m + 0.301 * direction), at(1.0)) is None
    assert mission.time_limit_s == pytest.approx(60.0 + 5.0 * hall.difficulty.shortest_path_m)


def test_explored_is_no_goal_for_the_patience(hall: World) -> None:
    mission = Explore(patience_s=2.0)
    mission.reset(hall, Scene(hall), LIMITS)
    assert mission.target_m is None
    position = hall.start_m
    answers = [mission.outcome(hover(position), at(t, goal=t < 3.0)) for t in np.arange(0.0, 6.0, 0.1)]
    first = next(n for n, answer in enumerate(answers) if answer is Outcome.EXPLORED)
    assert first * 0.1 == pytest.approx(2.9 + 2.0, abs=0.11)


def test_standing_still_is_measured_over_the_whole_window() -> None:
    recorder = Recorder()
    zero = np.zeros(3)
    reference = Reference(position_m=zero, velocity_mps=zero, acceleration_mps2=zero, yaw_rad=0.0)
    state = State(
        position_m=zero, velocity_mps=zero, quaternion_wxyz=np.array([1.0, 0, 0, 0]), body_rate_radps=zero
    )
    for step in range(1001):
        moved = replace(state, position_m=np.array([min(step, 500) * 0.01, 0.0, 0.0]))
        recorder.step(step * 0.01, moved, moved, reference, Bodies.none())
        if step < 400:
            assert math.isinf(recorder.moved_m(400))
    assert recorder.moved_m(400) == 0.0
    assert recorder.moved_m(700) == pytest.approx(2.0)


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
    assert seen_share(hall, Scene(hall), field, LIMITS) == share
