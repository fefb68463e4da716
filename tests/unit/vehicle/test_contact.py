"""Contact: what is lost, what slides on, and that nothing passes through."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from tests.logs import make_world
from uavexp.controller.position_velocity import PositionVelocity
from uavexp.geometry import multiply_quaternions, quaternion_from_yaw, rotation_from_quaternion
from uavexp.scene import Scene
from uavexp.types import Bodies, Reference, State
from uavexp.vehicle.contact import ContactTracker, resolve
from uavexp.vehicle.quadrotor import Quadrotor

SIZE_M = (0.32, 0.32, 0.12)
STEP_S = 0.01
STILL = np.zeros(3)
GRAVITY = np.array([0.0, 0.0, -9.81])


def scene_of(*boxes) -> Scene:
    return Scene(make_world([([*map(float, low)], [*map(float, high)]) for low, high in boxes]))


WALL = scene_of(((2, -5, -5), (2.05, 5, 5)))
FLOOR = scene_of(((-5, -5, -1), (5, 5, 0)))
CORNER = scene_of(((2, -5, -5), (2.1, 5, 5)), ((-5, 2, -5), (5, 2.1, 5)), ((-5, -5, -0.1), (5, 5, 0)))
SHEET = scene_of(((2, -5, -5), (2.001, 5, 5)))  # thinner than a step
PILLAR = scene_of(((2, -0.1, -5), (2.2, 0.1, 5)))
BOARD = scene_of(((1, -1, 1.0), (2, 1, 1.02)))


def tilted(yaw_rad=0.0, tilt_rad=0.0, way_rad=0.0):
    tilt = np.array(
        [np.cos(tilt_rad / 2), *(np.sin(tilt_rad / 2) * np.array([np.cos(way_rad), np.sin(way_rad), 0]))]
    )
    return multiply_quaternions(quaternion_from_yaw(yaw_rad), tilt)


def body(position, velocity, quaternion=None, rate=(0.0, 0.0, 0.0)) -> State:
    return State(
        position_m=np.array(position, dtype=np.float64),
        velocity_mps=np.array(velocity, dtype=np.float64),
        quaternion_wxyz=tilted() if quaternion is None else quaternion,
        body_rate_radps=np.array(rate, dtype=np.float64),
    )


def drifted(state: State, acceleration=STILL) -> State:
    """The state a step later with nothing in the way, its body rate in world axes."""
    velocity = state.velocity_mps + STEP_S * acceleration
    rate = state.body_rate_radps
    angle = float(np.linalg.norm(rate)) * STEP_S
    axis = rate / np.linalg.norm(rate) if angle > 0.0 else np.zeros(3)
    turn = np.array([np.cos(angle / 2), *(np.sin(angle / 2) * axis)])
    return replace(
        state,
        position_m=state.position_m + STEP_S * (state.velocity_mps + 0.5 * STEP_S * acceleration),
        velocity_mps=velocity,
        quaternion_wxyz=multiply_quaternions(turn, state.quaternion_wxyz),
    )


def overlaps(state: State, scene: Scene) -> bool:
    return scene.touches(state.position_m, rotation_from_quaternion(state.quaternion_wxyz), np.array(SIZE_M))


def fly(state, scene, steps, acceleration=STILL):
    """Fly on through contacts; the states and how many steps touched; never overlapping."""
    states, touched = [state], 0
    for _ in range(steps):
        state, touch = resolve(state, drifted(state, acceleration), scene, SIZE_M)
        assert not overlaps(state, scene)
        states.append(state)
        touched += bool(touch)
    return states, touched


def test_a_step_that_touches_nothing_is_returned_as_it_is():
    before = body((0, 0, 0), (1, 0, 0))
    after = drifted(before)
    state, touched = resolve(before, after, WALL, SIZE_M)
    assert state is after
    assert not touched


@pytest.mark.parametrize("speed_mps", [2.5, 5.0])
@pytest.mark.parametrize("angle_deg", [0, 20, 45, 70, 85])
@pytest.mark.parametrize("quaternion", [tilted(), tilted(0.5), tilted(0.3, 0.4, 1.0), tilted(2.0, 0.6, -2.0)])
@pytest.mark.parametrize("scene", [WALL, SHEET])
def test_at_a_wall_the_velocity_into_it_is_lost_and_the_rest_kept(scene, quaternion, angle_deg, speed_mps):
    angle = np.radians(angle_deg)
    velocity = speed_mps * np.array([np.cos(angle), np.sin(angle), 0.0])
    reach = np.abs(rotation_from_quaternion(quaternion)[0]) @ SIZE_M * 0.5
    states, touched = fly(body((1.65, -1.0, 0.0), velocity, quaternion), scene, 150)
    assert touched >= 1
    end = states[-1]
    np.testing.assert_allclose(end.velocity_mps, [0.0, velocity[1], 0.0], atol=1e-3 * speed_mps)
    assert end.position_m[0] == pytest.approx(2.0 - reach, abs=1.5e-3)
    assert end.position_m[1] == pytest.approx(-1.0 + 1.5 * velocity[1], abs=0.01 * speed_mps)


def test_falls_on_the_floor_and_rests():
    states, _ = fly(body((0, 0, 1.0), (1.0, 0.0, 0.0)), FLOOR, 200, GRAVITY)
    end = states[-1]
    assert end.position_m[2] == pytest.approx(0.06, abs=2e-3)
    np.testing.assert_allclose(end.velocity_mps, [1.0, 0.0, 0.0], atol=1e-3)


@pytest.mark.parametrize("quaternion", [tilted(), tilted(0.8), tilted(0.3, 0.5, 1.0)])
def test_energy_never_increases(quaternion):
    states, touched = fly(body((0, 0, 0.8), (2.0, 1.0, 0.0), quaternion), CORNER, 250, GRAVITY)
    assert touched > 1
    energy = np.array([0.5 * s.velocity_mps @ s.velocity_mps + 9.81 * s.position_m[2] for s in states])
    assert np.diff(energy).max() < 9.81 * 1.1e-3  # the gap left after a touch, at most
    assert energy[-1] < energy[0] - 1.0


def test_comes_to_rest_in_a_corner():
    states, _ = fly(
        body((1.0, 1.2, 0.5), (2.0, 2.0, 0.0), tilted(0.4)), CORNER, 200, np.array([3.0, 2.0, -9.81])
    )
    np.testing.assert_allclose(states[-1].velocity_mps, 0.0, atol=0.05)
    reach = 0.16 * (np.cos(0.4) + np.sin(0.4))
    np.testing.assert_allclose(states[-1].position_m, [2.0 - reach, 2.0 - reach, 0.06], atol=5e-3)


def test_slides_off_a_pillar_met_off_centre():
    states, touched = fly(
        body((1.0, 0.15, 0.0), (2.5, 0.0, 0.0), tilted(0.6)), PILLAR, 300, np.array([4.0, 1.0, 0])
    )
    assert touched >= 1
    assert states[-1].position_m[0] > 3.0


def test_a_board_edge_stops_the_middle_of_a_face():
    states, touched = fly(body((0.3, 0.0, 1.01), (2.5, 0.0, 0.0)), BOARD, 60)
    assert touched >= 1
    assert states[-1].position_m[0] == pytest.approx(1.0 - 0.16, abs=3e-3)
    assert states[-1].velocity_mps[0] == pytest.approx(0.0, abs=1e-6)


def test_yawing_against_a_wall_pushes_the_body_off():
    start = body((2.0 - 0.161, 0.0, 0.0), (0.2, 0.0, 0.0), rate=(0.0, 0.0, 2.0))
    states, _ = fly(start, WALL, 40)  # 0.8 rad
    assert states[-1].position_m[0] <= 2.0 - 0.16 * (np.cos(0.8) + np.sin(0.8)) + 1e-6
    yaw = 2.0 * np.arctan2(states[-1].quaternion_wxyz[3], states[-1].quaternion_wxyz[0])
    assert yaw == pytest.approx(0.8, abs=0.02)


def test_leaves_a_wall_freely():
    start = body((2.0 - 0.161, 0.0, 0.0), (0.5, 0.0, 0.0))
    held, touched = fly(start, WALL, 20)
    assert touched
    away, touched = fly(replace(held[-1], velocity_mps=np.array([-1.0, 0.0, 0.0])), WALL, 20)
    assert touched == 0
    assert away[-1].position_m[0] == pytest.approx(held[-1].position_m[0] - 0.2)


def test_one_long_step_does_not_jump_a_sheet():
    before = body((0, 0, 0), (400.0, 0.0, 0.0))
    state, touched = resolve(before, drifted(before), SHEET, SIZE_M)
    assert touched
    assert state.position_m[0] < 2.0 - 0.16


def test_a_wild_flight_among_boxes_never_overlaps_passes_or_gains_speed():
    scene = scene_of(
        ((2, -3, -1), (2.05, 3, 4)),
        ((-3, 2, -1), (3, 2.02, 4)),
        ((-3, -3, -0.1), (3, 3, 0)),
        ((0.5, -2, 0), (0.6, -1.9, 3)),
        ((-2, -0.5, 1.0), (-1, 0.5, 1.03)),
        ((-2, -2, 0), (-1, -1, 1)),
    )
    rng, touches = np.random.default_rng(0), 0
    for _ in range(40):
        state = body(
            rng.uniform([-2.7, -2.7, 0.2], [1.7, 1.7, 3.0]),
            rng.uniform(-3, 3, 3),
            tilted(*rng.uniform(-1, 1, 3)),
        )
        if overlaps(state, scene):
            continue
        tracker = ContactTracker(scene=scene, body_size_m=SIZE_M)
        for k in range(120):
            if k % 30 == 0:
                push = 4.0 * rng.normal(size=3)
                state = replace(state, body_rate_radps=rng.uniform(-2.0, 2.0, 3))
            after = drifted(state, push)
            moved, touched = tracker.advance(state, after, k * STEP_S)
            touches += touched
            assert not overlaps(moved, scene)
            assert np.linalg.norm(moved.velocity_mps) <= np.linalg.norm(after.velocity_mps) + 1e-12
            way = moved.position_m - state.position_m
            if np.linalg.norm(way) > 1e-9:
                hit, _ = scene.cast(np.concatenate([state.position_m, way]).astype(np.float32)[None])
                assert hit[0] > 1.0
            state = moved
    assert touches > 200


def track(tracker, gaps):
    """Feed a tracker a body whose gap to the wall takes these values, one per 10 ms."""
    position = [2.0 - 0.16 - gap for gap in gaps]
    for k, (x0, x1) in enumerate(pairwise(position)):
        tracker.advance(body((x0, 0, 0), (0, 0, 0)), body((x1, 0, 0), (0, 0, 0)), (k + 1) * STEP_S)


def test_a_contact_counts_once_until_the_gap_has_been_wide_for_long():
    tracker = ContactTracker(scene=WALL, body_size_m=SIZE_M)
    touch, near, wide = [0.002, -0.003], [0.015], [0.03]
    # away for 0.15 s, within 2 cm again, then away for good: one contact
    track(tracker, touch + wide * 15 + touch + near * 30 + wide * 40)
    (contact,) = tracker.contacts
    assert contact.start_s == pytest.approx(0.01)
    assert contact.end_s == pytest.approx(0.48)  # the last moment within 2 cm
    assert contact.position_m[0] == pytest.approx(2.0 - 0.16, abs=2e-3)
    # away for 0.3 s between two touches: two contacts
    tracker = ContactTracker(scene=WALL, body_size_m=SIZE_M)
    track(tracker, touch + wide * 30 + touch + wide * 5)
    assert len(tracker.contacts) == 2


def test_far_from_everything_a_step_asks_the_scene_nothing():
    class Counting:
        asked, bodies = 0, Bodies.none()

        def fixed_distance_m(self, points_m):
            self.asked += 1
            return WALL.fixed_distance_m(points_m)

    scene = Counting()
    tracker = ContactTracker(scene=scene, body_size_m=SIZE_M)
    for k in range(100):
        before = body((-3.0 + 0.01 * k, 0, 0), (1, 0, 0))
        assert not tracker.advance(before, drifted(before), k * STEP_S)[1]
    assert scene.asked == 1
    assert tracker.contacts == ()


def test_a_quadrotor_sent_into_a_wall_slides_along_it_and_leaves_when_told():
    vehicle, controller = Quadrotor(), PositionVelocity()
    state = body((1.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    vehicle.reset(state)
    controller.reset(vehicle.limits, vehicle.mass_kg)
    tracker, farthest_m = ContactTracker(scene=WALL, body_size_m=SIZE_M), 0.0
    for k in range(1200):
        goal = np.array([2.5, 1.0, 1.0]) if k < 600 else np.array([1.0, 1.0, 1.0])
        reference = Reference(
            position_m=goal, velocity_mps=np.zeros(3), acceleration_mps2=np.zeros(3), yaw_rad=0.4
        )
        after = vehicle.step(controller.command(state, reference), STEP_S)
        state, touched = tracker.advance(state, after, k * STEP_S)
        if touched:
            vehicle.place(state)
        assert not overlaps(state, WALL)
        farthest_m = max(farthest_m, state.position_m[0])
        if k == 599:
            assert state.position_m[1] == pytest.approx(1.0, abs=0.02)
    assert farthest_m < 2.0 - 0.16
    np.testing.assert_allclose(state.position_m, goal, atol=1e-3)
    assert len(tracker.contacts) == 1
