"""Map backend `voxel_block_grid`: Open3D's sparse TSDF, on the CPU or a GPU.

Open3D fuses; this module decides which blocks it may touch and takes the result over:

- Handed only the blocks around surfaces, Open3D forgets what was seen free. It gets every
  block of the view frustum instead, as far as the farthest surface in that direction.
- Its voxels have their position at the corner, ours in the centre, and it truncates pixel
  coordinates where we round them: half a voxel and half a pixel are moved into the pose and
  the intrinsics, and the image gets a spare row and column, for it ignores the last ones.
- It treats NaN as a depth and infinity as too far: they are handed over as 0 (nothing) and as
  a depth that makes everything in range free.
- It fuses images only: single rays are fused by the kernel of `rays`, as by `dense`, and the
  voxels that they touch are written into its blocks, so that images go on from there.
- It caps no weight and knows no `keeps_free`: afterwards a kernel goes through the blocks,
  recovers each observation d = (w + 1) D' - w D, takes it back where the rule forbids it,
  caps the weight, and moves occupancy exactly as the backend `dense` does.

On a GPU only that last step, the occupancy and the distance field run on the CPU.
"""

from __future__ import annotations

import dataclasses
import re
from typing import Annotated, Any

import numba as nb
import numpy as np

from uavexp.arrays import Bool, Float, Float32, Int32
from uavexp.errors import ConfigError
from uavexp.field import DistanceField
from uavexp.mapping.blocks import EDGE, Blocks, blocks_of, write_voxels
from uavexp.mapping.frustum import column_depths, frustum_box
from uavexp.mapping.map_parameters import MapParameters
from uavexp.mapping.occupancy import FusionRule, OccupancyMap, Voxels, enlist, judge, keeps_free
from uavexp.mapping.rays import integrate_rays
from uavexp.o3d import open3d
from uavexp.parameters import Constraint, option
from uavexp.scan import DepthScan, RayScan, Scan
from uavexp.scene import Scene
from uavexp.types import MapUpdate

_LARGEST_START = 20_000  # blocks that are allocated at once; more are added when needed
_DEVICE = re.compile(r"CPU:0|CUDA:\d+")


@nb.njit(cache=True)
def _is_beside(at: Float, sides: Float) -> bool:
    """Whether all points (8, 3), seen from the camera, lie beyond one of its side planes (4, 3)."""
    for side in range(4):
        best = -np.inf
        for n in range(8):
            best = max(
                best, sides[side, 0] * at[n, 0] + sides[side, 1] * at[n, 1] + sides[side, 2] * at[n, 2]
            )
        if best < 0.0:
            return True
    return False


@nb.njit(cache=True)
def _reach(at: Float, farthest: Float, fx: float, cx: float) -> float:
    """Farthest measurement of the pixel columns that points (8, 3), seen from the camera, cover, m."""
    low, high = 0, farthest.shape[0]
    if at[:, 2].min() > 0.0:
        u = fx * at[:, 0] / at[:, 2] + cx + 0.5
        low, high = max(int(np.floor(u.min())), 0), min(int(np.floor(u.max())) + 1, high)
    reach = -np.inf
    for column in range(low, high):
        reach = max(reach, farthest[column])
    return reach


@nb.njit(cache=True)
def _blocks_in_view(
    farthest: Float, intrinsics: Float, height: int, range_m: float, truncation_m: float,
    rotation: Float, corner: Float, voxel_m: float, shape: tuple[int, int, int],
) -> Int32:  # fmt: skip
    """Blocks (N, 3) that may hold a voxel to update.

    Args:
        farthest: (W,) farthest measurement of each pixel column, m; -inf where there is none.
        intrinsics: (4,) fx, fy, cx, cy.
        height: of the image, pixels.
        range_m: how deep to look.
        truncation_m: of the signed distance.
        rotation: (3, 3) camera to world.
        corner: (3,) camera position from the centre of voxel (0, 0, 0).
        voxel_m: edge of a voxel.
        shape: voxels along x, y, z.
    """
    fx, fy, cx, cy = intrinsics
    width = farthest.shape[0]
    box = frustum_box(intrinsics, height, width, range_m, rotation, corner)
    edge = EDGE * voxel_m
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    for axis in range(3):
        first[axis] = max(int(np.floor(box[0, axis] / edge)), 0)
        last[axis] = min(int(np.floor(box[1, axis] / edge)), (shape[axis] - 1) // EDGE)
        if first[axis] > last[axis]:
            return np.empty((0, 3), np.int32)
    # inward normals of the four side planes, all through the camera
    sides = np.array(
        [
            [fx, 0.0, cx + 0.5],
            [-fx, 0.0, width - 0.5 - cx],
            [0.0, fy, cy + 0.5],
            [0.0, -fy, height - 0.5 - cy],
        ]
    )
    span = (EDGE - 1) * voxel_m  # from a block's first voxel centre to its last
    found = np.empty(
        ((last[0] - first[0] + 1) * (last[1] - first[1] + 1) * (last[2] - first[2] + 1), 3), np.int32
    )
    count = 0
    at = np.empty((8, 3))
    for i in range(first[0], last[0] + 1):
        for j in range(first[1], last[1] + 1):
            for k in range(first[2], last[2] + 1):
                for n in range(8):  # the block's outermost voxel centres, seen from the camera
                    x = i * edge + (n & 1) * span - corner[0]
                    y = j * edge + ((n >> 1) & 1) * span - corner[1]
                    z = k * edge + (n >> 2) * span - corner[2]
                    for axis in range(3):
                        at[n, axis] = x * rotation[0, axis] + y * rotation[1, axis] + z * rotation[2, axis]
                if at[:, 2].max() <= 0.0 or at[:, 2].min() > range_m or _is_beside(at, sides):
                    continue
                if at[:, 2].min() > _reach(at, farthest, fx, cx) + truncation_m:
                    continue
                found[count, 0], found[count, 1], found[count, 2] = i, j, k
                count += 1
    return found[:count]


@nb.njit(cache=True)
def _take_over(
    voxels: Voxels, blocks: Int32, rows: Int32, fused: Float32, weights: Float32, axis_step: Float,
    axis_start: float, max_range_m: float, rule: FusionRule, count: int,
) -> int:  # fmt: skip
    """Carry blocks that Open3D has just fused into the map, and what the rule says back into them.

    Args:
        voxels: of the map.
        blocks: (B, 3) block coordinates.
        rows: (B,) their rows in the two arrays below.
        fused: (R, 512) Open3D's distances in truncations, x fastest.
        weights: (R, 512) their weights.
        axis_step: (3,) depth along the optical axis of a step along x, y, z, m.
        axis_start: depth of voxel (0, 0, 0), m.
        max_range_m: of the sensor.
        rule: fusion and occupancy.
        count: how many of `changes` are in use.
    """
    nx, ny, nz = voxels.shape
    for n in range(blocks.shape[0]):
        new_d, new_w = fused[rows[n]], weights[rows[n]]
        x0, y0, z0 = blocks[n, 0] * EDGE, blocks[n, 1] * EDGE, blocks[n, 2] * EDGE
        for x in range(x0, min(x0 + EDGE, nx)):
            for y in range(y0, min(y0 + EDGE, ny)):
                inner = (x - x0) + EDGE * (y - y0)
                column = (x * ny + y) * nz
                depth = axis_start + x * axis_step[0] + y * axis_step[1]
                for z in range(z0, min(z0 + EDGE, nz)):
                    local = inner + EDGE * EDGE * (z - z0)
                    at = column + z
                    had = np.int64(voxels.weight[at])
                    if new_w[local] <= had:
                        continue
                    before, byte = voxels.tsdf_m[at], np.int64(voxels.live[at])
                    after = new_d[local] * rule.truncation_m
                    observed = (had + 1) * after - had * before
                    beyond = depth + z * axis_step[2] > max_range_m and observed > 0.0
                    if beyond or keeps_free(observed, before, had, byte, rule):
                        new_d[local] = before / rule.truncation_m
                        new_w[local] = had
                        continue
                    voxels.tsdf_m[at] = after
                    voxels.weight[at] = np.uint8(had + (had < rule.max_weight))
                    new_w[local] = voxels.weight[at]
                    moved = judge(observed, before, had, after, byte, rule)
                    if moved != byte:
                        count = enlist(voxels, at, moved, count)
    return count


@option
class VoxelBlockGrid(MapParameters):
    """Open3D's voxel block grid over the world's bounds; see `MapParameters`."""

    device: Annotated[str, Constraint("CPU:0 or CUDA:<number>", _DEVICE.fullmatch)] = "CPU:0"  # CPU:0 or
    # CUDA:<number>; CUDA needs the package open3d in place of open3d-cpu

    _map: OccupancyMap | None = dataclasses.field(default=None, init=False, repr=False)
    _grid: Any = dataclasses.field(default=None, init=False, repr=False)
    _on: Any = dataclasses.field(default=None, init=False, repr=False)

    def reset(self, bounds_m: Float, scene: Scene) -> None:
        """Begin a trial with everything unknown inside `bounds_m` (2, 3).

        Raises:
            ConfigError: the device is not there.
            WorldError: the map would need more than `max_memory_mb`.
        """
        self._check_device()
        self._map = self.empty_map(bounds_m)
        blocks = int(np.prod([-(-count // EDGE) for count in self._map.shape]))
        self._on = open3d.core.Device(self.device)
        self._grid = open3d.t.geometry.VoxelBlockGrid(
            attr_names=("tsdf", "weight"),
            attr_dtypes=(open3d.core.float32, open3d.core.float32),
            attr_channels=((1), (1)),
            voxel_size=self.voxel_size_m,
            block_resolution=EDGE,
            block_count=min(blocks, _LARGEST_START),
            device=self._on,
        )

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
            self._hand_over(integrate_rays(scan, grid, self.rule()))
            return
        intrinsics = np.array([*scan.focal_px, *scan.centre_px])
        corner = scan.camera_position_m - grid.origin_m - 0.5 * self.voxel_size_m
        blocks = _blocks_in_view(
            column_depths(scan.depth_m), intrinsics, scan.depth_m.shape[0],
            scan.max_range_m + self.truncation_m, self.truncation_m, scan.camera_rotation, corner,
            self.voxel_size_m, grid.shape,
        )  # fmt: skip
        if blocks.shape[0] == 0:  # Open3D raises on an empty list
            return
        self._fuse(scan, blocks, corner)
        axis = scan.camera_rotation[:, 2]
        with Blocks(self._grid, blocks, self._on) as (rows, fused, weights):
            grid.changed = _take_over(
                grid.voxels, blocks, rows, fused, weights, axis * self.voxel_size_m, -float(axis @ corner),
                scan.max_range_m, self.rule(), grid.changed,
            )  # fmt: skip

    def update(self, time_s: float) -> MapUpdate:
        """Bring the ESDF up to date; return what changed since the last call."""
        grid = self._live()
        self._hand_over(grid.fade(time_s))
        return grid.publish(time_s)

    @property
    def field(self) -> DistanceField:
        """The live distance field, as of the last `update`."""
        return self._live().field

    def _live(self) -> OccupancyMap:
        if self._map is None:
            raise RuntimeError("reset() must come first")
        return self._map

    def _check_device(self) -> None:
        if self.device.startswith("CUDA"):
            count = open3d.core.cuda.device_count()
            if int(self.device.removeprefix("CUDA:")) >= count:
                raise ConfigError(
                    f"device {self.device} is not there: Open3D sees {count} CUDA devices; it needs an "
                    "NVIDIA GPU and the package open3d in place of open3d-cpu (never both), or device=CPU:0"
                )

    def _hand_over(self, touched: Int32) -> None:
        """Write voxels (N,) that were changed outside of Open3D into its blocks."""
        grid = self._live()
        blocks, local = blocks_of(touched, grid.shape)
        if blocks.shape[0] == 0:
            return
        self._grid.hashmap().activate(open3d.core.Tensor(blocks, device=self._on))
        with Blocks(self._grid, blocks, self._on) as (rows, fused, weights):
            write_voxels(touched, local, rows, grid.voxels, self.truncation_m, fused, weights)

    def _fuse(self, scan: DepthScan, blocks: Int32, corner: Float) -> None:
        """Let Open3D integrate the scan into `blocks`."""
        core = open3d.core
        height, width = scan.depth_m.shape
        depth = np.zeros((height + 1, width + 1, 1), np.float32)
        # farther than any voxel of a block in view, so that it makes free and never a surface
        free = np.float32(scan.max_range_m + 2.0 * self.truncation_m + 2.0 * EDGE * self.voxel_size_m)
        known: Bool = ~np.isnan(scan.depth_m)
        depth[:-1, :-1, 0] = np.where(known, np.minimum(scan.depth_m, free), np.float32(0.0))
        pose = np.eye(4)
        pose[:3, :3] = scan.camera_rotation.T
        pose[:3, 3] = -scan.camera_rotation.T @ corner
        camera = np.eye(3)
        camera[0, 0], camera[1, 1] = scan.focal_px
        camera[:2, 2] = np.asarray(scan.centre_px) + 0.5
        self._grid.integrate(
            core.Tensor(blocks, device=self._on),
            open3d.t.geometry.Image(core.Tensor(depth, device=self._on)),
            core.Tensor(camera),
            core.Tensor(pose),
            depth_scale=1.0,
            depth_max=float(free) + 1.0,
            trunc_voxel_multiplier=self.truncation_m / self.voxel_size_m,
        )
