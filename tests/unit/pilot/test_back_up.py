"""Backing up along what was flown, and what is noted where the vehicle stands against something."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.unit.pilot.test_holding import room
from uavexp.check.fields import box, empty, field_from
from uavexp.check.hall import LIMITS, hovering, observe
from uavexp.pilot.back_up import back_up, remembered, way_back
from uavexp.pilot.flown import stopped_off
from uavexp.pilot.heading import room_to_turn
from uavexp.pilot.touch import BALL_M, Touch, touched_m
from uavexp.trajectory import evaluate
from uavexp.types import Observation, Reference


def corridor_to(half_m: float) -> np.ndarray:
    """A hall with two walls that leave so much on each side of y = 2 m from x = 5 m on."""
    grid = empty((10.0, 4.0, 2.0))
    box(grid, (5.0, 0.0, 0.0), (9.0, 2.0 - half_m, 2.0))
    box(grid, (5.0, 2.0 + half_m, 0.0), (9.0, 4.0, 2.0))
    return grid


def test_the_way_back_ends_at_the_last_place_with_room() -> None:
    field, way = field_from(corridor_to(0.35)), np.zeros((0, 3))
    for x in np.arange(3.0, 7.0, 0.04):
        way = remembered(way, np.array([x, 2.0, 1.0]), 3.0)
    assert len(way) == 30
    steps = np.linalg.norm(np.diff(way, axis=0), axis=1)
    assert steps.min() >= 0.1
    assert steps.max() < 0.15
    here = np.array([6.98, 2.0, 1.0])
    back = way_back(way, here, field, 0.45)
    room_m = field.distance_m(back)
    assert room_m[-1] >= 0.45
    assert (room_m[1:-1] < 0.45).all()
    assert back[-1, 0] == pytest.approx(4.75, abs=0.15)
    shut = corridor_to(0.35)
    box(shut, (5.5, 0.0, 0.0), (5.7, 4.0, 2.0))
    assert len(way_back(way, here, field_from(shut), 0.45)) == 0


def test_backing_up_goes_through_these_places_from_rest_to_rest_at_its_speed() -> None:
    angle = np.linspace(0.0, 1.5, 25)
    places = np.column_stack([2.0 * np.cos(angle), 2.0 * np.sin(angle), np.ones(25)])
    flown = back_up(places, 3.0, 0.5)
    at, velocity, acceleration = evaluate(flown, np.linspace(3.0, flown.end_s, 500))
    assert flown.end_s == pytest.approx(3.0 + 3.0 / 0.5 + 0.5 / 0.5, rel=0.01)
    np.testing.assert_allclose(at[[0, -1]], places[[0, -1]], atol=1e-9)
    np.testing.assert_allclose(velocity[[0, -1]], 0.0, atol=1e-9)
    assert np.abs(np.hypot(at[:, 0], at[:, 1]) - 2.0).max() < 0.01
    assert np.linalg.norm(velocity, axis=1).max() < 0.55
    assert np.linalg.norm(acceleration, axis=1).max() < 0.3 * LIMITS.max_acceleration_mps2


def pressed(ahead_m: float, speed_mps: float = 0.0, walled: bool = False) -> Observation:
    """The vehicle at x = 5.7 m; its reference so far ahead of it, across an obstacle where there is one."""
    at = np.array([5.8, 2.05, 1.05])
    reference = Reference(
        position_m=at + np.array([ahead_m, 0.0, 0.0]),
        velocity_mps=np.zeros(3),
        acceleration_mps2=np.zeros(3),
        yaw_rad=0.0,
    )
    seen = replace(observe(room(walled=walled), time_s=1.0), reference=reference)
    return replace(seen, state=replace(hovering(at), velocity_mps=np.array([speed_mps, 0.0, 0.0])))


def test_who_stands_off_its_reference_touches_and_who_moves_or_waits_does_not() -> None:
    def told(observation: Observation) -> bool:
        touch = Touch()
        for n in range(4):
            touch = touch.felt(replace(observation, time_s=1.0 + 0.1 * n))
        return touch.holds(1.3)

    assert told(pressed(0.2))
    assert not told(pressed(0.2, speed_mps=0.3))
    assert not told(pressed(0.05))


def test_the_obstacle_is_noted_beyond_the_body_and_only_where_none_is_mapped() -> None:
    ball_m = touched_m(pressed(0.2), LIMITS, BALL_M)
    assert ball_m is not None
    near_m = ball_m[0] - BALL_M - 5.8
    assert 0.5 * LIMITS.body_size_m[0] < near_m < LIMITS.body_radius_m
    np.testing.assert_allclose(ball_m[1:], [2.05, 1.05])
    assert touched_m(pressed(0.2, walled=True), LIMITS, BALL_M) is None


@pytest.mark.parametrize("half_m", [0.2, 0.3, 0.4])
def test_there_is_room_to_turn_where_the_circle_of_the_corners_fits(half_m: float) -> None:
    here = np.array([7.0, 2.0, 1.0])
    assert room_to_turn(field_from(corridor_to(half_m)), here, LIMITS) is (half_m > LIMITS.body_radius_m)


@pytest.mark.parametrize("tilt_rad", [0.0, 0.15, 0.6])
def test_a_stop_off_the_reference_begins_with_the_acceleration_that_the_tilt_gives(tilt_rad: float) -> None:
    """Taken for level, a vehicle that was catching up used to be left behind again at once."""
    seen = pressed(0.5, speed_mps=-0.8)
    tilted = np.array([np.cos(0.5 * tilt_rad), 0.0, np.sin(0.5 * tilt_rad), 0.0])
    flown = stopped_off(replace(seen, state=replace(seen.state, quaternion_wxyz=tilted)), LIMITS)
    at, velocity, acceleration = (row[0] for row in evaluate(flown.trajectory, np.array([1.0])))
    np.testing.assert_allclose(at, seen.state.position_m)
    np.testing.assert_allclose(velocity, [-0.8, 0.0, 0.0])
    wanted = min(9.81 * np.tan(tilt_rad), LIMITS.max_acceleration_mps2)
    np.testing.assert_allclose(acceleration, [wanted, 0.0, 0.0], atol=1e-9)
    end = evaluate(flown.trajectory, np.array([flown.trajectory.end_s]))
    np.testing.assert_allclose(end[1][0], 0.0, atol=1e-9)


def test_a_way_that_was_noted_with_jitter_is_flown_back_without_sharp_turns() -> None:
    """2 cm aside at each place, 0.1 m apart, would ask for more than 1 m/s² at 0.5 m/s."""
    way_m = np.column_stack([np.linspace(2.0, 0.0, 21), np.zeros(21), np.ones(21)])
    way_m[1:-1, 1] += 0.02 * (-1.0) ** np.arange(19)
    plan = back_up(way_m, 0.0, 0.5)
    times_s = np.linspace(0.0, plan.end_s, 500)
    at_m, _, acceleration = evaluate(plan, times_s)
    np.testing.assert_allclose(at_m[[0, -1]], way_m[[0, -1]], atol=1e-9)
    assert np.linalg.norm(acceleration, axis=1).max() < 0.8
    assert np.abs(at_m[:, 1]).max() < 0.02
