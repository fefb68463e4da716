"""Map backend `dense`: a TSDF on a dense grid, fused by numba kernels eight voxels at once.

Projective fusion: a voxel's centre is projected into the nearest pixel; d is the pixel's
depth minus the voxel's, both along the optical axis (as Open3D's VoxelBlockGrid does it).
Everything is linear in z before the division by depth. The grid is gone through in slabs of
one x. Of each slab the columns are taken that can be in the image and before the farthest
surface of the pixel columns they cross, and their voxels are passed three times, without a
branch and in float32: projected, compared with their pixels, fused and judged (`occupancy`).
Single rays are fused by `rays`.
"""

from __future__ import annotations

import dataclasses

import numba as nb
import numpy as np

from uavexp.arrays import Float, Float32, Int32, UInt8
from uavexp.field import DistanceField
from uavexp.mapping.frustum import column_depths, image_axes, visible_voxels
from uavexp.mapping.map_parameters import MapParameters
from uavexp.mapping.occupancy import FusionRule, OccupancyMap, Voxels, enlist, fuse
from uavexp.mapping.rays import integrate_rays
from uavexp.parameters import option
from uavexp.scan import RayScan, Scan
from uavexp.scene import Scene
from uavexp.types import MapUpdate

_LEVEL = 1e-12  # an axis along which less changes is level
_NEAR_M = 0.05  # a column that comes nearer to the camera's plane may cross all pixel columns
_SLACK_PX = 1e-3  # rounding of pixels must not lose a column
_NOTHING = np.float32(-np.inf)  # no observation


@nb.njit(cache=True)
def _in_frustum(
    start: Float, axes: Float, columns: int, last: int, width: int, range_m: float
) -> tuple[int, int]:
    """First column of a slab, and one beyond the last, of which an end is in the frustum; see `_project`.

    A side of the frustum is w . (u depth, v depth, depth) + c >= 0, and linear in y: the end that
    is farther inside, lower or upper (voxel `last`), is the same one for all columns.
    """
    low, high = 0.0, columns - 1.0
    for u, z, constant in ((1.0, 0.0, 0.0), (-1.0, 1.0 * width, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, range_m)):
        along, up = u * axes[0, 1] + z * axes[2, 1], u * axes[0, 2] + z * axes[2, 2]
        inside = u * start[0] + z * start[2] + constant + max(last * up, 0.0)
        if along > _LEVEL:
            low = max(low, -inside / along)
        elif along < -_LEVEL:
            high = min(high, -inside / along)
        elif inside < 0.0:
            return 0, 0
    return int(np.ceil(low)), int(np.floor(high)) + 1


@nb.njit(cache=True, error_model="numpy", inline="always")
def _may_be_seen(
    x: float, z: float, top_x: float, top_z: float, farthest_m: Float, truncation_m: float
) -> bool:
    """Whether a column can lie before the farthest surface of the pixel columns that it crosses.

    Its ends are at depths z and top_z, and at x / z and top_x / top_z pixels from the left.
    """
    near_m, first, last = min(z, top_z), 0.0, farthest_m.shape[0] - 1.0
    if near_m > _NEAR_M:
        first = max(min(x / z, top_x / top_z) - _SLACK_PX, first)
        last = min(max(x / z, top_x / top_z) + _SLACK_PX, last)
    reach_m = -np.inf
    for u in range(int(first), int(last) + 1):
        reach_m = max(reach_m, farthest_m[u])
    return near_m <= reach_m + truncation_m


@nb.njit(cache=True, error_model="numpy")
def _project(
    start: Float, axes: Float, columns: int, rows: int, farthest_m: Float, range_m: float,
    truncation_m: float, seen: Int32, pixel: Int32, depth_m: Float32,
) -> int:  # fmt: skip
    """Project the columns of one slab that may be seen; returns how many those are.

    Args:
        start: (3,) u depth, v depth and depth of the slab's first voxel, pixels and m.
        axes: (3, 3) how they change by a voxel along x, y, z.
        columns: of the slab.
        rows: of the image.
        farthest_m: (W,) of its pixel columns.
        range_m: nothing beyond this depth is told of.
        truncation_m: nor what is so far behind a surface.
        seen: filled with the columns that may be seen, ascending.
        pixel: (C, Z) filled with the pixels of their voxels, row by row; W * H beside the image.
        depth_m: (C, Z) filled with the depths of their voxels.
    """
    width, height = np.float32(farthest_m.shape[0]), np.float32(rows)
    up_u, up_v, up = np.float32(axes[0, 2]), np.float32(axes[1, 2]), np.float32(axes[2, 2])
    last = depth_m.shape[1] - 1
    count = 0
    for y in range(*_in_frustum(start, axes, columns, last, farthest_m.shape[0], range_m)):
        x, z = start[0] + y * axes[0, 1], start[2] + y * axes[2, 1]
        if not _may_be_seen(x, z, x + last * axes[0, 2], z + last * axes[2, 2], farthest_m, truncation_m):
            continue
        left, top, near = np.float32(x), np.float32(start[1] + y * axes[1, 1]), np.float32(z)
        at, depth = pixel[count], depth_m[count]
        for k in range(at.shape[0]):
            n = np.float32(k)
            depth[k] = near + n * up
            inverse = np.float32(1.0) / depth[k]
            u, v = (left + n * up_u) * inverse, (top + n * up_v) * inverse
            inside = (depth[k] > 0.0) & (u >= 0.0) & (v >= 0.0) & (u < width) & (v < height)
            at[k] = np.int32(np.floor(v) * width + np.floor(u) if inside else height * width)
        seen[count] = y
        count += 1
    return count


@nb.njit(cache=True)
def _compare(
    image_m: Float32, pixel: Int32, depth_m: Float32, max_range_m: np.float32, truncation_m: np.float32,
    observed_m: Float32,
) -> None:  # fmt: skip
    """Signed distances (N,) of voxels at pixels and depths (N,) from the surface measured; -inf: none."""
    for n in range(pixel.shape[0]):
        observed_m[n] = image_m[np.uint32(pixel[n])]
    for n in range(pixel.shape[0]):
        distance = observed_m[n] - depth_m[n]
        told = (distance >= -truncation_m) & ((depth_m[n] <= max_range_m) | (distance <= 0.0))
        observed_m[n] = min(distance, truncation_m) if told else _NOTHING


@nb.njit(cache=True, error_model="numpy")
def _fuse_run(
    observed_m: Float32, tsdf_m: Float32, weight: UInt8, live: UInt8, rule: FusionRule, after: UInt8
) -> None:
    """Fuse a run of voxels (N,) with what was observed; what `live` becomes is left in `after`."""
    for n in range(observed_m.shape[0]):
        tsdf_m[n], weight[n], after[n] = fuse(
            observed_m[n], tsdf_m[n], np.int64(weight[n]), np.int64(live[n]), rule
        )


@nb.njit(cache=True)
def _fuse_columns(
    voxels: Voxels, first: int, seen: Int32, observed_m: Float32, rule: FusionRule, after: UInt8, count: int
) -> int:
    """Fuse parts of columns (C, Z), which begin at voxels first + seen * depth of the grid; the new count."""
    columns, height = observed_m.shape
    depth, n = voxels.shape[2], 0
    while n < columns:
        end = n + 1
        while height == depth and end < columns and seen[end] == seen[end - 1] + 1:
            end += 1  # whole neighbouring columns are one run of memory
        begin, size = first + seen[n] * depth, (end - n) * height
        run = slice(begin, begin + size)
        _fuse_run(
            observed_m[n:end].reshape(-1),
            voxels.tsdf_m[run],
            voxels.weight[run],
            voxels.live[run],
            rule,
            after,
        )
        for k in range(size):
            if after[k] != voxels.live[begin + k]:
                count = enlist(voxels, begin + k, np.int64(after[k]), count)
        n = end
    return count


@nb.njit(cache=True)
def integrate_scan(
    voxels: Voxels, depth: Float32, intrinsics: Float, max_range_m: float, rotation: Float,
    corner: Float, voxel_m: float, rule: FusionRule, count: int,
) -> int:  # fmt: skip
    """Fuse one depth image; returns how many voxels now stand in `changes`.

    Args:
        voxels: of the map.
        depth: (H, W) along the optical axis, m; +inf is free to `max_range_m`, NaN nothing.
        intrinsics: (4,) fx, fy, cx, cy.
        max_range_m: of the sensor.
        rotation: (3, 3) camera to world.
        corner: (3,) the camera in voxels, counted from the centre of voxel (0, 0, 0).
        voxel_m: edge of a voxel.
        rule: fusion and occupancy.
        count: how many of `changes` are in use.
    """
    rows, columns = depth.shape
    farthest_m = column_depths(depth)
    range_m = min(max_range_m, farthest_m.max()) + rule.truncation_m
    low, high = visible_voxels(intrinsics, rows, columns, range_m / voxel_m, rotation, corner, voxels.shape)
    if (high <= low).any():
        return count
    image_m = np.append(depth, np.float32(np.nan))  # beside the image there is no measurement
    axes = image_axes(intrinsics, rotation) * voxel_m
    size = high[1] - low[1], high[2] - low[2]
    seen, after = np.empty(size[0], np.int32), np.empty(size[0] * size[1], np.uint8)
    pixel, depth_m = np.empty(size, np.int32), np.empty(size, np.float32)
    observed_m = np.empty(size, np.float32)
    for x in range(low[0], high[0]):
        start = axes @ (np.array([x, low[1], low[2]]) - corner)
        found = _project(
            start, axes, size[0], rows, farthest_m, range_m, rule.truncation_m, seen, pixel, depth_m
        )
        observed = observed_m[:found]
        _compare(
            image_m, pixel[:found].reshape(-1), depth_m[:found].reshape(-1), np.float32(max_range_m),
            rule.truncation_m, observed.reshape(-1),
        )  # fmt: skip
        first = (x * voxels.shape[1] + low[1]) * voxels.shape[2] + low[2]
        count = _fuse_columns(voxels, first, seen, observed, rule, after, count)
    return count


@option
class Dense(MapParameters):
    """TSDF on a dense grid over the world's bounds; see `MapParameters`."""

    _map: OccupancyMap | None = dataclasses.field(default=None, init=False, repr=False)

    def reset(self, bounds_m: Float, scene: Scene) -> None:
        """Begin a trial with everything unknown inside `bounds_m` (2, 3).

        Raises:
            WorldError: the grid would need more than `max_memory_mb`.
        """
        self._map = self.empty_map(bounds_m)

    def mark_free(self, centre_m: Float, radius_m: float) -> None:
        """Declare a ball known free as far as it is unknown; measured surfaces override it."""
        self._live().mark_free(centre_m, radius_m)

    def note_obstacle(self, centre_m: Float, radius_m: float) -> None:
        """Declare a ball an obstacle that was felt, not seen; no measurement overrides it."""
        self._live().note_obstacle(centre_m, radius_m)

    def integrate(self, scan: Scan) -> None:
        """Fuse one scan."""
        grid = self._live()
        if isinstance(scan, RayScan):
            integrate_rays(scan, grid, self.rule())
            return
        corner = (scan.camera_position_m - grid.origin_m) / grid.voxel_size_m - 0.5
        grid.changed = integrate_scan(
            grid.voxels, scan.depth_m, np.array([*scan.focal_px, *scan.centre_px]), scan.max_range_m,
            scan.camera_rotation, corner, grid.voxel_size_m, self.rule(), grid.changed,
        )  # fmt: skip

    def update(self, time_s: float) -> MapUpdate:
        """Bring the ESDF up to date; return what changed since the last call."""
        grid = self._live()
        grid.fade(time_s)
        return grid.publish(time_s)

    @property
    def field(self) -> DistanceField:
        """The live distance field, as of the last `update`."""
        return self._live().field

    def _live(self) -> OccupancyMap:
        if self._map is None:
            raise RuntimeError("reset() must come first")
        return self._map
