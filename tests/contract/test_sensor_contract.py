"""What every sensor option keeps."""

from __future__ import annotations

import numpy as np
import pytest

from tests.components import build, check_yaml, numbers, options
from tests.logs import make_world
from uavexp.errors import ConfigError
from uavexp.geometry import quaternion_from_yaw
from uavexp.scene import Scene
from uavexp.seeding import Stream, generator
from uavexp.types import State

pytestmark = pytest.mark.parametrize("option", options("sensor"))


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene(
        make_world(
            [
                ([-5.0, -5.0, -0.1], [5.0, 5.0, 0.0]),
                ([2.5, -5.0, 0.0], [2.6, 5.0, 3.0]),
                ([1.0, 0.3, 0.0], [1.3, 0.9, 2.0]),
            ]
        )
    )


def pose(x_m: float = 0.0, yaw_rad: float = 0.0) -> State:
    return State(
        position_m=np.array([x_m, 0.0, 1.2]),
        velocity_mps=np.zeros(3),
        quaternion_wxyz=quaternion_from_yaw(yaw_rad),
        body_rate_radps=np.zeros(3),
    )


def scan_of(option, scene, seed=0, state=None, believed=None):
    sensor, state = build("sensor", option), state or pose()
    sensor.reset(scene, generator(seed, Stream.SENSOR))
    return sensor.capture(state, believed or state, 1.5)


def test_yaml_lists_every_parameter(option):
    check_yaml("sensor", option)


def test_depths_are_positive_beyond_or_missing(option, scene):
    scan = scan_of(option, scene)
    finite = scan.depth_m[np.isfinite(scan.depth_m)]
    assert finite.size > 0.5 * scan.depth_m.size
    assert finite.min() > 0.0
    assert finite.max() <= scan.max_range_m
    assert not np.isneginf(scan.depth_m).any()
    assert scan.time_s == 1.5


def test_measured_points_lie_on_the_surfaces(option, scene):
    scan = scan_of(option, scene)
    v, u = np.nonzero(np.isfinite(scan.depth_m))
    z = scan.depth_m[v, u].astype(np.float64)
    x, y = (u - scan.centre_px[0]) / scan.focal_px[0] * z, (v - scan.centre_px[1]) / scan.focal_px[1] * z
    points = scan.camera_position_m + np.stack([x, y, z], axis=1) @ scan.camera_rotation.T
    assert np.quantile(scene.distance_m(points), 0.99) < 0.1


def test_scan_carries_the_believed_pose_of_the_true_picture(option, scene):
    honest = scan_of(option, scene)
    deceived = scan_of(option, scene, believed=pose(x_m=0.5, yaw_rad=0.3))
    np.testing.assert_array_equal(honest.depth_m, deceived.depth_m)
    np.testing.assert_allclose(deceived.camera_position_m - honest.camera_position_m, [0.5, 0.0, 0.0])
    turn = deceived.camera_rotation @ honest.camera_rotation.T
    assert np.arccos(0.5 * (np.trace(turn) - 1.0)) == pytest.approx(0.3)


def test_same_seed_same_bytes_other_seed_other_noise(option, scene):
    first, again, other = (scan_of(option, scene, seed=s).depth_m for s in (4, 4, 5))
    assert first.tobytes() == again.tobytes()
    assert first.tobytes() != other.tobytes()


def test_draws_do_not_depend_on_what_is_seen(option, scene):
    left = []
    for seen in (scene, Scene(make_world([([-50.0, -50.0, -50.0], [-49.0, -49.0, -49.0])]))):
        sensor, rng = build("sensor", option), generator(0, Stream.SENSOR)
        sensor.reset(seen, rng)
        sensor.capture(pose(), pose(), 0.0)
        left.append(rng.random())
    assert left[0] == left[1]


@pytest.mark.parametrize("value", [-1000.0, float("nan"), float("inf")])
def test_refuses_bad_numbers(option, value):
    for name in numbers(build("sensor", option)):
        with pytest.raises(ConfigError, match=r"must .*got"):
            build("sensor", option, **{name: value})
