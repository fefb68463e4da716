"""Map backend `dense`: a TSDF on a dense grid, fused by one numba kernel.

Projective fusion: a voxel's centre is projected into the nearest pixel; d is the pixel's
depth minus the voxel's, both along the optical axis (as Open3D's VoxelBlockGrid does it).
Column by column along z, everything is linear in z before the division by depth, so each
column is cut to its part inside the frustum, and in front of the farthest surface in its
pixel columns, before any voxel is looked at. Single rays are fused by `rays`.
"""

from __future__ import annotations

import dataclasses

import numba as nb
import numpy as np

from uavexp.arrays import Float, Float32
from uavexp.field import DistanceField
from uavexp.mapping.frustum import column_depths, frustum_box
from uavexp.mapping.map_parameters import MapParameters
from uavexp.mapping.occupancy import FusionRule, OccupancyMap, Voxels, observe, reciprocals
from uavexp.mapping.rays import integrate_rays
from uavexp.parameters import option
from uavexp.scan import RayScan, Scan
from uavexp.scene import Scene
from uavexp.types import MapUpdate

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


@nb.njit(cache=True, inline="always")
def _visible_part(
    count: int, x: float, dx: float, y: float, dy: float, z: float, dz: float,
    width: int, height: int, farthest: Float, range_m: float, truncation_m: float,
) -> tuple[int, int]:  # fmt: skip
    """First and last voxel k of a column that may be updated; first > last when there is none.

    Voxel k lies at depth z + k dz and projects to u + 0.5 = (x + k dx) / (z + k dz), likewise v.
    """
    low, high = _clip(0.0, count - 1.0, z - _NEAR_M, dz)
    low, high = _clip(low, high, range_m - z, -dz)
    low, high = _clip(low, high, x, dx)
    low, high = _clip(low, high, width * z - x, width * dz - dx)
    low, high = _clip(low, high, y, dy)
    low, high = _clip(low, high, height * z - y, height * dz - dy)
    if low > high:
        return 1, 0
    # nothing behind the farthest surface in the pixel columns it crosses (u is monotonic in k)
    u_low, u_high = (x + low * dx) / (z + low * dz), (x + high * dx) / (z + high * dz)
    first_u = max(int(min(u_low, u_high) - 1e-6), 0)
    last_u = min(int(max(u_low, u_high) + 1e-6), width - 1)
    reach = -np.inf
    for u in range(first_u, last_u + 1):
        reach = max(reach, farthest[u])
    low, high = _clip(low, high, reach + truncation_m - z, -dz)
    if low > high:
        return 1, 0
    return int(np.ceil(low)), int(np.floor(high))


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
    height, width = depth.shape
    nx, ny, nz = voxels.shape
    fx, fy = intrinsics[0], intrinsics[1]
    right, down = intrinsics[2] + 0.5, intrinsics[3] + 0.5  # pixel u spans [u, u + 1) with these
    range_m = max_range_m + rule.truncation_m
    farthest = column_depths(depth)
    box = frustum_box(intrinsics, height, width, range_m / voxel_m, rotation, corner)
    low_x, high_x = max(int(np.ceil(box[0, 0])), 0), min(int(np.floor(box[1, 0])), nx - 1)
    low_y, high_y = max(int(np.ceil(box[0, 1])), 0), min(int(np.floor(box[1, 1])), ny - 1)
    reciprocal = reciprocals(rule)
    # camera axes in metres a voxel; the image's two turned into pixels times depth
    forward = rotation[:, 2] * voxel_m
    rightward = rotation[:, 0] * (voxel_m * fx) + right * forward
    downward = rotation[:, 1] * (voxel_m * fy) + down * forward
    for i in range(low_x, high_x + 1):
        for j in range(low_y, high_y + 1):
            ox, oy, oz = i - corner[0], j - corner[1], -corner[2]
            x = rightward[0] * ox + rightward[1] * oy + rightward[2] * oz
            y = downward[0] * ox + downward[1] * oy + downward[2] * oz
            z = forward[0] * ox + forward[1] * oy + forward[2] * oz
            first, last = _visible_part(
                nz, x, rightward[2], y, downward[2], z, forward[2],
                width, height, farthest, range_m, rule.truncation_m,
            )  # fmt: skip
            column = (i * ny + j) * nz
            for k in range(first, last + 1):
                depth_m = z + k * forward[2]
                inverse = 1.0 / depth_m
                u = int((x + k * rightward[2]) * inverse)
                v = int((y + k * downward[2]) * inverse)
                if u >= width or v >= height:
                    continue
                observed = depth[v, u] - depth_m
                if not observed >= -rule.truncation_m or (depth_m > max_range_m and observed > 0.0):
                    continue
                observed = min(observed, rule.truncation_m)
                count = observe(voxels, column + k, observed, rule, reciprocal, count)
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
        return self._live().publish(time_s)

    @property
    def field(self) -> DistanceField:
        """The live distance field, as of the last `update`."""
        return self._live().field

    def _live(self) -> OccupancyMap:
        if self._map is None:
            raise RuntimeError("reset() must come first")
        return self._map
