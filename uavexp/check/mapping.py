"""What every map promises, whether it fuses scans or knows the building from the start."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from uavexp.arrays import Float
from uavexp.check.building import scene_of
from uavexp.check.fields import field_from
from uavexp.check.promise import Make, keep, same, untouched
from uavexp.check.scans import Box, take_scan
from uavexp.errors import WorldError
from uavexp.field import OCCUPIED, UNKNOWN
from uavexp.scan import DepthScan
from uavexp.types import MapUpdate

_BOUNDS_M = np.array([[0.0, 0.0, 0.0], [8.0, 6.0, 3.0]])
_START_M = np.array([0.55, 3.05, 1.45])
_BUBBLE_M = 0.4
_WALL_M = 5.02  # x of the near face of the wall ahead
_ROOM: list[Box] = [
    ((-0.6, -0.6, -0.6), (8.6, 6.6, 0.05)),
    ((_WALL_M, -0.6, -0.6), (8.6, 6.6, 3.6)),
    ((2.4, 1.1, 0.0), (3.1, 2.0, 1.7)),
    ((3.3, 3.9, 0.0), (3.7, 5.2, 2.6)),
]


def _begun(make: Make) -> Any:
    backend = make()
    backend.reset(_BOUNDS_M, scene_of(_ROOM))
    return backend


def _scan(number: int, noise: np.random.Generator | None = None) -> DepthScan:
    """The room from a slow flight past its things."""
    position = (0.5 + 0.03 * number, 3.0 + 0.02 * number, 1.4)
    turn = {"yaw_rad": 0.4 * np.sin(0.4 * number), "pitch_rad": 0.05 * np.cos(number)}
    return take_scan(_ROOM, position, **turn, noise=noise)


def _flown(backend: Any, seed: int = 1) -> Iterator[MapUpdate]:
    """The start bubble, then an update after every second of 24 scans."""
    noise = np.random.default_rng(seed)
    backend.mark_free(_START_M, _BUBBLE_M)
    for number in range(24):
        backend.integrate(_scan(number, noise))
        if number % 2 == 1:
            yield backend.update(0.05 * number)


def _centres_m(backend: Any) -> Float:
    shape = backend.field.state.shape
    centres: Float = backend.field.voxel_centres_m(np.arange(backend.field.state.size))
    return centres.reshape(*shape, 3)


def refuses_bounds_it_cannot_hold(make: Make) -> None:
    """With a `WorldError`, before the memory is gone."""
    absurd = {
        "a square kilometre": np.array([[0.0, 0.0, 0.0], [1000.0, 1000.0, 50.0]]),
        "a box turned inside out": np.array([[0.0, 0.0, 0.0], [1.0, -1.0, 1.0]]),
    }
    for words, bounds_m in absurd.items():
        try:
            make().reset(bounds_m, scene_of([]))
        except WorldError:
            continue
        keep(False, f"it begins a map of {words}")


def knows_nothing_before_it_is_told_anything(make: Make) -> None:
    """A new map is unknown, at the truncation distance."""
    field = _begun(make).field
    known = int((field.state != UNKNOWN).sum())
    keep(known == 0, f"{known} voxels of a new map are known")
    near = int((field.distance != np.float32(field.max_distance_m)).sum())
    keep(near == 0, f"{near} voxels of a new map are nearer than {field.max_distance_m:g} m to something")


def covers_the_bounds(make: Make) -> None:
    """With voxels of the size it names."""
    backend = _begun(make)
    field = backend.field
    keep(field.voxel_size_m == backend.voxel_size_m, f"its voxels are of {field.voxel_size_m} m")
    upper_m = field.origin_m + np.array(field.state.shape) * field.voxel_size_m
    lacking_m = np.maximum(field.origin_m - _BOUNDS_M[0], _BOUNDS_M[1] - upper_m).max()
    keep(lacking_m < 0.5 * field.voxel_size_m, f"{lacking_m:.3f} m of the bounds are not covered")


def maps_a_wall_where_it_stands(make: Make) -> None:
    """Flown towards, a wall is occupied within two voxels of its face, and nothing stands before it."""
    backend = _begun(make)
    for _ in _flown(backend):
        pass
    at, voxel_m = _centres_m(backend), backend.voxel_size_m
    before_it = (np.abs(at[..., 1] - 3.05) < 0.6) & (np.abs(at[..., 2] - 1.45) < 0.4)
    face = before_it & (np.abs(at[..., 0] - _WALL_M) < 2.0 * voxel_m)
    mapped = (face & (backend.field.state == OCCUPIED)).any(axis=0)[face.any(axis=0)].mean()
    keep(mapped > 0.9, f"{100.0 * (1.0 - mapped):.0f} % of a wall flown towards is not mapped")
    ahead = before_it & (at[..., 0] > 1.5) & (at[..., 0] < _WALL_M - 3.0 * voxel_m)
    false = int((backend.field.state[ahead] == OCCUPIED).sum())
    keep(false == 0, f"{false} voxels of free space before a wall are mapped as obstacles")


def measures_the_distance_to_what_it_has_mapped(make: Make) -> None:
    """After every update, to a voxel: ±(distance between centres - half a voxel), truncated."""
    backend = _begun(make)
    for update in _flown(backend):
        have = backend.field
        wanted = field_from(
            have.state == OCCUPIED, voxel_m=have.voxel_size_m, max_distance_m=have.max_distance_m
        )
        apart_m = float(np.abs(have.distance - wanted.distance).max())
        keep(apart_m <= have.voxel_size_m, f"a distance is off by {apart_m:.3f} m at {update.time_s:.2f} s")


def logs_every_change(make: Make) -> None:
    """An update names exactly the voxels that changed, with the distances before and after."""
    backend = _begun(make)
    distance, state = backend.field.distance.copy().ravel(), backend.field.state.copy().ravel()
    for update in _flown(backend):
        at = f"at {update.time_s:.2f} s"
        new, now = backend.field.distance.ravel(), backend.field.state.ravel()
        first = (state == UNKNOWN) & (now != UNKNOWN)
        changed = np.flatnonzero((distance != new) | first)
        keep(
            np.array_equal(changed, update.voxel),
            f"{np.setxor1d(changed, update.voxel).size} voxels changed unlogged or are logged unchanged {at}",
        )
        seen_before = ~update.first_seen
        logged = {
            "first_seen": (update.first_seen, first[changed]),
            "occupied": (update.occupied, now[changed] == OCCUPIED),
            "new_distance_m": (update.new_distance_m, new[changed]),
            "old_distance_m": (update.old_distance_m[seen_before], distance[changed][seen_before]),
        }
        for name, (have, want) in logged.items():
            keep(np.array_equal(have, want), f"{name} is wrong of {int((have != want).sum())} voxels {at}")
        distance, state = new.copy(), now.copy()


def changes_at_updates_only(make: Make) -> None:
    """What is seen in between waits for the next one."""
    backend = _begun(make)
    with untouched(field=backend.field):
        backend.mark_free(_START_M, _BUBBLE_M)
        backend.integrate(_scan(0))
    backend.update(0.0)
    keep((backend.field.state != UNKNOWN).any(), "it knows nothing after the first update")


def learns_nothing_from_no_measurement(make: Make) -> None:
    """NaN tells nothing."""
    scan = _scan(0)
    scan.depth_m[:] = np.nan
    backend = _begun(make)
    backend.integrate(scan)
    changes = backend.update(0.0).voxel.size
    keep(changes == 0, f"{changes} voxels changed")


def bears_scans_from_outside_the_map(make: Make) -> None:
    """They change nothing and raise nothing."""
    backend = _begun(make)
    backend.integrate(take_scan(_ROOM, (-20.0, 3.0, 1.5), np.pi))
    backend.integrate(take_scan(_ROOM, (4.0, 3.0, 40.0)))
    changes = backend.update(0.0).voxel.size
    keep(changes == 0, f"{changes} voxels changed")


def makes_the_same_map_of_the_same_scans(make: Make) -> None:
    """To the last bit, also after a reset."""
    used = _begun(make)
    once = [(update, used.field.copy()) for update in _flown(used)]
    used.reset(_BOUNDS_M, scene_of(_ROOM))
    again = [(update, used.field.copy()) for update in _flown(used)]
    keep(same(once, again), "a second trial of the same object makes another map")


def writes_into_nothing_it_is_given(make: Make) -> None:
    """A scan is the trial's own."""
    backend, scan = _begun(make), _scan(0)
    with untouched(scan=scan, start_m=_START_M):
        backend.mark_free(_START_M, _BUBBLE_M)
        backend.integrate(scan)
        backend.update(0.0)
