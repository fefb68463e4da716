"""Distance fields to check against, made from boolean occupancy with scipy's exact transform."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import distance_transform_edt

from uavexp.arrays import Bool, Float, UInt8
from uavexp.field import FREE, OCCUPIED, UNKNOWN, DistanceField


def field_from(
    occupied: Bool,
    *,
    voxel_m: float = 0.1,
    origin_m: Float | tuple[float, float, float] = (0.0, 0.0, 0.0),
    max_distance_m: float = 2.5,
    unknown: Bool | None = None,
) -> DistanceField:
    """Signed field ±(exact centre distance - half a voxel), truncated, of a boolean grid."""
    if occupied.any():
        outside = distance_transform_edt(~occupied) * voxel_m
        inside = distance_transform_edt(occupied) * voxel_m
        distance = np.where(occupied, -(inside - 0.5 * voxel_m), outside - 0.5 * voxel_m)
    else:  # scipy answers nonsense when there is nothing to be near to
        distance = np.full(occupied.shape, max_distance_m)
    distance = np.clip(distance, -max_distance_m, max_distance_m).astype(np.float32)
    state = np.where(occupied, OCCUPIED, FREE).astype(np.uint8)
    if unknown is not None:
        state[unknown] = UNKNOWN
    return DistanceField(
        origin_m=np.asarray(origin_m, dtype=np.float64),
        voxel_size_m=voxel_m,
        max_distance_m=max_distance_m,
        distance=np.ascontiguousarray(distance),
        state=state,
    )


def empty(size_m: tuple[float, float, float], voxel_m: float = 0.1) -> Bool:
    """Free grid of this size."""
    return np.zeros([round(s / voxel_m) for s in size_m], dtype=bool)


def box(occupied: Bool, low_m: tuple[float, ...], high_m: tuple[float, ...], voxel_m: float = 0.1) -> None:
    """Fill an axis-aligned box."""
    low = [max(round(v / voxel_m), 0) for v in low_m]
    high = [max(round(v / voxel_m), 0) for v in high_m]
    occupied[low[0] : high[0], low[1] : high[1], low[2] : high[2]] = True


def warehouse(seed: int, size_m: tuple[float, float, float] = (26.0, 16.0, 3.0)) -> Bool:
    """Outer walls, shelf rows with gaps, pillars and loose boxes, floor and ceiling."""
    rng = np.random.default_rng(seed)
    grid = empty(size_m)
    grid[:2], grid[-2:], grid[:, :2], grid[:, -2:] = True, True, True, True
    grid[:, :, :1], grid[:, :, -1:] = True, True
    x = 3.0
    while x < size_m[0] - 3.0:
        y = 0.2
        while y < size_m[1] - 0.2:
            length = rng.uniform(2.0, 5.0)
            box(grid, (x, y, 0.0), (x + 0.8, min(y + length, size_m[1]), 2.6))
            y += length + rng.uniform(1.0, 2.0)
        x += 0.8 + rng.uniform(1.6, 2.8)
    for _ in range(18):
        px, py = rng.uniform(1.0, size_m[0] - 1.0), rng.uniform(1.0, size_m[1] - 1.0)
        width, height = rng.uniform(0.2, 0.7), rng.choice([0.8, 3.0])
        box(grid, (px, py, 0.0), (px + width, py + width, height))
    return grid


def bounds(
    grid: Bool | UInt8, voxel_m: float = 0.1, origin_m: Float | tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> Float:
    """Flight bounds (2, 3) that are the grid's own box."""
    low = np.asarray(origin_m, dtype=np.float64)
    return np.stack([low, low + np.array(grid.shape) * voxel_m])
