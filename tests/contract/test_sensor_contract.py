"""What every sensor option keeps."""

from __future__ import annotations

import numpy as np
import pytest

from tests.components import build, numbers, options
from tests.logs import make_world
from uavexp.errors import ConfigError
from uavexp.geometry import quaternion_from_yaw
from uavexp.scene import Scene
from uavexp.seeding import Stream, generator
from uavexp.types import Bodies, RayScan, Scan, Shape, State

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


def measured(scan: Scan) -> np.ndarray:
    """What was measured: depths or ranges."""
    return scan.range_m if isinstance(scan, RayScan) else scan.depth_m


def points_of(scan: Scan) -> np.ndarray:
    """The points (N, 3) of all returns, in the world."""
    if isinstance(scan, RayScan):
        returned = np.isfinite(scan.range_m)
        return scan.origin_m + scan.range_m[returned, None].astype(np.float64) * scan.direction[returned]
    v, u = np.nonzero(np.isfinite(scan.depth_m))
    z = scan.depth_m[v, u].astype(np.float64)
    x, y = (u - scan.centre_px[0]) / scan.focal_px[0] * z, (v - scan.centre_px[1]) / scan.focal_px[1] * z
    return scan.camera_position_m + np.stack([x, y, z], axis=1) @ scan.camera_rotation.T


def test_measurements_are_positive_beyond_or_missing(option, scene):
    scan = scan_of(option, scene)
    values = measured(scan)
    finite = values[np.isfinite(values)]
    assert finite.size > 0.3 * values.size
    assert finite.min() > 0.0
    assert finite.max() <= scan.max_range_m
    assert not np.isneginf(values).any()
    assert scan.time_s == 1.5


def test_measured_points_lie_on_the_surfaces(option, scene):
    points = points_of(scan_of(option, scene))
    assert np.quantile(scene.distance_m(points), 0.99) < 0.1


def test_a_mover_is_seen_and_hides_what_is_behind_it(option, scene):
    before = points_of(scan_of(option, scene))
    ball = Bodies(
        time_s=1.5,
        shape=np.array([Shape.SPHERE], np.uint8),
        half_size_m=np.full((1, 3), 0.3),
        position_m=np.array([[1.5, 0.0, 1.2]]),
        velocity_mps=np.zeros((1, 3)),
    )
    scene.place(ball)
    try:
        seen = points_of(scan_of(option, scene))
    finally:
        scene.place(Bodies.none())
    gap = np.linalg.norm(seen - ball.position_m, axis=1) - 0.3
    assert (np.abs(gap) < 0.1).sum() > 20
    behind, hidden = (
        ((points[:, 0] > 2.4) & (np.hypot(points[:, 1], points[:, 2] - 1.2) < 0.4)).sum()
        for points in (before, seen)
    )
    assert behind > 20
    assert hidden == 0


def test_scan_carries_the_believed_pose_of_the_true_picture(option, scene):
    honest = scan_of(option, scene)
    deceived = scan_of(option, scene, believed=pose(x_m=0.5, yaw_rad=0.3))
    np.testing.assert_array_equal(measured(honest), measured(deceived))
    # the same points, turned about the vehicle and shifted with it
    c, s = np.cos(0.3), np.sin(0.3)
    turned = points_of(honest) @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]).T
    np.testing.assert_allclose(points_of(deceived), turned + np.array([0.5, 0.0, 0.0]), atol=1e-5)


def test_same_seed_same_bytes_other_seed_other_noise(option, scene):
    first, again, other = (measured(scan_of(option, scene, seed=s)) for s in (4, 4, 5))
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
