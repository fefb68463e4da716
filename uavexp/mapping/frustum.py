"""What a depth camera can see at most: numba kernels shared by the map backends."""

from __future__ import annotations

import numba as nb
import numpy as np

from uavexp.arrays import Float, Float32, Int


@nb.njit(cache=True)
def column_depths(depth: Float32) -> Float:
    """Farthest measurement in each pixel column (W,), -inf where there is none."""
    height, width = depth.shape
    farthest = np.full(width, -np.inf)
    for v in range(height):
        for u in range(width):
            if depth[v, u] > farthest[u]:
                farthest[u] = depth[v, u]
    return farthest


@nb.njit(cache=True)
def frustum_box(
    intrinsics: Float, height: int, width: int, range_m: float, rotation: Float, position: Float
) -> Float:
    """Bounding box (2, 3) of the view frustum up to depth `range_m`, in the unit and frame of the pose."""
    box = np.empty((2, 3))
    box[0] = position
    box[1] = position
    for u in (-0.5, width - 0.5):
        for v in (-0.5, height - 0.5):
            x = (u - intrinsics[2]) / intrinsics[0] * range_m
            y = (v - intrinsics[3]) / intrinsics[1] * range_m
            for axis in range(3):
                at = position[axis] + (
                    rotation[axis, 0] * x + rotation[axis, 1] * y + rotation[axis, 2] * range_m
                )
                box[0, axis] = min(box[0, axis], at)
                box[1, axis] = max(box[1, axis], at)
    return box


@nb.njit(cache=True)
def image_axes(intrinsics: Float, rotation: Float) -> Float:
    """Rows (3, 3) that take a way in the world to u depth, v depth and depth, m; pixel u spans [u, u + 1)."""
    axes = rotation.T.copy()
    for n in range(2):
        axes[n] = intrinsics[n] * axes[n] + (intrinsics[2 + n] + 0.5) * axes[2]
    return axes


@nb.njit(cache=True)
def visible_voxels(
    intrinsics: Float, height: int, width: int, range_: float, rotation: Float, corner: Float,
    shape: tuple[int, int, int],
) -> tuple[Int, Int]:  # fmt: skip
    """First voxel (3,) in the frustum's box, and one beyond the last; the range, too, is in voxels."""
    low, high = np.zeros(3, np.int64), np.zeros(3, np.int64)
    if range_ > 0.0:
        box = frustum_box(intrinsics, height, width, range_, rotation, corner)
        for axis in range(3):
            low[axis] = max(int(np.ceil(box[0, axis])), 0)
            high[axis] = min(int(np.floor(box[1, axis])) + 1, shape[axis])
    return low, high
