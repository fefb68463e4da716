"""Map backend `dense_thin`: as `dense`, and thin things seen edge-on are mapped too (`thin`)."""

from __future__ import annotations

import dataclasses

import numpy as np

from uavexp.arrays import Float, UInt8
from uavexp.mapping.dense import Dense
from uavexp.mapping.thin import hit_points
from uavexp.memory import blank
from uavexp.parameters import Positive, option
from uavexp.scan import RayScan, Scan
from uavexp.scene import Scene


@option
class DenseThin(Dense):
    """`Dense`, where what a depth image hits near by occupies the voxel that it lies in."""

    thin_range_m: Positive = (
        3.0  # m, what is hit nearer than this; beyond, noise makes voxels of its own [ours]
    )
    _scans: int = dataclasses.field(default=0, init=False, repr=False)
    _told: UInt8 = dataclasses.field(init=False, repr=False)  # (N,) the scan that hit each voxel last

    def reset(self, bounds_m: Float, scene: Scene) -> None:
        """Begin a trial with everything unknown inside `bounds_m` (2, 3); raises as `Dense.reset`."""
        Dense.reset(self, bounds_m, scene)
        self._scans, self._told = 0, blank(self._live().voxels.live.size, np.uint8)

    def integrate(self, scan: Scan) -> None:
        """Fuse one scan; single rays are fused by where they end anyway."""
        Dense.integrate(self, scan)
        if isinstance(scan, RayScan):
            return
        grid, self._scans = self._live(), self._scans % 255 + 1
        corner = (scan.camera_position_m - grid.origin_m) / grid.voxel_size_m - 0.5
        grid.changed = hit_points(
            grid.voxels, scan.depth_m, np.array([*scan.focal_px, *scan.centre_px]), self.thin_range_m,
            scan.camera_rotation, corner, grid.voxel_size_m, self.rule(), self._told, self._scans,
            grid.changed,
        )  # fmt: skip
