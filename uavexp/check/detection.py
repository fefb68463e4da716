"""What every detection promises, in a room that two boxes cross before a LiDAR."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from uavexp.arrays import Float
from uavexp.check.fields import box, empty, field_from
from uavexp.check.hall import LIMITS
from uavexp.check.promise import Make, keep, same, untouched
from uavexp.check.scans import Box, ring_directions, take_ray_scan
from uavexp.field import DistanceField
from uavexp.scan import RayScan
from uavexp.types import Bodies, Shape, Tracks

_ROOM: list[Box] = [
    ((-0.2, -0.2, -0.2), (0.2, 6.2, 3.2)),
    ((7.8, -0.2, -0.2), (8.2, 6.2, 3.2)),
    ((-0.2, -0.2, -0.2), (8.2, 0.2, 3.2)),
    ((-0.2, 5.8, -0.2), (8.2, 6.2, 3.2)),
    ((-0.2, -0.2, -0.2), (8.2, 6.2, 0.1)),
    ((-0.2, -0.2, 2.9), (8.2, 6.2, 3.2)),
]
_HALF_M = np.array([0.3, 0.3, 0.85])
_START_M = np.array([[4.0, 1.2, 0.86], [6.5, 4.5, 0.86]])
_VELOCITY_MPS = np.array([[0.0, 1.0, 0.0], [-0.6, 0.0, 0.0]])


@functools.cache
def _map() -> DistanceField:
    """The room as a perfect map knows it: empty."""
    grid = empty((8.0, 6.0, 3.0))
    for low, high in _ROOM:
        box(grid, low, high)
    return field_from(grid, max_distance_m=2.0)


def _bodies(time_s: float) -> Bodies:
    return Bodies(
        time_s=time_s,
        shape=np.full(2, int(Shape.BOX), dtype=np.uint8),
        half_size_m=np.tile(_HALF_M, (2, 1)),
        position_m=_START_M + time_s * _VELOCITY_MPS,
        velocity_mps=_VELOCITY_MPS.copy(),
    )


@functools.cache
def _scans() -> tuple[tuple[RayScan, Bodies], ...]:
    """1.5 s of scans, ten a second, with two centimetres of noise."""
    noise, directions = np.random.default_rng(1), ring_directions(24, 360)
    return tuple(_seen(0.1 * tick, directions, noise) for tick in range(15))


def _seen(time_s: float, directions: Float, noise: np.random.Generator) -> tuple[RayScan, Bodies]:
    bodies = _bodies(time_s)
    boxes = [(tuple(middle - _HALF_M), tuple(middle + _HALF_M)) for middle in bodies.position_m]
    scan = take_ray_scan([*_ROOM, *boxes], (1.0, 3.0, 1.2), directions, time_s=time_s, noise=noise)
    return scan, bodies


def _detected(detection: Any) -> list[tuple[RayScan, Tracks]]:
    detection.reset(LIMITS, np.random.default_rng(0))
    return [detection.detect(scan, _map(), bodies) for scan, bodies in _scans()]


def takes_returns_out_of_the_scan_and_adds_none(make: Make) -> None:
    """What is left in it is as it was measured."""
    for (before, _), (after, _) in zip(_scans(), _detected(make()), strict=True):
        kept = ~np.isnan(after.range_m)
        changed = int((after.range_m[kept] != before.range_m[kept]).sum())
        keep(changed == 0, f"{changed} ranges of the scan of {before.time_s:.1f} s were changed")
        as_before = np.array_equal(after.direction, before.direction) and after.time_s == before.time_s
        keep(as_before, f"the scan of {before.time_s:.1f} s has other rays or another time")


def tells_tracks_apart(make: Make) -> None:
    """At the scan's time, each with an identity of its own."""
    for (scan, _), (_, tracks) in zip(_scans(), _detected(make()), strict=True):
        keep(tracks.time_s == scan.time_s, f"tracks of {tracks.time_s} s with the scan of {scan.time_s} s")
        own = len(set(tracks.identity.tolist()))
        keep(own == len(tracks), f"{len(tracks)} tracks have {own} identities at {scan.time_s:.1f} s")


def believes_in_finite_tracks(make: Make) -> None:
    """Finite numbers, sizes >= 0, covariances symmetric and without a negative eigenvalue."""
    for _, tracks in _detected(make()):
        at = f"at {tracks.time_s:.1f} s"
        for name in ("position_m", "velocity_mps", "covariance", "half_size_m"):
            keep(np.isfinite(getattr(tracks, name)).all(), f"{name} is not finite {at}")
        smallest_m = tracks.half_size_m.min(initial=0.0)
        keep(smallest_m >= 0.0, f"a half size of {smallest_m} m {at}")
        skew = np.abs(tracks.covariance - tracks.covariance.transpose(0, 2, 1)).max(initial=0.0)
        keep(skew < 1e-6, f"a covariance is not symmetric by {skew:.3g} {at}")
        least = np.linalg.eigvalsh(tracks.covariance).min(initial=0.0)
        keep(least >= -1e-9, f"a covariance has the eigenvalue {least:.3g} {at}")


def forgets_the_last_trial_at_a_reset(make: Make) -> None:
    """Same scans, same generator, same bits."""
    used = make()
    _detected(used)
    for (scan, _), one, other in zip(_scans(), _detected(used), _detected(make()), strict=True):
        keep(same(one, other), f"the scan of {scan.time_s:.1f} s is split otherwise in a second trial")


def writes_into_nothing_it_is_given(make: Make) -> None:
    """Scan, map and bodies are the trial's own."""
    detection = make()
    detection.reset(LIMITS, np.random.default_rng(0))
    for scan, bodies in _scans():
        with untouched(scan=scan, field=_map(), truth=bodies):
            detection.detect(scan, _map(), bodies)
