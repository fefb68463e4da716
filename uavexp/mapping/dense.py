"""Map backend `dense`: a TSDF on a dense grid, fused by one numba kernel.

Projective fusion: a voxel's centre is projected into the nearest pixel; d is the pixel's
depth minus the voxel's, both along the optical axis (as Open3D's VoxelBlockGrid does it).
Column by column along z, everything is linear in z before the division by depth, so each
column is cut to its part inside the frustum, and in front of the farthest surface in its
pixel columns, before any voxel is looked at.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numba as nb
import numpy as np

from uavexp.mapping.base import DistanceField
from uavexp.mapping.occupancy import OccupancyMap, Rule, enlist, judge, keeps_free
from uavexp.mapping.parameters import MapParameters
from uavexp.types import Float, Float32, Int32, MapUpdate, Scan, UInt8

_NEAR_M = 1e-3  # nothing is nearer to the camera than this


@nb.njit(cache=True, inline="always")
def _clip(low: float, high: float, constant: float, slope: float) -> tuple[float, float]:
    """Cut [low, high] to where constant + slope * k >= 0."""
    if slope > 1e-12:
        low = max(low, -constant / slope)
    elif slope < -1e-12:
        high = min(high, -constant / slope)
    elif constant < 0.0:
        high = low - 1.0
    return low, high


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
    """Bounding box (2, 3) of the view frustum up to depth `range_m`, in the frame of the pose."""
    box = np.empty((2, 3))
    box[0], box[1] = position, position
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
def integrate_scan(
    depth: Float32, intrinsics: Float, max_range_m: float, rotation: Float, position_m: Float,
    origin_m: Float, voxel_m: float, shape: tuple[int, int, int], rule: Rule,
    tsdf: Float32, weight: UInt8, live: UInt8, state: UInt8, changes: Int32, count: int,
) -> int:  # fmt: skip
    """Fuse one depth image; returns how many voxels now stand in `changes`.

    Args:
        depth: (H, W) along the optical axis, m; +inf is free to `max_range_m`, NaN nothing.
        intrinsics: (4,) fx, fy, cx, cy.
        max_range_m: of the sensor.
        rotation: (3, 3) camera to world.
        position_m: (3,) of the camera.
        origin_m: (3,) lower corner of the grid.
        voxel_m: edge of a voxel.
        shape: voxels along x, y, z.
        rule: fusion and occupancy.
        tsdf: (N,) flat, as the four below: fused distance, m.
        weight: of the fused distance.
        live: state and evidence as of now.
        state: as of the last publication.
        changes: voxels whose live state has left the published one.
        count: how many of `changes` are in use.
    """
    height, width = depth.shape
    nx, ny, nz = shape
    fx, fy, cx, cy = intrinsics
    farthest_m = max_range_m + rule.truncation_m
    farthest = column_depths(depth)
    box = frustum_box(intrinsics, height, width, farthest_m, rotation, position_m)
    low_x = max(int(np.floor((box[0, 0] - origin_m[0]) / voxel_m - 0.5)), 0)
    high_x = min(int(np.ceil((box[1, 0] - origin_m[0]) / voxel_m - 0.5)), nx - 1)
    low_y = max(int(np.floor((box[0, 1] - origin_m[1]) / voxel_m - 0.5)), 0)
    high_y = min(int(np.ceil((box[1, 1] - origin_m[1]) / voxel_m - 0.5)), ny - 1)
    reciprocal = 1.0 / np.arange(1, rule.max_weight + 2)
    # camera coordinates of voxel k of a column: base + k * step
    step_x, step_y, step_z = rotation[2, 0] * voxel_m, rotation[2, 1] * voxel_m, rotation[2, 2] * voxel_m
    offset_z = origin_m[2] + 0.5 * voxel_m - position_m[2]
    for i in range(low_x, high_x + 1):
        offset_x = origin_m[0] + (i + 0.5) * voxel_m - position_m[0]
        for j in range(low_y, high_y + 1):
            offset_y = origin_m[1] + (j + 0.5) * voxel_m - position_m[1]
            base_x = rotation[0, 0] * offset_x + rotation[1, 0] * offset_y + rotation[2, 0] * offset_z
            base_y = rotation[0, 1] * offset_x + rotation[1, 1] * offset_y + rotation[2, 1] * offset_z
            base_z = rotation[0, 2] * offset_x + rotation[1, 2] * offset_y + rotation[2, 2] * offset_z
            low, high = _clip(0.0, nz - 1.0, base_z - _NEAR_M, step_z)
            low, high = _clip(low, high, farthest_m - base_z, -step_z)
            low, high = _clip(low, high, fx * base_x + (cx + 0.5) * base_z, fx * step_x + (cx + 0.5) * step_z)
            right = cx - width + 0.5
            low, high = _clip(low, high, -fx * base_x - right * base_z, -fx * step_x - right * step_z)
            low, high = _clip(low, high, fy * base_y + (cy + 0.5) * base_z, fy * step_y + (cy + 0.5) * step_z)
            bottom = cy - height + 0.5
            low, high = _clip(low, high, -fy * base_y - bottom * base_z, -fy * step_y - bottom * step_z)
            if low > high:
                continue
            # nothing behind the farthest surface of the pixel columns it crosses
            u_low = fx * (base_x + low * step_x) / (base_z + low * step_z) + cx
            u_high = fx * (base_x + high * step_x) / (base_z + high * step_z) + cx
            reach = -np.inf
            for u in range(max(int(min(u_low, u_high)), 0), min(int(max(u_low, u_high)) + 2, width)):
                reach = max(reach, farthest[u])
            low, high = _clip(low, high, reach + rule.truncation_m - base_z, -step_z)
            column = (i * ny + j) * nz
            for k in range(int(np.ceil(low)), int(np.floor(high)) + 1):
                z = base_z + k * step_z
                inverse = 1.0 / z
                u = int(fx * (base_x + k * step_x) * inverse + cx + 0.5)
                v = int(fy * (base_y + k * step_y) * inverse + cy + 0.5)
                if u >= width or v >= height:
                    continue
                observed = depth[v, u] - z
                if not observed >= -rule.truncation_m or (z > max_range_m and observed > 0.0):
                    continue
                observed = min(observed, rule.truncation_m)
                at = column + k
                before, had, byte = tsdf[at], np.int64(weight[at]), np.int64(live[at])
                if keeps_free(observed, before, had, byte, rule):
                    continue
                fused = (had * before + observed) * reciprocal[had]
                tsdf[at] = fused
                weight[at] = min(had + 1, rule.max_weight)
                after = judge(observed, before, had, fused, byte, rule)
                if after != byte:
                    count = enlist(at, after, live, state, changes, count)
    return count


@dataclass(slots=True, kw_only=True)
class Dense(MapParameters):
    """TSDF on a dense grid over the world's bounds; see `MapParameters`."""

    _map: OccupancyMap | None = dataclasses.field(default=None, init=False, repr=False)

    def reset(self, bounds_m: Float) -> None:
        """Begin a trial with everything unknown inside `bounds_m` (2, 3).

        Raises:
            WorldError: the grid would need more than `max_memory_mb`.
        """
        self._map = self.empty_map(bounds_m)

    def mark_free(self, centre_m: Float, radius_m: float) -> None:
        """Declare a ball known free as far as it is unknown; measured surfaces override it."""
        self._live().mark_free(centre_m, radius_m)

    def integrate(self, scan: Scan) -> None:
        """Fuse one scan."""
        grid = self._live()
        grid.changed = integrate_scan(
            scan.depth_m, np.array([*scan.focal_px, *scan.centre_px]), scan.max_range_m,
            scan.camera_rotation, scan.camera_position_m, grid.origin_m, grid.voxel_size_m, grid.shape,
            self.rule(), grid.tsdf_m, grid.weight, grid.live, grid.state, grid.changes, grid.changed,
        )  # fmt: skip

    def update(self, time_s: float) -> MapUpdate:
        """Bring the ESDF up to date; return what changed since the last call."""
        return self._live().publish(time_s)

    @property
    def field(self) -> DistanceField:
        """The live distance field, as of the last `update`."""
        return self._live().field

    def _live(self) -> OccupancyMap:
        if self._map is None:
            raise RuntimeError("reset() must come first")
        return self._map
