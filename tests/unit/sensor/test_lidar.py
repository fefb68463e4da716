"""LiDARs: where their rays go, and the noise of their ranges."""

from __future__ import annotations

import numpy as np
import pytest

from tests.logs import make_world
from uavexp.errors import ConfigError
from uavexp.geometry import quaternion_from_yaw
from uavexp.scene import Scene
from uavexp.seeding import Stream, generator
from uavexp.sensor.lidar_rosette import LidarRosette, rosette
from uavexp.sensor.lidar_spinning import LidarSpinning
from uavexp.types import State

WALL = Scene(make_world([([4.0, -50.0, -50.0], [4.2, 50.0, 50.0])]))
FIELD_DEG, RATES_HZ = 38.4, (121.57, -77.73)


def hover(yaw_rad: float = 0.0) -> State:
    return State(
        position_m=np.zeros(3),
        velocity_mps=np.zeros(3),
        quaternion_wxyz=quaternion_from_yaw(yaw_rad),
        body_rate_radps=np.zeros(3),
    )


def capture(sensor, time_s=0.0, scene=WALL, state=None):
    sensor.reset(scene, generator(0, Stream.SENSOR))
    return sensor.capture(state or hover(), state or hover(), time_s)


def degrees_off_axis(direction):
    return np.degrees(np.arccos(np.clip(direction[:, 0], -1.0, 1.0)))


def test_the_rosette_fills_a_circle_of_the_stated_field_and_no_more():
    off = degrees_off_axis(rosette(np.arange(0.0, 1.0, 1e-5), FIELD_DEG, RATES_HZ))
    assert off.max() == pytest.approx(19.2, abs=0.01)
    assert off.min() < 0.1


def test_the_rosette_leaves_at_the_sum_of_both_deflections():
    times = np.random.default_rng(0).uniform(0.0, 10.0, 200)
    first, second = (2.0 * np.pi * rate * times for rate in RATES_HZ)
    # two unit vectors at angles a and b add to one of length 2 |cos((a - b) / 2)| at (a + b) / 2
    off = 19.2 * np.abs(np.cos(0.5 * (first - second)))
    direction = rosette(times, FIELD_DEG, RATES_HZ)
    np.testing.assert_allclose(degrees_off_axis(direction), off, atol=2e-3)
    np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1.0, atol=1e-6)
    across = direction[:, 1] * np.sin(0.5 * (first + second)) - direction[:, 2] * np.cos(
        0.5 * (first + second)
    )
    np.testing.assert_allclose(across, 0.0, atol=1e-6)


def share_covered(times):
    """Share of cells of one degree in the circle that have a ray."""
    direction = rosette(times, FIELD_DEG, RATES_HZ)
    left, up = (
        np.degrees(np.arctan2(direction[:, 1], direction[:, 0])),
        np.degrees(np.arcsin(direction[:, 2])),
    )
    cells = np.unique(np.floor(np.stack([left, up], axis=1)), axis=0) + 0.5
    return (np.hypot(*cells.T) < 18.5).sum() / (np.pi * 18.5**2)


def test_the_rosette_does_not_repeat_and_covers_ever_more():
    points = np.arange(5000) / 50_000
    first, later = (rosette(start + points, FIELD_DEG, RATES_HZ) for start in (0.0, 0.1))
    assert np.linalg.norm(first - later, axis=1).mean() > 0.05
    covered = [share_covered(np.arange(scans * 5000) / 50_000) for scans in (1, 2, 5)]
    assert covered[0] < covered[1] < covered[2]
    assert covered[2] > 0.9


def test_scans_of_the_rosette_follow_the_clock():
    one, two = (capture(LidarRosette(range_noise_m=0.0), time_s) for time_s in (0.0, 0.1))
    assert not np.array_equal(one.direction, two.direction)
    assert (degrees_off_axis(one.direction) <= 19.21).all()
    assert one.direction.shape == (5000, 3)


def test_the_spinning_one_has_rings_all_around_and_a_level_one():
    scan = capture(LidarSpinning(range_noise_m=0.0))
    elevation = np.degrees(np.arcsin(scan.direction[:, 2].astype(np.float64)))
    rings, counts = np.unique(elevation.round(3), return_counts=True)
    np.testing.assert_allclose(rings, np.arange(-20.0, 10.1, 2.0), atol=1e-3)
    assert (counts == 360).all()
    azimuth = np.degrees(np.arctan2(scan.direction[:, 1], scan.direction[:, 0]))
    assert np.unique(azimuth.round(2) % 360.0).size == 360


@pytest.mark.parametrize("sensor", [LidarSpinning(range_noise_m=0.0), LidarRosette(range_noise_m=0.0)])
def test_ranges_to_a_wall_are_the_closed_form(sensor):
    yaw = 0.2
    scan = capture(sensor, state=hover(yaw))
    along = scan.direction[:, 0].astype(np.float64)
    true = np.where(along > 0.0, 4.0 / np.maximum(along, 1e-9), np.inf)
    np.testing.assert_allclose(scan.range_m[true < 11.9], true[true < 11.9], rtol=1e-4)
    assert np.isinf(scan.range_m[true > 12.1]).all()
    axis = scan.direction[degrees_off_axis(scan.direction @ rotation(yaw)).argmin()]
    np.testing.assert_allclose(axis, [np.cos(yaw), np.sin(yaw), 0.0], atol=0.02)


def rotation(yaw_rad):
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def test_pitch_points_the_forward_axis_up_and_the_offset_goes_with_the_body():
    sensor = LidarRosette(mount_pitch_deg=30.0, mount_offset_m=(0.1, 0.0, 0.05), range_noise_m=0.0)
    scan = capture(sensor, state=hover(np.pi / 2.0))
    np.testing.assert_allclose(scan.origin_m, [0.0, 0.1, 0.05], atol=1e-12)
    mean = scan.direction.mean(axis=0) / np.linalg.norm(scan.direction.mean(axis=0))
    np.testing.assert_allclose(mean, [0.0, np.cos(np.pi / 6.0), 0.5], atol=0.02)


def test_range_noise_has_the_stated_size_and_missing_returns_the_stated_share():
    sensor = LidarSpinning(range_noise_m=0.05, missing_probability=0.2)
    scan = capture(sensor)
    along = scan.direction[:, 0].astype(np.float64)
    hit = (along > 0.5) & np.isfinite(scan.range_m)
    error = scan.range_m[hit] - 4.0 / along[hit]
    assert error.std() == pytest.approx(0.05, rel=0.05)
    assert abs(error.mean()) < 0.005
    assert np.isnan(scan.range_m).mean() == pytest.approx(0.2, abs=0.02)


def test_nearer_than_the_least_range_is_no_measurement():
    near = Scene(make_world([([0.2, -5.0, -5.0], [0.25, 5.0, 5.0])]))
    scan = capture(LidarRosette(min_range_m=0.5, range_noise_m=0.0), scene=near)
    assert np.isnan(scan.range_m).all()


@pytest.mark.parametrize(
    ("cls", "wrong"),
    [
        (LidarSpinning, {"rings": 1}),
        (LidarSpinning, {"azimuths": 2.5}),
        (LidarSpinning, {"lowest_deg": 20.0}),
        (LidarRosette, {"points_per_scan": 0}),
        (LidarRosette, {"field_of_view_deg": 180.0}),
        (LidarRosette, {"second_prism_hz": 0.0}),
        (LidarRosette, {"min_range_m": 12.0}),
        (LidarSpinning, {"missing_probability": 1.0}),
        (LidarSpinning, {"mount_offset_m": (0.0, 0.0)}),
    ],
    ids=str,
)
def test_bad_parameters_are_refused_by_name(cls, wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        cls(**wrong)
