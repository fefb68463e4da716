"""Which voxels have changed near a trajectory: equation (20) of paper 1 on arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numba as nb
import numpy as np

from uavexp.arrays import Float, Float32, Int, Int32, UInt8
from uavexp.field import DistanceField


@dataclass(frozen=True, slots=True, kw_only=True)
class MapNear:
    """A map as it was in the columns near a trajectory."""

    column: Int  # (C,) flat indices, ascending
    distance: Float32  # (C, Z) m
    state: UInt8  # (C, Z)


def columns_near(field: DistanceField, points_m: Float, radius_m: float) -> Int:
    """Flat indices (C,), ascending, of all columns with a voxel nearer to a point (P, 3), and a few more."""
    near = np.zeros(field.distance.shape[:2], dtype=np.bool_)
    reach = int(radius_m / field.voxel_size_m) + 1
    cell = np.floor((points_m[:, :2] - field.origin_m[:2]) / field.voxel_size_m).astype(np.int64)
    low, high = (cell - reach).clip(0), (cell + reach + 1).clip(0)
    for (i0, j0), (i1, j1) in set(zip(map(tuple, low), map(tuple, high), strict=True)):
        near[i0:i1, j0:j1] = True
    return np.flatnonzero(near)


def map_near(field: DistanceField, column: Int) -> MapNear:
    """Copy what a map holds in columns (C,)."""
    height = field.state.shape[2]
    return MapNear(
        column=column,
        distance=field.distance.reshape(-1, height)[column],
        state=field.state.reshape(-1, height)[column],
    )


@nb.njit(cache=True)
def changed_near(
    voxel: Int32,
    old_m: Float32,
    new_m: Float32,
    shape: Int,
    origin_m: Float,
    voxel_size_m: float,
    points_m: Float,
    radius_m: float,
    threshold_m: float,
    both_signs: bool,
) -> tuple[Int32, float]:
    """Voxels within `radius_m` of any point whose distance changed by more than the threshold.

    Args:
        voxel: (N,) flat C-order indices into a grid of `shape` (3,).
        old_m: (N,) distance before, m.
        new_m: (N,) distance after, m.
        shape: (3,) of the grid.
        origin_m: (3,) lower corner of the grid.
        voxel_size_m: edge of a voxel.
        points_m: (P, 3) samples of the trajectory, P >= 1.
        radius_m: monitoring radius r_mon.
        threshold_m: delta_map.
        both_signs: whether growing distances count as well as shrinking ones.

    Returns:
        The voxels (K,), in the order given, and the largest change near the points, m.
    """
    low, high = np.empty(3), np.empty(3)
    for axis in range(3):
        low[axis] = points_m[:, axis].min() - radius_m
        high[axis] = points_m[:, axis].max() + radius_m
    found = np.empty(voxel.shape[0], dtype=np.int32)
    count, largest = 0, 0.0
    for n in range(voxel.shape[0]):
        change = float(old_m[n]) - float(new_m[n])
        if both_signs:
            change = abs(change)
        if change <= largest and change <= threshold_m:
            continue
        flat = voxel[n]
        x = origin_m[0] + (flat // (shape[1] * shape[2]) + 0.5) * voxel_size_m
        y = origin_m[1] + (flat // shape[2] % shape[1] + 0.5) * voxel_size_m
        z = origin_m[2] + (flat % shape[2] + 0.5) * voxel_size_m
        if not (low[0] <= x <= high[0] and low[1] <= y <= high[1] and low[2] <= z <= high[2]):
            continue
        for p in range(points_m.shape[0]):
            dx, dy, dz = points_m[p, 0] - x, points_m[p, 1] - y, points_m[p, 2] - z
            if dx * dx + dy * dy + dz * dz < radius_m * radius_m:
                largest = max(largest, change)
                if change > threshold_m:
                    found[count] = flat
                    count += 1
                break
    return found[:count].copy(), largest
