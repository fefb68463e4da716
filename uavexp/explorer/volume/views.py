"""What a sensor that turns with the vehicle would see of frontier cells from places near them (numba).

A camera sees a pyramid about its axis, a sensor of 180 degrees and more all azimuths within its half
width; both see from the lowest to the highest elevation. Sight ends at occupied and at unseen voxels, but for
unseen ones next to the cell that is looked at. So no place is chosen for what it would see through
a wall, nor a place below a shaft for what only a sensor that looks up would see.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Bool, Float, Float32, Int, UInt8
from uavexp.field import FREE, OCCUPIED, UNKNOWN, value_at

_STRIDE_VOXELS = 0.7  # between two looks at a line of sight
_NEAR_CELLS = 1.5
_RADII_M = (0.5, 1.0, 1.7, 2.5, 3.4)
_TURNS = 10
_HEIGHTS_M = (0.0, 0.6, -0.6, 1.4, -1.4)


class Sight(NamedTuple):
    """A sensor as kernels read it."""

    half_width_rad: float
    lowest_rad: float
    highest_rad: float
    range_m: float


class Places(NamedTuple):
    """Where one may look from at what; `Cells` and its map as kernels read them."""

    state: UInt8  # (X, Y, Z) of the map
    distance: Float32  # (X, Y, Z) m
    origin_m: Float  # (3,)
    voxel_m: float
    cell_m: float
    clearance_m: float  # of a place
    radius_m: float  # around a place that must have been seen: the body is there
    low_m: Float  # (3,) of the flight bounds
    high_m: Float  # (3,)


@nb.njit(cache=True, inline="always")
def _state_at(state: UInt8, origin_m: Float, voxel_m: float, x: float, y: float, z: float) -> int:
    """State of the voxel that holds a point; UNKNOWN outside."""
    i = int(np.floor((x - origin_m[0]) / voxel_m))
    j = int(np.floor((y - origin_m[1]) / voxel_m))
    k = int(np.floor((z - origin_m[2]) / voxel_m))
    nx, ny, nz = state.shape
    inside = 0 <= i < nx and 0 <= j < ny and 0 <= k < nz
    return int(state[i, j, k]) if inside else UNKNOWN


@nb.njit(cache=True)
def is_place(places: Places, x: float, y: float, z: float) -> bool:
    """Whether the body may wait at a point: clear, within the bounds, and seen all around."""
    low, high, r = places.low_m, places.high_m, places.radius_m
    inside = low[0] <= x <= high[0] and low[1] <= y <= high[1] and low[2] <= z <= high[2]
    state, origin_m, voxel_m = places.state, places.origin_m, places.voxel_m
    if not inside or _state_at(state, origin_m, voxel_m, x, y, z) != FREE:
        return False
    if value_at(places.distance, origin_m, voxel_m, x, y, z) < places.clearance_m:
        return False
    for dx in (-r, 0.0, r):
        for dy in (-r, 0.0, r):
            for dz in (-voxel_m, voxel_m):
                if _state_at(state, origin_m, voxel_m, x + dx, y + dy, z + dz) == UNKNOWN:
                    return False
    return True


@nb.njit(cache=True)
def _sees(places: Places, eye: Float, point: Float) -> bool:
    """Whether nothing occupied lies between an eye (3,) and a point (3,), nor unseen but near the point."""
    x, y, z = point[0] - eye[0], point[1] - eye[1], point[2] - eye[2]
    length = math.sqrt(x * x + y * y + z * z)
    state, origin_m, voxel_m = places.state, places.origin_m, places.voxel_m
    stride, near_m = _STRIDE_VOXELS * voxel_m, _NEAR_CELLS * places.cell_m
    for n in range(1, int(length / stride) + 1):
        share = n * stride / length
        there = _state_at(
            state, origin_m, voxel_m, eye[0] + x * share, eye[1] + y * share, eye[2] + z * share
        )
        near = length - n * stride < near_m
        if there == OCCUPIED or (there == UNKNOWN and not near):
            return False
    return True


@nb.njit(cache=True, inline="always")
def _frames(sight: Sight, eye: Float, yaw: float, point: Float) -> bool:
    """Whether a point (3,) lies in the image of the sensor at an eye (3,); sight is not asked for."""
    x, y, z = point[0] - eye[0], point[1] - eye[1], point[2] - eye[2]
    level = math.hypot(x, y)
    if level * level + z * z > sight.range_m * sight.range_m:
        return False
    if sight.half_width_rad >= 0.5 * math.pi:
        turn = math.atan2(y, x) - yaw
        turn -= 2.0 * math.pi * math.floor(turn / (2.0 * math.pi) + 0.5)
        elevation = math.atan2(z, level)
        return bool(abs(turn) <= sight.half_width_rad and sight.lowest_rad <= elevation <= sight.highest_rad)
    pitch, half = 0.5 * (sight.lowest_rad + sight.highest_rad), 0.5 * (sight.highest_rad - sight.lowest_rad)
    ahead, left = x * math.cos(yaw) + y * math.sin(yaw), y * math.cos(yaw) - x * math.sin(yaw)
    depth, up = (
        ahead * math.cos(pitch) + z * math.sin(pitch),
        z * math.cos(pitch) - ahead * math.sin(pitch),
    )
    wide, tall = depth * math.tan(sight.half_width_rad), depth * math.tan(half)
    return bool(depth > 0.0 and abs(left) <= wide and abs(up) <= tall)


@nb.njit(cache=True)
def seen_from(places: Places, sight: Sight, eye: Float, yaw: float, cells_m: Float) -> Bool:
    """Which cells with centres (C, 3) the sensor at an eye (3,) would see (C,)."""
    seen = np.zeros(cells_m.shape[0], dtype=np.bool_)
    for c in range(cells_m.shape[0]):
        seen[c] = _frames(sight, eye, yaw, cells_m[c]) and _sees(places, eye, cells_m[c])
    return seen


@nb.njit(cache=True)
def _seen_enough(places: Places, sight: Sight, eye: Float, yaw: float, cells_m: Float, enough: float) -> int:
    """How many of cells (C, 3) would be seen from an eye (3,); -1: fewer than enough."""
    framed = np.zeros(cells_m.shape[0], dtype=np.bool_)
    for c in range(cells_m.shape[0]):
        framed[c] = _frames(sight, eye, yaw, cells_m[c])
    count = framed.sum()
    for c in range(cells_m.shape[0]):
        if count < enough:
            return -1
        count -= framed[c] and not _sees(places, eye, cells_m[c])
    return int(count) if count >= enough else -1


@nb.njit(cache=True)
def look_from(places: Places, sight: Sight, eyes: Float, cells_m: Float, share: float) -> tuple[Int, Float]:
    """How many of cells (C, 3) would be seen from each eye (E, 3), and with which yaw (E,).

    The yaw is towards the middle of the cells. No eye where the body may not wait sees any, nor one that sees
    less than this share of what the best does.
    """
    count, yaws, most = np.zeros(eyes.shape[0], dtype=np.int64), np.zeros(eyes.shape[0]), 1
    for e in range(eyes.shape[0]):
        eye = eyes[e]
        if not is_place(places, eye[0], eye[1], eye[2]):
            continue
        x, y = 0.0, 0.0
        for c in range(cells_m.shape[0]):
            dx, dy = cells_m[c, 0] - eye[0], cells_m[c, 1] - eye[1]
            level = max(math.hypot(dx, dy), 1e-6)
            x, y = x + dx / level, y + dy / level
        yaws[e] = math.atan2(y, x)
        count[e] = _seen_enough(places, sight, eye, yaws[e], cells_m, share * most)
        most = max(most, count[e])
    return np.where(count >= share * most, count, 0), yaws


def offsets_around() -> Float:
    """Offsets (E, 3), m, of places to look from: on upright cylinders around a cluster's middle."""
    turns_rad = 2.0 * math.pi * np.arange(_TURNS) / _TURNS
    level = [
        (radius_m * math.cos(turn), radius_m * math.sin(turn)) for radius_m in _RADII_M for turn in turns_rad
    ]
    return np.array([(x, y, height_m) for x, y in [(0.0, 0.0), *level] for height_m in _HEIGHTS_M])
