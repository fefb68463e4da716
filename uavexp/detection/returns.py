"""Returns of a scan as points, whatever the sensor, and scans without some of their returns."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Bool, Float, Float32, Int, UInt8
from uavexp.bodies import distance_m
from uavexp.scan import DepthScan, Scan
from uavexp.types import Bodies


class Returns(NamedTuple):
    """The measured points of a scan."""

    points_m: Float  # (N, 3) world
    where: Int  # (N,) flat index into the scan's depths or ranges


@nb.njit(cache=True)
def _depth_points(depth: Float32, intrinsics: Float, rotation: Float, position_m: Float) -> tuple[Float, Int]:
    """Points (N, 3) of the finite pixels of a depth image, and their flat indices (N,)."""
    height, width = depth.shape
    points, index = np.empty((height * width, 3)), np.empty(height * width, dtype=np.int64)
    count = 0
    for v in range(height):
        down = (v - intrinsics[3]) / intrinsics[1]
        for u in range(width):
            z = float(depth[v, u])
            if not 0.0 < z < np.inf:
                continue
            right = (u - intrinsics[2]) / intrinsics[0]
            for axis in range(3):
                ray = rotation[axis, 0] * right + rotation[axis, 1] * down + rotation[axis, 2]
                points[count, axis] = position_m[axis] + z * ray
            index[count] = v * width + u
            count += 1
    return points[:count].copy(), index[:count].copy()


@nb.njit(cache=True)
def _ray_points(origin_m: Float, direction: Float32, length: Float32) -> tuple[Float, Int]:
    """Points (N, 3) of the finite ranges, and their indices (N,)."""
    points, index = np.empty((length.shape[0], 3)), np.empty(length.shape[0], dtype=np.int64)
    count = 0
    for n in range(length.shape[0]):
        far = float(length[n])
        if not 0.0 < far < np.inf:
            continue
        for axis in range(3):
            points[count, axis] = origin_m[axis] + far * direction[n, axis]
        index[count] = n
        count += 1
    return points[:count].copy(), index[:count].copy()


@nb.njit(cache=True)
def free_at(
    distance: Float32, state: UInt8, origin_m: Float, voxel_m: float, points_m: Float, free_m: float
) -> Bool:
    """Whether each point (N, 3) is farther than `free_m` from any obstacle and surrounded by free space.

    Its voxel and the six beside it must be known to be free: what lies behind a surface is not, so no
    surface is mistaken for something in free space before the map has made it an obstacle.
    """
    free = np.zeros(points_m.shape[0], dtype=np.bool_)
    nx, ny, nz = state.shape
    for n in range(points_m.shape[0]):
        i = int(np.floor((points_m[n, 0] - origin_m[0]) / voxel_m))
        j = int(np.floor((points_m[n, 1] - origin_m[1]) / voxel_m))
        k = int(np.floor((points_m[n, 2] - origin_m[2]) / voxel_m))
        if not (1 <= i < nx - 1 and 1 <= j < ny - 1 and 1 <= k < nz - 1):
            continue
        if state[i, j, k] != 1 or distance[i, j, k] <= free_m:  # 1: FREE of `mapping.base`
            continue
        free[n] = (
            state[i - 1, j, k] == 1
            and state[i + 1, j, k] == 1
            and state[i, j - 1, k] == 1
            and state[i, j + 1, k] == 1
            and state[i, j, k - 1] == 1
            and state[i, j, k + 1] == 1
        )
    return free


def returns(scan: Scan) -> Returns:
    """Every return of a scan as a point in the world."""
    if isinstance(scan, DepthScan):
        intrinsics = np.array([*scan.focal_px, *scan.centre_px])
        return Returns(*_depth_points(scan.depth_m, intrinsics, scan.camera_rotation, scan.camera_position_m))
    return Returns(*_ray_points(scan.origin_m, scan.direction, scan.range_m))


def viewpoint_m(scan: Scan) -> Float:
    """Where the sensor stood (3,)."""
    return scan.camera_position_m if isinstance(scan, DepthScan) else scan.origin_m


def without(scan: Scan, index: Int) -> Scan:
    """The scan with these returns (K,), flat indices, turned into no measurement (NaN)."""
    if len(index) == 0:
        return scan
    values = (scan.depth_m if isinstance(scan, DepthScan) else scan.range_m).copy()
    values.reshape(-1)[index] = np.nan
    if isinstance(scan, DepthScan):
        return replace(scan, depth_m=values)
    return replace(scan, range_m=values)


def without_bodies(scan: Scan, bodies: Bodies, margin_m: float) -> Scan:
    """The scan without what was measured within a margin of the bodies that are there."""
    seen = returns(scan)
    return without(scan, seen.where[distance_m(bodies, seen.points_m) <= margin_m])
