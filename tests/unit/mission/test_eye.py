"""The inspecting camera by ideal rays and in depth images: what each counts as seen."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.logs import make_world
from tests.unit.mission.test_inspect_mission import START_M, begun, flown, seen_at, state
from uavexp.arrays import Bool, Float
from uavexp.geometry import multiply_quaternions, quaternion_from_yaw, rotation_from_quaternion
from uavexp.inspection.reference_surface import Surface
from uavexp.inspection.visibility import Camera
from uavexp.mission.eye import ImageEye, RayEye, lens_of
from uavexp.mission.inspect import Inspect
from uavexp.scene import Scene
from uavexp.sensor.depth_noise import error_bound_m, measure
from uavexp.types import Bodies, Shape

WALL_X_M = 3.0
EYE_M = np.array([0.0, 0.05, 1.55])
LEVEL = quaternion_from_yaw(0.0)
CAMERA = Camera()
TOLERANCE_M = 0.15


@pytest.fixture
def scene() -> Scene:
    return Scene(make_world([([WALL_X_M, -9.0, -6.0], [WALL_X_M + 0.2, 9.0, 9.0])]))


def wall_cells(x_m: float = WALL_X_M) -> Surface:
    y, z = (grid.ravel() for grid in np.meshgrid(np.arange(-5.9, 6.0, 0.2), np.arange(-3.9, 7.0, 0.2)))
    return Surface(
        point_m=np.stack([np.full(y.size, x_m), y, z], axis=1), normal=np.tile([-1.0, 0.0, 0.0], (y.size, 1)),
        area_m2=np.full(y.size, 0.04), curvature=np.zeros(y.size),
    )  # fmt: skip


def image_eye(scene: Scene, camera: Camera = CAMERA, width_px: int = 96, **noise: object) -> ImageEye:
    lens = lens_of(camera, width_px)
    for name, value in noise.items():
        setattr(lens, name, value)
    lens.reset(scene, np.random.default_rng(100))
    return ImageEye(lens=lens, camera=camera, tolerance_m=TOLERANCE_M)


def seen(eye: ImageEye | RayEye, cells: Surface, attitude: Float = LEVEL, frames: int = 1) -> Bool:
    found = np.zeros(len(cells), dtype=np.bool_)
    for _ in range(frames):
        eye.look(EYE_M, attitude, 0.0)
        found[eye.sees(cells, ~found)] = True
    return found


def on_image(cells: Surface, attitude: Float, inset: float = 0.0) -> Bool:
    """Cells inside the image by the pinhole's own angles, so many pixels from its edge at least."""
    ahead, left, up = ((cells.point_m - EYE_M) @ rotation_from_quaternion(attitude)).T
    fits = [
        np.abs(off) <= ahead * math.tan(0.5 * fov) * (1.0 - inset)
        for off, fov in ((left, CAMERA.horizontal_fov_rad), (up, CAMERA.vertical_fov_rad))
    ]
    return np.asarray((ahead > 0.0) & fits[0] & fits[1])


def within_limits(cells: Surface) -> Bool:
    line = cells.point_m - EYE_M
    length = np.linalg.norm(line, axis=1)
    return np.asarray((length <= CAMERA.max_range_m) & (line[:, 0] >= length * math.cos(math.radians(70.0))))


@pytest.mark.parametrize("tilt_deg", [0.0, 20.0, -25.0])
def test_an_image_shows_what_a_tilted_pinhole_frames(scene: Scene, tilt_deg: float) -> None:
    half = math.radians(0.5 * tilt_deg)
    roll = np.array([math.cos(half), math.sin(half), 0.0, 0.0])
    pitch = np.array([math.cos(half), 0.0, math.sin(half), 0.0])
    attitude = multiply_quaternions(multiply_quaternions(quaternion_from_yaw(0.2), pitch), roll)
    cells = wall_cells()
    found = seen(image_eye(scene), cells, attitude, frames=12)
    assert not found[~(on_image(cells, attitude, -0.01) & within_limits(cells))].any()
    sure = on_image(cells, attitude, 0.03) & within_limits(cells)
    sure &= np.linalg.norm(cells.point_m - EYE_M, axis=1) < 4.8  # beyond, noise makes it out of range
    assert sure.sum() > 100
    assert found[sure].all()


@pytest.mark.parametrize(("incidence_deg", "range_m"), [(35.0, 5.0), (70.0, 3.5)])
def test_an_image_keeps_the_limits_of_incidence_and_range(
    scene: Scene, incidence_deg: float, range_m: float
) -> None:
    camera, cells = Camera(max_incidence_rad=math.radians(incidence_deg), max_range_m=range_m), wall_cells()
    line = cells.point_m - EYE_M
    length = np.linalg.norm(line, axis=1)
    allowed = (line[:, 0] >= length * math.cos(math.radians(incidence_deg))) & (length <= range_m)
    found = seen(image_eye(scene, camera), cells, frames=30)
    assert not found[~allowed].any()
    assert found[allowed & (length < range_m - 0.2)].all()
    assert (allowed & (length < range_m - 0.2)).sum() > 30


def test_level_and_in_many_frames_image_and_rays_agree(scene: Scene) -> None:
    cells = wall_cells()
    rays = seen(RayEye(scene=scene, camera=CAMERA, tolerance_m=TOLERANCE_M), cells)
    image = seen(image_eye(scene), cells, frames=30)
    assert rays.sum() > 300
    assert (rays != image).mean() < 0.02


def test_a_person_hides_what_is_behind_in_the_image_too(scene: Scene) -> None:
    scene.place(
        Bodies(
            time_s=0.0, shape=np.array([Shape.CYLINDER], dtype=np.uint8),
            half_size_m=np.array([[0.3, 0.3, 9.0]]), position_m=np.array([[1.5, 0.05, 1.0]]),
            velocity_mps=np.zeros((1, 3)),
        )
    )  # fmt: skip
    cells = wall_cells()
    bearing = np.abs(np.arctan2(cells.point_m[:, 1] - EYE_M[1], WALL_X_M))
    found, shadow = seen(image_eye(scene), cells, frames=20), math.asin(0.3 / 1.5)
    pixel = 1.0 / image_eye(scene).lens.focal_px
    assert not found[bearing < shadow - pixel].any()
    clear = (bearing > shadow + 2.0 * pixel) & on_image(cells, LEVEL, 0.03) & within_limits(cells)
    assert found[clear & (np.linalg.norm(cells.point_m - EYE_M, axis=1) < 4.8)].all()


@pytest.mark.parametrize(("off_m", "expected"), [(-0.12, 1.0), (0.12, 1.0), (-0.4, 0.0), (0.4, 0.0)])
def test_the_depth_must_agree_within_tolerance_and_noise(scene: Scene, off_m: float, expected: float) -> None:
    cells = wall_cells(WALL_X_M + off_m)
    near = np.linalg.norm(cells.point_m[:, 1:] - EYE_M[1:], axis=1) < 1.0
    assert seen(image_eye(scene), cells)[near].mean() == expected


def test_without_noise_the_tolerance_alone_decides(scene: Scene) -> None:
    eye = image_eye(scene, axial_noise=False, quantisation=False)
    for off_m, expected in ((0.149, True), (0.151, False), (-0.149, True), (-0.151, False)):
        cells = wall_cells(WALL_X_M + off_m)
        near = np.linalg.norm(cells.point_m[:, 1:] - EYE_M[1:], axis=1) < 1.0
        assert (seen(eye, cells)[near] == expected).all()


def test_a_slanted_wall_is_not_missed_for_the_width_of_a_pixel() -> None:
    """At 65° off its normal a pixel of 16 to a row reaches farther than any tolerance."""
    turned = quaternion_from_yaw(math.radians(60.0))
    scene = Scene(make_world([([WALL_X_M, -90.0, -60.0], [WALL_X_M + 0.2, 90.0, 90.0])]))
    camera = Camera(max_range_m=20.0, max_incidence_rad=math.radians(75.0))
    eye = image_eye(scene, camera, 16, axial_noise=False, quantisation=False, edge_missing=False)
    cells = wall_cells()
    slanted = np.abs(np.degrees(np.arctan2(cells.point_m[:, 1], WALL_X_M)) - 62.0) < 1.0
    slanted &= np.abs(cells.point_m[:, 2] - EYE_M[2]) < 1.0
    assert slanted.sum() > 5
    assert seen(eye, cells, turned)[slanted].all()


def test_the_noise_counts_along_the_normal() -> None:
    """Exact images, judged by a noisy lens: off by 0.7 of the bound is shown square on, not on a slant."""
    scene = Scene(make_world([([WALL_X_M, -90.0, -60.0], [WALL_X_M + 0.2, 90.0, 90.0])]))
    camera = Camera(max_range_m=20.0, max_incidence_rad=math.radians(75.0))
    for yaw_deg, expected in ((0.0, True), (64.0, False)):
        eye = image_eye(scene, camera, axial_noise=False, quantisation=False, edge_missing=False)
        eye.look(EYE_M, quaternion_from_yaw(math.radians(yaw_deg)), 0.0)
        eye.lens.axial_noise, eye.lens.axial_noise_scale = True, 3.0
        depth_m = (WALL_X_M - EYE_M[0]) / math.cos(math.radians(yaw_deg))
        off_m = TOLERANCE_M + 0.7 * error_bound_m(depth_m, eye.lens.noise)
        aside_m = depth_m * math.sin(math.radians(yaw_deg))
        ahead = EYE_M + np.array([WALL_X_M - EYE_M[0], aside_m, 0.0])
        cell = Surface(
            point_m=ahead[None] + [off_m, 0.0, 0.0], normal=np.array([[-1.0, 0.0, 0.0]]),
            area_m2=np.ones(1), curvature=np.zeros(1),
        )  # fmt: skip
        assert (len(eye.sees(cell, np.ones(1, dtype=np.bool_))) == 1) is expected


def test_a_pixel_that_sees_beyond_range_shows_nothing_before_it() -> None:
    scene = Scene(make_world([([30.0, -90.0, -60.0], [30.2, 90.0, 90.0])]))
    assert not seen(image_eye(scene), wall_cells(), frames=3).any()


@pytest.mark.parametrize("depth_m", [0.5, 1.5, 3.0, 4.5])
def test_the_bound_holds_the_noise_and_little_more(depth_m: float) -> None:
    lens = lens_of(CAMERA, 96)
    rng, shape = np.random.default_rng(101), (200, 200)
    inverse, plane = np.full(shape, 1.0 / depth_m, np.float32), np.full(shape, depth_m, np.float32)
    gaussian = rng.standard_normal(shape, dtype=np.float32)
    measured = measure(inverse, plane, np.ones_like(inverse), gaussian, np.ones_like(inverse), lens.noise)
    finite = np.isfinite(measured)
    error_m = np.abs(measured[finite].astype(float) - depth_m)
    bound_m = error_bound_m(depth_m, lens.noise)
    assert (error_m <= bound_m).mean() > 0.997
    assert error_m.max() > 0.6 * bound_m


def test_the_lens_has_the_angles_and_the_range_of_the_camera() -> None:
    lens = lens_of(Inspect()._camera(), Inspect().image_width_px)
    assert (lens.width_px, lens.height_px) == (96, 72)
    assert (lens.min_range_m, lens.max_range_m, lens.rate_hz) == (0.2, 5.0, 20.0)
    narrow = lens_of(Camera(horizontal_fov_rad=0.8, vertical_fov_rad=0.6), 200)
    assert 2.0 * math.atan(0.5 * 200 / narrow.focal_px) == pytest.approx(0.8)
    assert 2.0 * math.atan(0.5 * narrow.height_px / narrow.focal_px) == pytest.approx(0.6, abs=0.005)


def test_with_images_the_vehicle_believes_what_they_showed_and_nothing_else() -> None:
    mission, guide = begun(seen_by="image")
    guide.select(seen_at(0.0, state(START_M)))
    assert not guide.scanned.any(), "a ray through the map tells nothing"
    mission.outcome(flown(0.0, 0.02, 0.05), seen_at(0.0, state(START_M)))
    seen_s = mission.findings().cell_seen_s
    assert guide.scanned.any()
    np.testing.assert_array_equal(guide.scanned, np.isfinite(seen_s))
    assert set(seen_s[np.isfinite(seen_s)]) <= {0.0, 0.05}, "20 frames a second"
