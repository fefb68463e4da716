"""What every sensor promises, camera or LiDAR, hovering in a closed building."""

from __future__ import annotations

from typing import Any

import numpy as np

from uavexp.arrays import Float, Float32
from uavexp.check.building import building, scene, scene_of
from uavexp.check.hall import hovering
from uavexp.check.promise import Make, keep, same, untouched
from uavexp.scan import RayScan, Scan
from uavexp.scene import Scene
from uavexp.seeding import Stream, generator
from uavexp.types import Bodies, Shape, State

_TIME_S = 1.5
_SURFACE_M = 0.1  # from a surface, of all but one in a hundred of the measured points
_BALL_M = 0.3
_AHEAD_M = np.array([1.3, 0.0, 0.0])  # from the vehicle to a mover


def _here() -> State:
    return hovering(building().start_m)


def _scan(make: Make, *, seed: int = 0, believed: State | None = None, where: Scene | None = None) -> Scan:
    sensor = make()
    sensor.reset(where or scene(), generator(seed, Stream.SENSOR))
    scan: Scan = sensor.capture(_here(), believed or _here(), _TIME_S)
    return scan


def _measured(scan: Scan) -> Float32:
    return scan.range_m if isinstance(scan, RayScan) else scan.depth_m


def _points_m(scan: Scan) -> Float:
    """The points (N, 3) of all returns, in the world."""
    if isinstance(scan, RayScan):
        returned = np.isfinite(scan.range_m)
        along = scan.range_m[returned, None].astype(np.float64) * scan.direction[returned]
        return np.asarray(scan.origin_m + along, dtype=np.float64)
    v, u = np.nonzero(np.isfinite(scan.depth_m))
    z = scan.depth_m[v, u].astype(np.float64)
    x, y = (u - scan.centre_px[0]) / scan.focal_px[0] * z, (v - scan.centre_px[1]) / scan.focal_px[1] * z
    local = np.stack([x, y, z], axis=1) @ scan.camera_rotation.T
    return np.asarray(scan.camera_position_m + local, dtype=np.float64)


def _with_mover(make: Make) -> tuple[Float, Float, Float]:
    """Points seen without and with a ball ahead, and the ball's centre (3,)."""
    centre = _here().position_m + _AHEAD_M
    before, place = _points_m(_scan(make)), scene()
    place.place(
        Bodies(
            time_s=_TIME_S,
            shape=np.array([Shape.SPHERE], np.uint8),
            half_size_m=np.full((1, 3), _BALL_M),
            position_m=centre[None],
            velocity_mps=np.zeros((1, 3)),
        )
    )
    try:
        return before, _points_m(_scan(make)), centre
    finally:
        place.place(Bodies.none())


def measures_a_distance_or_that_there_is_none(make: Make) -> None:
    """Finite values are > 0 and within range, +inf is beyond it, NaN is no measurement."""
    scan = _scan(make)
    values = _measured(scan)
    finite = values[np.isfinite(values)]
    keep(finite.size > 0, "nothing is measured in a closed room")
    keep(finite.min(initial=np.inf) > 0.0, f"a measurement of {finite.min(initial=np.inf)} m")
    farthest_m = finite.max(initial=0.0)
    keep(farthest_m <= scan.max_range_m, f"{farthest_m:.3f} m, the range is {scan.max_range_m:g} m")
    keep(not np.isneginf(values).any(), "a measurement of -inf")
    keep(scan.time_s == _TIME_S, f"a scan taken at {_TIME_S} s is of {scan.time_s} s")


def measures_points_on_surfaces(make: Make) -> None:
    """All but one in a hundred within a decimetre."""
    apart_m = float(np.quantile(scene().distance_m(_points_m(_scan(make))), 0.99))
    keep(apart_m < _SURFACE_M, f"a hundredth of the points are more than {apart_m:.3f} m from every surface")


def sees_a_mover(make: Make) -> None:
    """A ball of 0.3 m before it returns points on its surface."""
    _, seen, centre = _with_mover(make)
    on_it = int((np.abs(np.linalg.norm(seen - centre, axis=1) - _BALL_M) < _SURFACE_M).sum())
    keep(on_it > 0, "no point on a ball that is right before it")


def sees_nothing_behind_a_mover(make: Make) -> None:
    """A ball hides what its shadow falls on."""
    before, seen, centre = _with_mover(make)
    eye = _here().position_m

    def behind(points: Float) -> int:
        along = (points - eye) @ _AHEAD_M / np.linalg.norm(_AHEAD_M)
        aside = np.linalg.norm(points - eye - along[:, None] * _AHEAD_M / np.linalg.norm(_AHEAD_M), axis=1)
        far = along > np.linalg.norm(centre - eye) + 2.0 * _BALL_M
        return int((far & (aside < 0.5 * _BALL_M)).sum())

    keep(behind(seen) == 0, f"{behind(seen)} of {behind(before)} points behind a ball are still seen")


def carries_the_believed_pose_of_the_true_picture(make: Make) -> None:
    """What is measured depends on the truth, where it is put on the belief."""
    honest, yaw_rad, shift = _scan(make), 0.3, np.array([0.5, 0.0, 0.0])
    deceived = _scan(make, believed=hovering(_here().position_m + shift, yaw_rad))
    keep(
        np.array_equal(_measured(honest), _measured(deceived), equal_nan=True),
        "what is measured changes with what the vehicle believes",
    )
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    wanted = (_points_m(honest) - _here().position_m) @ turn.T + _here().position_m + shift
    apart_m = float(np.abs(_points_m(deceived) - wanted).max(initial=0.0))
    keep(apart_m < 1e-3, f"points are {apart_m:.3g} m from where a vehicle so deceived sees them")


def takes_the_same_scan_with_the_same_seed(make: Make) -> None:
    """To the last bit, also after a reset."""
    used = make()
    keep(same(_scan(make, seed=4), _scan(make, seed=4)), "another object measures otherwise")
    _scan(lambda: used, seed=5)
    keep(same(_scan(lambda: used, seed=4), _scan(make, seed=4)), "after a reset it measures otherwise")


def draws_as_much_whatever_it_sees(make: Make) -> None:
    """The noise of a scan does not depend on the scans before: two policies face the same noise."""
    left = []
    for place in (scene(), scene_of([])):
        sensor, rng = make(), generator(0, Stream.SENSOR)
        sensor.reset(place, rng)
        sensor.capture(_here(), _here(), 0.0)
        left.append(rng.random())
    keep(left[0] == left[1], "its generator stands elsewhere after a scan of empty space")


def writes_into_nothing_it_is_given(make: Make) -> None:
    """True and believed state are the trial's own."""
    sensor, here, believed = make(), _here(), hovering((0.5, 0.5, 1.0))
    sensor.reset(scene(), generator(0, Stream.SENSOR))
    with untouched(true_state=here, estimated_state=believed):
        sensor.capture(here, believed, _TIME_S)


def has_a_rate(make: Make) -> None:
    """Scans a second."""
    rate_hz: Any = make().rate_hz
    keep(0.0 < rate_hz < np.inf, f"rate_hz is {rate_hz}")
