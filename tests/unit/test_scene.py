"""The true geometry against closed forms and an independent solver."""

import numpy as np
import pytest
from scipy.optimize import linprog

from uavexp.scene import Scene
from uavexp.triangle_grid import (
    ball_meets_mesh,
    box_meets_mesh,
    box_meets_triangle,
    build,
    squared_distance_to_triangle,
)
from uavexp.world.boxes import Boxes


def scene_of(*boxes: tuple[tuple[float, ...], tuple[float, ...]]) -> Scene:
    made = Boxes()
    for low, high in boxes:
        made.span(low, high)
    return Scene.from_mesh(*made.mesh())


def random_rotation(rng: np.random.Generator) -> np.ndarray:
    q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return q * np.linalg.det(q)


def distance_to_box_surface(points: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Closed form: outside the distance to the box, inside to the nearest face."""
    beyond = np.maximum(np.maximum(low - points, points - high), 0.0)
    inner = np.minimum(points - low, high - points).min(axis=1)
    return np.where(inner > 0.0, inner, np.linalg.norm(beyond, axis=1))


def test_distance_and_closest_point_equal_the_closed_form_of_a_box() -> None:
    low, high = np.array([-1.0, 0.5, 0.0]), np.array([2.0, 1.5, 0.8])
    scene = scene_of((tuple(low), tuple(high)))
    points = np.random.default_rng(0).uniform(-4.0, 4.0, (2000, 3))
    expected = distance_to_box_surface(points, low, high)
    np.testing.assert_allclose(scene.distance_m(points), expected, atol=2e-6)
    closest = scene.fixed_closest_point_m(points)
    np.testing.assert_allclose(np.linalg.norm(points - closest, axis=1), expected, atol=4e-6)
    np.testing.assert_allclose(distance_to_box_surface(closest, low, high), 0.0, atol=2e-6)


def test_rays_hit_a_slab_at_the_closed_form_whatever_their_length() -> None:
    scene = scene_of(((-50.0, -50.0, -1.0), (50.0, 50.0, 0.0)))
    rng = np.random.default_rng(1)
    origin = rng.uniform([-5, -5, 0.5], [5, 5, 3.0], (500, 3))
    direction = rng.normal(size=(500, 3)) * rng.uniform(0.1, 5.0, (500, 1))
    t, normal = scene.cast(np.hstack([origin, direction]).astype(np.float32))
    down = direction[:, 2] < -0.3
    np.testing.assert_allclose(t[down], -origin[down, 2] / direction[down, 2], rtol=1e-4)
    np.testing.assert_allclose(np.abs(normal[down]) @ [0.0, 0.0, 1.0], 1.0, atol=1e-5)
    up = direction[:, 2] > 0.0
    assert np.isinf(t[up]).all()
    assert (normal[up] == 0.0).all()


def test_empty_space_has_no_hits_no_touch_and_infinite_distance() -> None:
    scene = Scene.from_mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32))
    t, normal = scene.cast(np.ones((4, 6), np.float32))
    assert np.isinf(t).all()
    assert (normal == 0.0).all()
    assert np.isinf(scene.distance_m(np.zeros((3, 3)))).all()
    assert np.isinf(scene.fixed_closest_point_m(np.zeros((3, 3)))).all()
    assert not scene.touches(np.zeros(3), np.eye(3), np.ones(3))


def gap_by_linear_programme(
    corner: np.ndarray, centre: np.ndarray, rotation: np.ndarray, half: np.ndarray
) -> float:
    """How much the box must grow on every side to meet the triangle (< 0: it may shrink)."""
    in_box = (corner - centre) @ rotation  # corners in the box's frame
    # minimise s over weights w >= 0 with sum 1, |sum w_n corner_n| <= half + s
    rows = np.vstack([np.hstack([in_box.T, -np.ones((3, 1))]), np.hstack([-in_box.T, -np.ones((3, 1))])])
    solution = linprog(
        [0.0, 0.0, 0.0, 1.0],
        A_ub=rows,
        b_ub=np.concatenate([half, half]),
        A_eq=[[1.0, 1.0, 1.0, 0.0]],
        b_eq=[1.0],
        bounds=[(0, None)] * 3 + [(None, None)],
    )
    return float(solution.x[3])


def test_box_meets_triangle_exactly_when_a_linear_programme_says_so() -> None:
    rng = np.random.default_rng(2)
    answers = []
    for _ in range(300):
        corner = rng.uniform(-1.2, 1.2, (3, 3))
        centre, half, rotation = rng.uniform(-0.4, 0.4, 3), rng.uniform(0.05, 0.4, 3), random_rotation(rng)
        gap = gap_by_linear_programme(corner, centre, rotation, half)
        if abs(gap) < 1e-9:
            continue
        answers.append(gap < 0.0)
        assert box_meets_triangle(corner, centre, rotation, half) == (gap < 0.0)
    assert 0.2 < np.mean(answers) < 0.8  # both answers were really tried


def test_margin_turns_a_miss_into_a_touch_at_the_gap() -> None:
    scene = scene_of(((1.0, -5.0, -5.0), (2.0, 5.0, 5.0)))
    size = np.array([0.32, 0.32, 0.12])
    position = np.array([0.74, 0.0, 0.0])  # 0.1 m before the wall
    assert not scene.touches(position, np.eye(3), size)
    assert not scene.touches(position, np.eye(3), size, margin_m=0.0999)
    assert scene.touches(position, np.eye(3), size, margin_m=0.1001)
    yaw = np.pi / 4.0  # turned by 45° its corner reaches 0.226 m
    turned = np.array([[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0, 0, 1.0]])
    reach = 0.5 * np.hypot(0.32, 0.32)
    assert not scene.touches(np.array([1.0 - reach - 1e-4, 0, 0]), turned, size)
    assert scene.touches(np.array([1.0 - reach + 1e-4, 0, 0]), turned, size)


@pytest.fixture(scope="module")
def soup() -> tuple[np.ndarray, np.ndarray]:
    """Triangles of all sizes, from crumbs to sheets across the whole space."""
    rng = np.random.default_rng(3)
    centre = rng.uniform(-4.0, 4.0, (300, 1, 3))
    spread = rng.uniform(0.05, 1.0, (300, 1, 1)) ** 3 * 4.0
    corners = centre + spread * rng.normal(size=(300, 3, 3))
    vertices = corners.reshape(-1, 3).astype(np.float32)
    return vertices, np.arange(900, dtype=np.int32).reshape(-1, 3)


def test_the_grid_finds_what_testing_every_triangle_finds(soup: tuple[np.ndarray, np.ndarray]) -> None:
    grid = build(*soup)
    rng = np.random.default_rng(4)
    answers = []
    for _ in range(400):
        centre, half = rng.uniform(-6.0, 6.0, 3), rng.uniform(0.02, 0.5, 3)
        rotation = random_rotation(rng)
        brute = any(box_meets_triangle(corner, centre, rotation, half) for corner in grid.corners_m)
        assert box_meets_mesh(grid, centre, rotation, half) == brute
        answers.append(brute)
    assert 0.1 < np.mean(answers) < 0.9


def test_ball_and_distance_agree_with_open3d(soup: tuple[np.ndarray, np.ndarray]) -> None:
    grid, scene = build(*soup), Scene.from_mesh(*soup)
    points = np.random.default_rng(5).uniform(-6.0, 6.0, (500, 3))
    distance = scene.distance_m(points)
    for point, value in zip(points, distance, strict=True):
        nearest = min(squared_distance_to_triangle(corner, point) for corner in grid.corners_m)
        assert np.sqrt(nearest) == pytest.approx(value, abs=5e-6)
        assert ball_meets_mesh(grid, point, value + 1e-5)
        assert not ball_meets_mesh(grid, point, max(0.0, value - 1e-5))


def test_a_box_inside_a_solid_meets_no_surface() -> None:
    scene = scene_of(((-5.0, -5.0, -5.0), (5.0, 5.0, 5.0)))
    assert not scene.touches(np.zeros(3), np.eye(3), np.ones(3))
    assert scene.touches(np.array([4.6, 0.0, 0.0]), np.eye(3), np.ones(3))


def test_distance_is_lipschitz_in_a_furnished_scene(soup: tuple[np.ndarray, np.ndarray]) -> None:
    scene = Scene.from_mesh(*soup)
    rng = np.random.default_rng(6)
    a = rng.uniform(-6.0, 6.0, (2000, 3))
    b = a + rng.normal(0.0, 0.3, a.shape)
    change = np.abs(scene.distance_m(a) - scene.distance_m(b))
    assert (change <= np.linalg.norm(a - b, axis=1) + 1e-5).all()
