"""Thin things seen edge-on: what a depth image hits near by occupies the voxel that it lies in (numba).

Projective fusion asks of each voxel what its own centre sees. A plate that lies between two layers of
centres, seen along itself, is asked of by none, though a few pixels hit its edge: a shelf at the height of
the camera. Here each pixel's own point, taken half a voxel into what it hit, is a hit of the voxel that holds
it, once a scan; two such hits occupy it. Into a wall, that is a voxel which fusion occupies anyway.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from uavexp.arrays import Float, Float32, UInt8
from uavexp.mapping.occupancy import FusionRule, Voxels, enlist, hit_again

_INTO = 0.5  # of a voxel, into what was hit


@nb.njit(cache=True)
def hit_points(
    voxels: Voxels, depth_m: Float32, intrinsics: Float, range_m: float, rotation: Float, corner: Float,
    voxel_m: float, rule: FusionRule, told: UInt8, scan: int, count: int,
) -> int:  # fmt: skip
    """Count the points of a depth image as hits; returns how many voxels now stand in `changes`.

    Args:
        voxels: of the map.
        depth_m: (H, W) along the optical axis.
        intrinsics: (4,) fx, fy, cx, cy.
        range_m: only nearer ones count.
        rotation: (3, 3) camera to world.
        corner: (3,) the camera in voxels, counted from the centre of voxel (0, 0, 0).
        voxel_m: edge of a voxel.
        rule: fusion and occupancy.
        told: (N,) number of the scan that hit each voxel last.
        scan: number of this one, 1 to 255.
        count: how many of `changes` are in use.
    """
    fx, fy, cx, cy = intrinsics
    nx, ny, nz = voxels.shape
    r = rotation
    for v in range(depth_m.shape[0]):
        for u in range(depth_m.shape[1]):
            depth = depth_m[v, u]
            if not 0.0 < depth < range_m:  # nothing measured, or too far
                continue
            x, y = (u - cx) / fx, (v - cy) / fy
            far = depth / voxel_m + _INTO / np.sqrt(x * x + y * y + 1.0)
            i = int(np.floor(far * (r[0, 0] * x + r[0, 1] * y + r[0, 2]) + corner[0] + 0.5))
            j = int(np.floor(far * (r[1, 0] * x + r[1, 1] * y + r[1, 2]) + corner[1] + 0.5))
            k = int(np.floor(far * (r[2, 0] * x + r[2, 1] * y + r[2, 2]) + corner[2] + 0.5))
            if not (0 <= i < nx and 0 <= j < ny and 0 <= k < nz):
                continue
            at = (i * ny + j) * nz + k
            if told[at] == scan:
                continue
            told[at] = scan
            count = enlist(voxels, at, hit_again(np.int64(voxels.live[at]), rule), count)
    return count
