"""The depth camera against plane geometry, and each noise term against its own formula."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hydra.utils import instantiate
from omegaconf import OmegaConf

from tests.logs import make_world
from uavexp.errors import ConfigError
from uavexp.geometry import multiply_quaternions, quaternion_from_yaw
from uavexp.scene import Scene
from uavexp.sensor.rgbd import Rgbd
from uavexp.types import State

QUIET = {"axial_noise": False, "quantisation": False, "edge_missing": False, "grazing_missing": False}


def scene_of(*boxes) -> Scene:
    return Scene(make_world([([*map(float, low)], [*map(float, high)]) for low, high in boxes]))


def wall(x_m: float) -> Scene:
    return scene_of(((x_m, -50, -50), (x_m + 1, 50, 50)))


FLOOR = scene_of(((-50, -50, -1), (50, 50, 0)))


def pose(position=(0.0, 0.0, 0.0), quaternion=None) -> State:
    return State(
        position_m=np.array(position, dtype=np.float64),
        velocity_mps=np.zeros(3),
        quaternion_wxyz=quaternion_from_yaw(0.0) if quaternion is None else quaternion,
        body_rate_radps=np.zeros(3),
    )


def scan_of(scene, state=None, seed=0, **parameters):
    sensor, state = Rgbd(**parameters), state or pose()
    sensor.reset(scene, np.random.default_rng(seed))
    return sensor.capture(state, state, 0.0)


def world_points(scan):
    """World points (N, 3) of every finite pixel, by the pinhole model written out again."""
    v, u = np.nonzero(np.isfinite(scan.depth_m))
    z = scan.depth_m[v, u].astype(np.float64)
    x = (u - scan.centre_px[0]) / scan.focal_px[0] * z
    y = (v - scan.centre_px[1]) / scan.focal_px[1] * z
    return scan.camera_position_m + np.stack([x, y, z], axis=1) @ scan.camera_rotation.T


def test_depth_is_along_the_optical_axis():
    depth = scan_of(wall(3.0), **QUIET).depth_m
    np.testing.assert_allclose(depth, 3.0, rtol=1e-5)


def test_a_floor_has_the_depth_of_its_row():
    scan = scan_of(FLOOR, pose((0, 0, 1.0)), max_range_m=200.0, **QUIET)
    rows = np.arange(72) - scan.centre_px[1]
    below = rows > 0
    wanted = scan.focal_px[1] / rows[below]
    near = wanted < 40.0  # where the floor ends
    np.testing.assert_allclose(scan.depth_m[below][near], np.tile(wanted[near, None], (1, 96)), rtol=1e-4)
    assert np.isposinf(scan.depth_m[~below]).all()


def test_the_field_of_view_ends_at_the_outer_pixel_edges():
    scan = scan_of(wall(2.0), horizontal_fov_deg=90.0, **QUIET)
    y = world_points(scan)[:, 1]
    pixel = 2.0 / scan.focal_px[0]
    assert y.max() + 0.5 * pixel == pytest.approx(2.0, rel=1e-5)  # tan 45 deg
    assert y.min() - 0.5 * pixel == pytest.approx(-2.0, rel=1e-5)


def test_left_is_left_and_up_is_up():
    back = ((4, -50, -50), (4.5, 50, 50))
    left = scan_of(scene_of(back, ((2, 0.5, -9), (2.2, 9, 9))), **QUIET).depth_m
    assert left[:, :20].max() < 2.1
    assert left[:, -20:].min() > 3.9
    above = scan_of(scene_of(back, ((2, -9, 0.5), (2.2, 9, 9))), **QUIET).depth_m
    assert above[:15].max() < 2.1
    assert above[-15:].min() > 3.9


def test_points_lie_on_the_geometry_from_any_pose_and_mount():
    scene = scene_of(((-4, -4, -1), (4, 4, 0)), ((2, -4, 0), (2.2, 4, 3)), ((-1, 1.5, 0), (1, 1.7, 2)))
    roll = np.array([np.cos(0.1), np.sin(0.1), 0.0, 0.0])
    for yaw in (0.0, 1.0, 2.5):
        state = pose((-0.5, -0.3, 1.2), multiply_quaternions(quaternion_from_yaw(yaw), roll))
        scan = scan_of(scene, state, mount_offset_m=(0.1, 0.05, -0.03), mount_pitch_deg=-20.0, **QUIET)
        points = world_points(scan)
        assert len(points) > 1000
        assert scene.distance_m(points).max() < 1e-4


def test_a_positive_mount_pitch_looks_up():
    forward = scan_of(FLOOR, pose((0, 0, 1)), mount_pitch_deg=30.0, **QUIET).camera_rotation[:, 2]
    np.testing.assert_allclose(forward, [np.cos(np.radians(30)), 0.0, 0.5], atol=1e-12)
    offset = scan_of(
        FLOOR, pose((0, 0, 1), quaternion_from_yaw(np.pi / 2)), mount_offset_m=(0.2, 0, 0), **QUIET
    )
    np.testing.assert_allclose(offset.camera_position_m, [0.0, 0.2, 1.0], atol=1e-12)


@pytest.mark.parametrize("depth_m", [0.5, 1.5, 3.0, 4.5])
def test_axial_noise_is_nguyens(depth_m):
    scan = scan_of(wall(depth_m), **(QUIET | {"axial_noise": True}))
    error = scan.depth_m[np.isfinite(scan.depth_m)].astype(np.float64) - depth_m
    assert error.size == 96 * 72
    sigma = 0.0012 + 0.0019 * (depth_m - 0.4) ** 2
    assert error.std() == pytest.approx(sigma, rel=0.04)
    assert abs(error.mean()) < 4.0 * sigma / np.sqrt(error.size)


def test_quantised_depths_have_whole_disparity_steps():
    scan = scan_of(FLOOR, pose((0, 0, 0.7)), **(QUIET | {"quantisation": True}))
    depth = scan.depth_m[np.isfinite(scan.depth_m)].astype(np.float64)
    steps = 580.0 * 0.075 / depth / 0.125
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-3)
    exact = scan_of(FLOOR, pose((0, 0, 0.7)), **QUIET).depth_m
    both = np.isfinite(exact) & np.isfinite(scan.depth_m)
    half_step = 0.5 * exact[both] ** 2 * 0.125 / (580.0 * 0.075)
    assert (np.abs(scan.depth_m[both] - exact[both]) < 1.05 * half_step + 1e-5).all()


@pytest.mark.parametrize("beam", [((2, -0.4, -50), (2.2, 0.4, 50)), ((2, -50, -0.4), (2.2, 50, 0.4))])
def test_returns_are_missing_at_depth_edges_and_nowhere_else(beam):
    scene = scene_of(((4, -50, -50), (4.5, 50, 50)), beam)
    exact = scan_of(scene, **QUIET).depth_m
    depth = scan_of(scene, **(QUIET | {"edge_missing": True, "edge_missing_probability": 1.0})).depth_m
    edge = np.zeros(exact.shape, bool)
    for axis in (0, 1):
        near = np.moveaxis(edge, axis, 0)
        jump = np.abs(np.diff(np.moveaxis(exact, axis, 0), axis=0)) > 1.0  # between neighbours
        near[:-1] |= jump
        near[1:] |= jump
    np.testing.assert_array_equal(np.isnan(depth), edge)
    half = scan_of(scene, **(QUIET | {"edge_missing": True, "edge_missing_probability": 0.5})).depth_m
    assert np.isnan(half[edge]).mean() == pytest.approx(0.5, abs=0.1)


def test_a_floor_is_no_edge_however_steep():
    depth = scan_of(
        FLOOR, pose((0, 0, 0.3)), **(QUIET | {"edge_missing": True, "edge_missing_probability": 1.0})
    ).depth_m
    assert not np.isnan(depth).any()


def test_returns_are_missing_beyond_the_grazing_angle():
    state, limit = pose((0, 0, 0.5)), 80.0
    exact = scan_of(FLOOR, state, **QUIET)
    depth = scan_of(FLOOR, state, **(QUIET | {"grazing_missing": True, "grazing_angle_deg": limit})).depth_m
    v, u = np.nonzero(np.isfinite(exact.depth_m))
    way = world_points(exact) - exact.camera_position_m
    incidence = np.degrees(np.arccos(0.5 / np.linalg.norm(way, axis=1)))
    assert (incidence > limit).any()
    clear = np.abs(incidence - limit) > 0.01
    np.testing.assert_array_equal(np.isnan(depth[v, u])[clear], (incidence > limit)[clear])
    assert not np.isnan(depth[np.isposinf(exact.depth_m)]).any()


def test_beyond_range_is_inf_and_too_near_is_nan():
    assert np.isposinf(scan_of(wall(5.5)).depth_m).all()
    assert np.isposinf(scan_of(wall(-9.0)).depth_m).all()  # nothing in view
    assert np.isnan(scan_of(wall(0.15)).depth_m).all()
    assert (scan_of(wall(1e-6), min_range_m=0.0, **QUIET).depth_m < 2e-6).all()  # all but on the surface
    # what holds the camera is seen edge-on, that is not at all; its other side is
    assert (scan_of(wall(0.0), min_range_m=0.0, **QUIET).depth_m == 1.0).all()


def test_same_seed_same_image_and_switches_do_not_shift_the_stream():
    noisy = [scan_of(wall(3.0), seed=7).depth_m for _ in range(2)]
    assert noisy[0].tobytes() == noisy[1].tobytes()
    left = []
    for parameters in ({}, QUIET):
        sensor, rng = Rgbd(**parameters), np.random.default_rng(0)
        sensor.reset(wall(3.0), rng)
        sensor.capture(pose(), pose(), 0.0)
        left.append(rng.random())
    assert left[0] == left[1]


def test_scans_already_returned_do_not_change():
    sensor = Rgbd()
    sensor.reset(wall(3.0), np.random.default_rng(0))
    first = sensor.capture(pose(), pose(), 0.0)
    kept = first.depth_m.copy()
    sensor.capture(pose((1.0, 0.0, 0.0)), pose(), 0.05)
    np.testing.assert_array_equal(first.depth_m, kept)


def test_lists_of_hydra_are_taken():
    sensor = instantiate(
        OmegaConf.create({"_target_": "uavexp.sensor.rgbd.Rgbd", "mount_offset_m": [0.1, 0.0, 0.0]})
    )
    sensor.reset(wall(3.0), np.random.default_rng(0))
    np.testing.assert_allclose(sensor.capture(pose(), pose(), 0.0).camera_position_m, [0.1, 0.0, 0.0])


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"width_px": 1}, "width_px must be 2 to 4096, got 1"),
        ({"height_px": 72.5}, "height_px must be a whole number, got 72.5"),
        ({"horizontal_fov_deg": 180.0}, "horizontal_fov_deg must be 1 to 170, got 180.0"),
        ({"min_range_m": 6.0}, "min_range_m must be < max_range_m = 5.0, got 6.0"),
        ({"mount_offset_m": [0.0, float("nan"), 0.0]}, r"mount_offset_m[1] must be finite, got nan"),
        ({"mount_offset_m": [0.0, 0.0]}, "mount_offset_m must be [a number, a number, a number], got"),
        ({"edge_missing_probability": 1.5}, "edge_missing_probability must be 0 to 1, got 1.5"),
        ({"grazing_angle_deg": 0.0}, "grazing_angle_deg must be > 0 and <= 90, got 0.0"),
    ],
)
def test_refuses_bad_parameters(parameters, message):
    with pytest.raises(ConfigError, match=re.escape(message)):
        Rgbd(**parameters)
