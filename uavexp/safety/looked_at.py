"""What the map says of places along a way: how near it is to obstacles, and whether all of it was seen."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from uavexp.arrays import Bool, Float, Float32, UInt8
from uavexp.field import UNKNOWN, value_at


@nb.njit(cache=True)
def look_at(
    points_m: Float,
    distance: Float32,
    state: UInt8,
    origin_m: Float,
    voxel_size_m: float,
    radius_m: float,
    half_height_m: float,
) -> tuple[Float, Bool, Bool]:
    """Mapped distance (N,), and whether the body's place and its centre were seen (N,), at points (N, 3).

    The body's place: every voxel whose centre lies in the upright cylinder of `radius_m` and
    `half_height_m` (and half a voxel) around the point. What lies outside the map was not seen.
    """
    count = len(points_m)
    clearance, seen, centre = np.empty(count), np.ones(count, np.bool_), np.zeros(count, np.bool_)
    reach, tall = radius_m / voxel_size_m, half_height_m / voxel_size_m + 0.5
    for n in range(count):
        x, y, z = points_m[n]
        clearance[n] = value_at(distance, origin_m, voxel_size_m, x, y, z)
        u, v, w = (
            (x - origin_m[0]) / voxel_size_m - 0.5,
            (y - origin_m[1]) / voxel_size_m - 0.5,
            (z - origin_m[2]) / voxel_size_m - 0.5,
        )
        centre[n] = _seen(state, round(u), round(v), round(w))
        for i in range(math.ceil(u - reach), math.floor(u + reach) + 1):
            for j in range(math.ceil(v - reach), math.floor(v + reach) + 1):
                if (i - u) ** 2 + (j - v) ** 2 > reach**2:
                    continue
                for k in range(math.ceil(w - tall), math.floor(w + tall) + 1):
                    if not _seen(state, i, j, k):
                        seen[n] = False
    return clearance, seen, centre


@nb.njit(cache=True, inline="always")
def _seen(state: UInt8, i: int, j: int, k: int) -> bool:
    inside = 0 <= i < state.shape[0] and 0 <= j < state.shape[1] and 0 <= k < state.shape[2]
    return bool(inside and state[i, j, k] != UNKNOWN)
