"""Drawn depth images against Embree's rays, and what drawing must never do."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uavexp.geometry import rotation_from_quaternion
from uavexp.scene import Scene
from uavexp.sensor import true_depth
from uavexp.sensor.raster import rasterise
from uavexp.sensor.true_depth import TrueDepth
from uavexp.types import Bodies, Shape

LONG = settings(deadline=None, max_examples=200)
SEEDS = st.integers(0, 2**32 - 1)
SIZES = st.tuples(st.integers(1, 40), st.integers(1, 40))
CORNERS = np.array([[x, y, z] for x in (-2, 2) for y in (-2, 2) for z in (-2, 2)], np.float32)
WALLS = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ],
    np.int32,
)  # fmt: skip


class Camera:
    """One somewhere around the origin, looking anywhere, 30 to 130 degrees wide, its axis off the middle."""

    def __init__(self, seed: int, size: tuple[int, int]) -> None:
        self.rng = rng = np.random.default_rng(seed)
        focal, quaternion = 0.5 * size[1] / np.tan(np.radians(rng.uniform(15, 65))), rng.normal(size=4)
        centre = np.array(size[::-1]) * rng.uniform(0.3, 0.7, 2)
        self.size = size
        self.intrinsics = np.array([focal, focal * rng.uniform(0.8, 1.2), *centre])
        self.position_m = rng.uniform(-1.9, 1.9, 3)
        self.rotation = rotation_from_quaternion(quaternion / np.linalg.norm(quaternion))

    def draw(self, vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Inverse depth and distance of the plane, (H, W) each."""
        inverse, plane_m = np.empty((2, *self.size), np.float32)
        pose, scratch = (self.position_m, self.rotation), np.empty((len(vertices), 3))
        rasterise(vertices, triangles, self.intrinsics, *pose, scratch, inverse, plane_m)
        return inverse, plane_m

    def take(self, scene: Scene) -> TrueDepth:
        image = TrueDepth(scene, self.size, self.intrinsics)
        image.take(self.position_m, self.rotation)
        return image

    def rays(self, du: float, dv: float) -> np.ndarray:
        """Rays (N, 6) beside the middles of all pixels; the direction's depth is 1."""
        fx, fy, cx, cy = self.intrinsics
        v, u = np.indices(self.size)
        seen = np.stack([(u + du - cx) / fx, (v + dv - cy) / fy, np.ones(self.size)], axis=-1).reshape(-1, 3)
        return np.hstack([np.tile(self.position_m, (len(seen), 1)), seen @ self.rotation.T]).astype(
            np.float32
        )


def soup(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Triangles all around the origin, many across the camera's plane, some small or thin."""
    middle, edge = rng.uniform(-5, 5, (count, 1, 3)), rng.choice([0.1, 1.0, 6.0], (count, 1, 1))
    vertices = (middle + edge * rng.normal(size=(count, 3, 3))).reshape(-1, 3).astype(np.float32)
    return vertices, np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


@LONG
@given(SEEDS, SIZES, st.integers(1, 30))
def test_a_pixel_sees_what_its_ray_meets(seed: int, size: tuple[int, int], count: int) -> None:
    """Wherever the rays close around it meet the same triangle; both sides of a triangle are seen."""
    camera = Camera(seed, size)
    mesh = soup(camera.rng, count)
    scene, (inverse, plane_m) = Scene.from_mesh(*mesh), camera.draw(*mesh)
    rays = camera.rays(0.0, 0.0)
    depth, normal = scene.cast(rays)
    beside = [scene.cast(camera.rays(0.03 * du, 0.03 * dv)) for du in (-1, 1) for dv in (-1, 1)]
    clear = np.all([np.abs(other - normal).max(axis=1) < 1e-6 for _, other in beside], axis=0)
    along = np.abs((normal * rays[:, 3:]).sum(axis=1))
    met = np.isfinite(depth)
    np.testing.assert_array_equal(inverse.ravel()[clear] > 0.0, met[clear])
    sure = clear & met & (along > 0.05 * np.linalg.norm(rays[:, 3:], axis=1))  # float32 rays, not grazing
    np.testing.assert_allclose(inverse.ravel()[sure] * depth[sure], 1.0, rtol=1e-4)
    np.testing.assert_allclose(plane_m.ravel()[sure], along[sure] * depth[sure], rtol=1e-3, atol=1e-5)


@LONG
@given(SEEDS, SIZES, st.integers(0, 12))
def test_a_closed_room_has_no_gaps(seed: int, size: tuple[int, int], cuts: int) -> None:
    camera = Camera(seed, size)
    vertices, triangles = CORNERS, WALLS
    for _ in range(cuts):  # a triangle becomes three around its middle
        n = camera.rng.integers(len(triangles))
        (a, b, c), new = triangles[n], len(vertices)
        vertices = np.concatenate([vertices, vertices[triangles[n]].mean(axis=0, keepdims=True)])
        three = np.array([[a, b, new], [b, c, new], [c, a, new]], np.int32)
        triangles = np.concatenate([np.delete(triangles, n, axis=0), three])
    inverse, plane_m = camera.draw(vertices, triangles)
    assert (inverse > 0.25 / np.sqrt(3.0) - 1e-6).all()  # the room's diagonal
    assert ((plane_m > 0.09) & (plane_m < 3.91)).all()


@LONG
@given(SEEDS)
def test_what_is_behind_or_has_no_area_or_is_not_finite_is_not_seen(seed: int) -> None:
    camera = Camera(seed, (21, 30))
    vertices, triangles = soup(camera.rng, 10)
    inverse, plane_m = camera.draw(vertices, triangles)
    rng, ahead = camera.rng, camera.rotation[:, 2]
    broken = rng.uniform(-3, 3, (3, 3, 3))
    for corner, value in zip(broken, (np.nan, np.inf, -np.inf), strict=True):
        corner[rng.integers(3), rng.integers(3)] = value
    start, way = rng.integers(-3, 3, (2, 3))
    added = [*broken, np.repeat(rng.uniform(-3, 3, (1, 3)), 3, axis=0), start + np.outer([0, 1, 2], way)]
    added.append(camera.position_m - 2.0 * ahead + rng.uniform(-1, 1, (3, 3)))
    more = len(vertices) + np.arange(3 * len(added), dtype=np.int32).reshape(-1, 3)
    again = camera.draw(
        np.concatenate([vertices, *added]).astype(np.float32), np.concatenate([triangles, more])
    )
    assert (again[0].tobytes(), again[1].tobytes()) == (inverse.tobytes(), plane_m.tobytes())


def test_a_scene_without_triangles_is_empty() -> None:
    image = Camera(0, (1, 1)).take(Scene.from_mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32)))
    assert image.inverse.item() == 0.0


@LONG
@given(SEEDS, st.integers(0, 3))
def test_rays_make_the_same_image_with_movers_too(seed: int, movers: int) -> None:
    camera = Camera(seed, (24, 32))
    scene = Scene.from_mesh(CORNERS, WALLS)
    scene.place(
        Bodies(
            time_s=0.0,
            shape=np.resize(np.array([Shape.SPHERE, Shape.CYLINDER, Shape.BOX], np.uint8), movers),
            half_size_m=np.full((movers, 3), 0.3),
            position_m=camera.position_m + camera.rng.uniform(0.5, 1.5, (movers, 1)) * camera.rotation[:, 2],
            velocity_mps=np.zeros((movers, 3)),
        )
    )
    drawn = camera.take(scene)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(true_depth, "TRIANGLES_PER_PIXEL", 0)
        cast = camera.take(scene)
    for one, other in ((drawn.inverse, cast.inverse), (drawn.plane_m, cast.plane_m)):
        differ = ~np.isclose(one, other, rtol=1e-3, atol=1e-5)
        assert differ.mean() < 0.01  # pixels whose middle lies on an edge
    assert (drawn.inverse > 0.0).all()
