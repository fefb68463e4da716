"""Fusion of single rays (a LiDAR) into a map, by exact voxel traversal.

A ray with a return tells two things: the voxels it crosses are free up to the truncation
before the return, and in the band around it, truncation before to truncation behind, a voxel
has the signed distance d = range - (centre - origin) . direction, along the ray. A ray without
return makes free up to the sensor's range.

Every voxel is observed at most once a scan, whatever the order of the rays: of several
distances in a band the smallest |d| holds (distances along rays are never less than true
ones, and the ray that hits the voxel beats those that pass it on their way elsewhere), and
any distance in a band beats free. Traversal: Amanatides and Woo 1987. What is observed is
fused and judged exactly as a depth image's (`occupancy`).
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from uavexp.arrays import Float, Float32, Int32
from uavexp.mapping.occupancy import FusionRule, OccupancyMap, Voxels, enlist, fuse
from uavexp.scan import RayScan

_INSIDE = 1e-6  # voxels before the grid's border: rounding must not lead out of it
_LEVEL = 1e-12  # a ray that rises less along an axis never crosses a border of it


@nb.njit(cache=True, inline="always")
def _cut(low: float, high: float, origin: float, way: float, count: int) -> tuple[float, float]:
    """Cut the ray interval [low, high] to 0 <= origin + t way <= count; low > high: nothing is left."""
    if abs(way) < _LEVEL:
        return (low, high) if 0.0 <= origin < count else (1.0, 0.0)
    near, far = -origin / way, (count - origin) / way
    return max(low, min(near, far)), min(high, max(near, far))


@nb.njit(cache=True, inline="always")
def _begin(origin: float, way: float, low: float, count: int) -> tuple[int, int, int, float, float]:
    """Along one axis: first voxel, step, voxels left, ray parameter of the next border, and between two."""
    at = min(max(math.floor(origin + low * way), 0), count - 1)
    if abs(way) < _LEVEL:
        return at, 0, 0, np.inf, np.inf
    if way > 0.0:
        return at, 1, count - 1 - at, (at + 1 - origin) / way, 1.0 / way
    return at, -1, at, (at - origin) / way, -1.0 / way


@nb.njit(cache=True, inline="always")
def _note(
    flat: int, along: float, measured: float, reach: float, cut: float,
    nearest: Float32, touched: Int32, count: int,
) -> int:  # fmt: skip
    """Note what a ray tells of one voxel, whose centre lies `along` it; see `_walk`."""
    if along > reach:
        return count
    observed = np.float32(min(measured - along, cut))
    if observed < -cut:
        return count
    before = nearest[flat]
    if before == np.inf:
        touched[count] = flat
        nearest[flat] = observed
        return count + 1
    if measured < np.inf and (abs(observed) < abs(before) or (observed < 0.0 and observed == -before)):
        nearest[flat] = observed
    return count


@nb.njit(cache=True)
def _walk(
    ox: float, oy: float, oz: float, wx: float, wy: float, wz: float, low: float, high: float,
    measured: float, reach: float, cut: float, shape: tuple[int, int, int],
    nearest: Float32, touched: Int32, count: int,
) -> int:  # fmt: skip
    """Observe the voxels that a ray crosses between `low` and `high`; all lengths in voxels.

    Args:
        ox: origin of the ray from the grid's lower corner, x, y and z.
        oy: see there.
        oz: see there.
        wx: unit direction, x, y and z.
        wy: see there.
        wz: see there.
        low: begin of the interval.
        high: its end.
        measured: range; inf: everything in the interval is free.
        reach: voxels whose centres lie beyond it along the ray are left alone.
        cut: the truncation.
        shape: voxels along x, y, z.
        nearest: (N,) flat: this scan's observation of each voxel, inf where there is none.
        touched: voxels with an observation.
        count: how many of `touched` are in use.

    Returns:
        The new count.
    """
    low, high = _cut(low, high, ox, wx, shape[0])
    low, high = _cut(low, high, oy, wy, shape[1])
    low, high = _cut(low, high, oz, wz, shape[2])
    if low > high:
        return count
    x, step_x, left_x, next_x, every_x = _begin(ox, wx, low, shape[0])
    y, step_y, left_y, next_y, every_y = _begin(oy, wy, low, shape[1])
    z, step_z, left_z, next_z, every_z = _begin(oz, wz, low, shape[2])
    flat = (x * shape[1] + y) * shape[2] + z
    along = (x + 0.5 - ox) * wx + (y + 0.5 - oy) * wy + (z + 0.5 - oz) * wz
    while True:
        count = _note(flat, along, measured, reach, cut, nearest, touched, count)
        if min(next_x, next_y, next_z) > high:
            return count
        if next_x <= next_y and next_x <= next_z:
            left_x -= 1
            flat += step_x * shape[1] * shape[2]
            along += step_x * wx
            next_x += every_x
        elif next_y <= next_z:
            left_y -= 1
            flat += step_y * shape[2]
            along += step_y * wy
            next_y += every_y
        else:
            left_z -= 1
            flat += step_z
            along += step_z * wz
            next_z += every_z
        if min(left_x, left_y, left_z) < 0:
            return count


@nb.njit(cache=True)
def _clear(
    ox: float, oy: float, oz: float, wx: float, wy: float, wz: float, high: float, cut: float,
    shape: tuple[int, int, int], nearest: Float32, touched: Int32, count: int,
) -> int:  # fmt: skip
    """Observe the voxels that a ray crosses up to `high` to be free, as `_walk`, without a look at each.

    Most of a scan's voxels are these, hence the fewest operations a voxel.
    """
    low, high = _cut(0.0, high, ox, wx, shape[0])
    low, high = _cut(low, high, oy, wy, shape[1])
    low, high = _cut(low, high, oz, wz, shape[2])
    high -= _INSIDE
    if low > high:
        return count
    x, step_x, _, next_x, every_x = _begin(ox, wx, low, shape[0])
    y, step_y, _, next_y, every_y = _begin(oy, wy, low, shape[1])
    z, step_z, _, next_z, every_z = _begin(oz, wz, low, shape[2])
    step_x, step_y = step_x * shape[1] * shape[2], step_y * shape[2]
    flat, free = (x * shape[1] + y) * shape[2] + z, np.float32(cut)
    while True:
        at = np.uint64(flat)  # unsigned: numba then leaves out the test for negative indices
        if nearest[at] == np.inf:
            nearest[at] = free
            touched[np.uint64(count)] = flat
            count += 1
        if next_x <= next_y and next_x <= next_z:
            if next_x > high:
                return count
            flat, next_x = flat + step_x, next_x + every_x
        elif next_y <= next_z:
            if next_y > high:
                return count
            flat, next_y = flat + step_y, next_y + every_y
        else:
            if next_z > high:
                return count
            flat, next_z = flat + step_z, next_z + every_z


@nb.njit(cache=True)
def _observe(
    origin_m: Float, direction: Float32, range_m: Float32, max_range_m: float, truncation_m: float,
    low_m: Float, voxel_m: float, shape: tuple[int, int, int], nearest: Float32, touched: Int32,
) -> int:  # fmt: skip
    """Fill `nearest` and `touched` with one scan: first the bands around returns, then the free parts."""
    origin, count = (origin_m - low_m) / voxel_m, 0
    cut, range_ = truncation_m / voxel_m, max_range_m / voxel_m
    for n in range(direction.shape[0]):
        measured = range_m[n] / voxel_m
        if measured < np.inf:  # neither missing nor beyond range
            count = _walk(
                origin[0], origin[1], origin[2], direction[n, 0], direction[n, 1], direction[n, 2],
                max(measured - cut, 0.0), measured + cut, measured, np.inf, cut, shape,
                nearest, touched, count,
            )  # fmt: skip
    for n in range(direction.shape[0]):
        if np.isnan(range_m[n]):
            continue
        free = min(range_, range_m[n] / voxel_m - cut)
        if free > 0.0:
            count = _clear(
                origin[0], origin[1], origin[2], direction[n, 0], direction[n, 1], direction[n, 2],
                free - 1.0, cut, shape, nearest, touched, count,
            )  # fmt: skip
            count = _walk(  # its end: the centre of a voxel that is crossed there may lie beyond it
                origin[0], origin[1], origin[2], direction[n, 0], direction[n, 1], direction[n, 2],
                max(free - 1.0, 0.0), free, np.inf, free, cut, shape, nearest, touched, count,
            )  # fmt: skip
    return count


@nb.njit(cache=True)
def _fuse(
    voxels: Voxels, nearest: Float32, touched: Int32, voxel_m: float, rule: FusionRule, count: int
) -> int:
    """Fuse the observations and clear them; returns how many voxels now stand in `changes`."""
    for n in range(touched.shape[0]):
        at = touched[n]
        observed_m, byte = np.float32(nearest[at] * voxel_m), np.int64(voxels.live[at])
        nearest[at] = np.inf
        voxels.tsdf_m[at], voxels.weight[at], after = fuse(
            observed_m, voxels.tsdf_m[at], np.int64(voxels.weight[at]), byte, rule
        )
        if after != byte:
            count = enlist(voxels, at, after, count)
    return count


def integrate_rays(scan: RayScan, grid: OccupancyMap, rule: FusionRule) -> Int32:
    """Fuse one scan; return the voxels (N,) that it touched, flat, each once."""
    nearest, touched = grid.ray_arrays()
    count = _observe(
        scan.origin_m, scan.direction, scan.range_m, scan.max_range_m, rule.truncation_m,
        grid.origin_m, grid.voxel_size_m, grid.shape, nearest, touched,
    )  # fmt: skip
    grid.changed = _fuse(grid.voxels, nearest, touched[:count], grid.voxel_size_m, rule, grid.changed)
    return touched[:count]
