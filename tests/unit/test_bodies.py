"""Moving bodies against closed forms, sampled surfaces and an independent solver; contact with them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from uavexp.bodies import ABSENT_M, cast_rays, distance_m, present, separating_planes, touching
from uavexp.scene import Scene
from uavexp.types import Bodies, Shape, State
from uavexp.vehicle.contact import FIXED, ContactTracker
from uavexp.world.boxes import Boxes

SIZE_M = (0.32, 0.32, 0.12)
STEP_S = 0.01
SHAPES = list(Shape)


def body_of(shape: Shape, position=(0.0, 0.0, 0.0), half=(0.4, 0.3, 0.7), velocity=(0.0, 0.0, 0.0)) -> Bodies:
    half_m = np.array(half, dtype=np.float64)
    if shape is Shape.SPHERE:
        half_m[:] = half_m[0]
    if shape is Shape.CYLINDER:
        half_m[1] = half_m[0]
    return Bodies(
        time_s=0.0,
        shape=np.array([shape], np.uint8),
        half_size_m=half_m[None],
        position_m=np.array([position], dtype=np.float64),
        velocity_mps=np.array([velocity], dtype=np.float64),
    )


def project(shape: Shape, half, point):
    """Nearest point of a body around the origin."""
    if shape is Shape.SPHERE:
        return point * min(1.0, half[0] / max(np.linalg.norm(point), 1e-12))
    nearest = np.clip(point, -half, half)
    if shape is Shape.CYLINDER:
        nearest[:2] = point[:2] * min(1.0, half[0] / max(np.hypot(*point[:2]), 1e-12))
    return nearest


def random_rotation(rng):
    q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return q * np.linalg.det(q)


@pytest.mark.parametrize("shape", SHAPES)
def test_distance_of_points_is_that_of_the_nearest_point(shape):
    bodies = body_of(shape)
    rng = np.random.default_rng(0)
    points = rng.uniform(-1.5, 1.5, (500, 3))
    nearest = np.array([project(shape, bodies.half_size_m[0], point.copy()) for point in points])
    np.testing.assert_allclose(
        distance_m(bodies, points), np.linalg.norm(points - nearest, axis=1), atol=1e-12
    )


@pytest.mark.parametrize("shape", SHAPES)
def test_rays_hit_where_the_distance_becomes_zero_and_normals_point_out(shape):
    """Sphere tracing finds the same hits from the distance alone."""
    bodies = body_of(shape)
    rng = np.random.default_rng(1)
    origin = rng.normal(size=(400, 3))
    origin = 1.5 * origin / np.linalg.norm(origin, axis=1)[:, None]
    way = rng.uniform(-0.6, 0.6, (400, 3)) - origin
    rays = np.hstack([origin, way]).astype(np.float32)
    hit, normal = np.full(400, np.inf, np.float32), np.zeros((400, 3), np.float32)
    cast_rays(bodies, rays, hit, normal)
    length = np.linalg.norm(way, axis=1)
    unit, along = way / length[:, None], np.zeros(400)
    for _ in range(400):
        along += distance_m(bodies, origin + along[:, None] * unit)
    traced = np.where(along < 4.0, along, np.inf)
    assert 0.3 < np.isfinite(traced).mean() < 1.0
    np.testing.assert_allclose(hit * length, traced, atol=2e-3)
    met = np.isfinite(hit)
    assert (np.sum(normal[met] * unit[met], axis=1) < 0.0).all()
    np.testing.assert_allclose(np.linalg.norm(normal[met], axis=1), 1.0, atol=1e-5)
    # a small step along the normal leaves the body by as much
    surface = origin[met] + hit[met, None] * way[met]
    np.testing.assert_allclose(distance_m(bodies, surface + 0.01 * normal[met]), 0.01, atol=1e-4)


@pytest.mark.parametrize("shape", SHAPES)
def test_a_ray_from_inside_meets_the_surface_from_within(shape):
    bodies = body_of(shape)
    way = np.array([0.0, 0.0, 1.0])
    hit, normal = np.full(1, np.inf, np.float32), np.zeros((1, 3), np.float32)
    cast_rays(bodies, np.hstack([np.zeros(3), way])[None].astype(np.float32), hit, normal)
    assert hit[0] == pytest.approx(bodies.half_size_m[0, 2])
    np.testing.assert_allclose(normal[0], way)


def test_the_nearer_of_wall_and_mover_stops_a_ray():
    made = Boxes()
    made.span((2.0, -5.0, -5.0), (2.1, 5.0, 5.0))
    scene = Scene.from_mesh(*made.mesh())
    ray = np.array([[0.0, 0.0, 0.0, 1.0, 0.0, 0.0]], np.float32)
    for x, expected in ((1.0, 0.6), (5.0, 2.0)):
        scene.place(body_of(Shape.SPHERE, (x, 0.0, 0.0)))
        assert scene.cast(ray)[0][0] == pytest.approx(expected, abs=1e-6)
        assert scene.fixed_cast(ray)[0][0] == pytest.approx(2.0)
        assert scene.distance_m(np.zeros((1, 3)))[0] == pytest.approx(expected, abs=1e-6)
        assert scene.fixed_distance_m(np.zeros((1, 3)))[0] == pytest.approx(2.0)


def gap_by_solver(shape, half, offset, rotation, box, start) -> float:
    """Least distance between a body around the origin and a box, by a general solver over the box."""

    def gap(local):
        point = offset + rotation @ local
        return float(np.linalg.norm(point - project(shape, half, point.copy())) ** 2)

    best = minimize(gap, start, bounds=[(-b, b) for b in box], method="L-BFGS-B", options={"ftol": 1e-14})
    return float(np.sqrt(best.fun))


@pytest.mark.parametrize("shape", SHAPES)
def test_touching_is_exact_and_planes_separate(shape):
    rng = np.random.default_rng(2)
    answers = []
    for _ in range(150):
        bodies = body_of(shape, half=rng.uniform(0.1, 0.6, 3))
        half, box = bodies.half_size_m[0], rng.uniform(0.05, 0.4, 3)
        offset, rotation = rng.uniform(-0.9, 0.9, 3), random_rotation(rng)
        gap = gap_by_solver(shape, half, offset, rotation, box, np.zeros(3))
        if 1e-7 < gap < 1e-4:
            continue
        touches = touching(bodies, offset, rotation, box).size > 0
        assert touches == (gap <= 1e-7)
        answers.append(touches)
        _, normal, across = separating_planes(bodies, offset, rotation, box, np.inf)
        assert across[0] <= gap + 1e-6
        assert normal[0] @ offset >= 0.0
        if touches:
            assert across[0] <= 1e-9
        else:  # at least a good share of the true gap; beside a cylinder's rim it is approximate
            assert across[0] > 0.5 * gap - 0.02
    assert 0.1 < np.mean(answers) < 0.9


def test_an_upright_cylinder_is_round_and_flat():
    bodies = body_of(Shape.CYLINDER, half=(0.3, 0.3, 0.9))
    box, corner = np.array([0.16, 0.16, 0.06]), np.array([0.3 / np.sqrt(2.0)] * 2)
    for far, touches in ((0.159, True), (0.161, False)):
        at = np.array([*(corner + far), 0.0])  # a corner of the box towards the round side
        assert (touching(bodies, at, np.eye(3), box).size > 0) == touches
        above = np.array([0.0, 0.0, 0.9 + far - 0.1])
        assert (touching(bodies, above, np.eye(3), box).size > 0) == touches


def test_absent_bodies_are_nowhere():
    bodies = body_of(Shape.CYLINDER, tuple(ABSENT_M))
    assert not present(bodies.position_m).any()
    hit, normal = np.full(1, np.inf, np.float32), np.zeros((1, 3), np.float32)
    cast_rays(bodies, np.array([[0.0, 0.0, 0.0, 0.0, 0.0, -1.0]], np.float32), hit, normal)
    assert np.isinf(hit[0])
    assert distance_m(bodies, np.zeros((1, 3)))[0] > 900.0


# --- contact --------------------------------------------------------------------------------------

FREE_AIR = Scene.from_mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32))


def walls(*boxes) -> Scene:
    made = Boxes()
    for low, high in boxes:
        made.span(low, high)
    return Scene.from_mesh(*made.mesh())


def vehicle(position=(0.0, 0.0, 1.0), velocity=(0.0, 0.0, 0.0), yaw=0.0) -> State:
    return State(
        position_m=np.array(position, dtype=np.float64),
        velocity_mps=np.array(velocity, dtype=np.float64),
        quaternion_wxyz=np.array([np.cos(0.5 * yaw), 0.0, 0.0, np.sin(0.5 * yaw)]),
        body_rate_radps=np.zeros(3),
    )


def drive(state: State, bodies: Bodies, scene: Scene, steps: int):
    """Let a body go on at its velocity and the vehicle at its own; states, tracker and touched steps."""
    scene.place(bodies)
    tracker = ContactTracker(scene=scene, body_size_m=SIZE_M)
    tracker.advance(state, state, 0.0)
    states, touched = [state], 0
    for k in range(1, steps + 1):
        scene.place(replace(bodies, position_m=bodies.position_m + k * STEP_S * bodies.velocity_mps))
        after = replace(state, position_m=state.position_m + STEP_S * state.velocity_mps)
        state, touch = tracker.advance(state, after, k * STEP_S)
        touched += touch
        states.append(state)
    return states, tracker, touched


def meets_mover(state: State, scene: Scene) -> bool:
    yaw = 2.0 * np.arctan2(state.quaternion_wxyz[3], state.quaternion_wxyz[0])
    c, s = np.cos(yaw), np.sin(yaw)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return scene.touched_movers(state.position_m, turn, np.array(SIZE_M)).size > 0


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("yaw", [0.0, 0.4])
@pytest.mark.parametrize("aside", [0.0, 0.1])
def test_a_mover_that_runs_into_a_hovering_vehicle_pushes_it_along(shape, yaw, aside):
    bodies = body_of(shape, (-1.0, aside, 1.0), velocity=(1.5, 0.0, 0.0))
    states, tracker, touched = drive(vehicle(yaw=yaw), bodies, FREE_AIR, 120)
    assert touched > 0
    assert not meets_mover(states[-1], FREE_AIR)
    speed = np.array([np.linalg.norm(state.velocity_mps) for state in states])
    assert speed.max() <= 1.5 + 1e-9  # never faster than what pushes it
    assert states[-1].position_m[0] > 0.2
    if aside == 0.0 and shape is Shape.BOX:
        np.testing.assert_allclose(states[-1].velocity_mps, [1.5, 0.0, 0.0], atol=1e-6)
    (contact,) = tracker.contacts
    assert contact.mover == 0
    FREE_AIR.place(Bodies.none())


@pytest.mark.parametrize("shape", SHAPES)
def test_only_the_velocity_into_the_mover_is_lost(shape):
    bodies = body_of(shape, (1.0, 0.0, 1.0), velocity=(-0.5, 0.0, 0.0))
    states, _, touched = drive(vehicle(velocity=(1.0, 0.0, 0.0)), bodies, FREE_AIR, 100)
    assert touched > 0
    np.testing.assert_allclose(states[-1].velocity_mps, [-0.5, 0.0, 0.0], atol=1e-6)
    FREE_AIR.place(Bodies.none())


def test_a_vehicle_pressed_against_a_wall_stays_out_of_it_and_comes_free_again():
    scene = walls(((0.5, -5.0, -5.0), (0.7, 5.0, 5.0)), ((-5.0, -5.0, -0.2), (5.0, 5.0, 0.0)))
    bodies = body_of(Shape.BOX, (-1.2, 0.0, 1.0), velocity=(1.0, 0.0, 0.0))
    states, tracker, _ = drive(vehicle(), bodies, scene, 400)
    assert all(np.isfinite(state.position_m).all() for state in states)
    assert max(state.position_m[0] for state in states) < 0.5 - 0.16
    steps = np.linalg.norm(np.diff([state.position_m for state in states], axis=0), axis=1)
    assert steps.max() < 0.03  # no explosion
    assert not meets_mover(states[-1], scene)
    assert {contact.mover for contact in tracker.contacts} == {FIXED, 0}


def test_a_body_that_appears_on_the_vehicle_lets_it_out_gently():
    bodies = body_of(Shape.CYLINDER, (0.1, 0.05, 1.0), half=(0.25, 0.25, 0.85))
    states, tracker, _ = drive(vehicle(), bodies, FREE_AIR, 100)
    assert not meets_mover(states[-1], FREE_AIR)
    steps = np.linalg.norm(np.diff([state.position_m for state in states], axis=0), axis=1)
    assert steps.max() < 0.0111
    assert len(tracker.contacts) == 1
    FREE_AIR.place(Bodies.none())


def test_each_mover_is_a_contact_of_its_own_counted_once():
    two = Bodies(
        time_s=0.0,
        shape=np.array([Shape.BOX, Shape.BOX], np.uint8),
        half_size_m=np.full((2, 3), 0.2),
        position_m=np.array([[-1.0, 0.0, 1.0], [6.0, 0.0, 1.0]]),
        velocity_mps=np.array([[1.0, 0.0, 0.0], [-2.0, 0.0, 0.0]]),
    )
    _, tracker, _ = drive(vehicle(), two, FREE_AIR, 250)
    assert sorted(contact.mover for contact in tracker.contacts) == [0, 1]
    FREE_AIR.place(Bodies.none())


def test_wild_movers_never_make_the_flight_explode():
    scene = walls(((-3, -3, -0.1), (3, 3, 0)), ((2, -3, 0), (2.1, 3, 3)), ((-3, 2, 0), (3, 2.1, 3)))
    rng = np.random.default_rng(5)
    for shape in SHAPES:
        for _ in range(6):
            way = rng.uniform(-2.0, 2.0, 3)
            bodies = body_of(shape, (np.array([0.5, 0.5, 1.0]) - 0.7 * way).tolist(), velocity=way.tolist())
            start = vehicle((0.5, 0.5, 1.0), rng.uniform(-2.0, 2.0, 3), rng.uniform(-3.0, 3.0))
            states, _, _ = drive(start, bodies, scene, 150)
            for state in states:
                assert np.isfinite(state.position_m).all()
                assert np.linalg.norm(state.velocity_mps) < 8.0
                assert not scene.touches_fixed(state.position_m, np.eye(3), np.full(3, 0.05))
            assert np.linalg.norm(np.diff([s.position_m for s in states], axis=0), axis=1).max() < 0.1


def test_without_movers_a_step_far_from_all_asks_nothing_and_with_one_it_does():
    scene = walls(((8.0, -5.0, -5.0), (8.1, 5.0, 5.0)))
    bodies = body_of(Shape.SPHERE, (-2.0, 0.0, 1.0), velocity=(2.0, 0.0, 0.0))
    states, tracker, touched = drive(vehicle(), bodies, scene, 100)
    assert touched > 0  # though the vehicle itself never moved before it was met
    assert tracker.contacts[0].start_s == pytest.approx((2.0 - 0.4 - 0.16) / 2.0, abs=0.011)
    assert states[60].velocity_mps[0] == 0.0
