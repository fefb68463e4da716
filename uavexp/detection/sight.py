"""Whether a scan shows a place to be empty, or tells nothing of it: it may be hidden or out of view."""

from __future__ import annotations

import numba as nb
import numpy as np

from uavexp.arrays import Bool, Float, Float32
from uavexp.scan import DepthScan, Scan

_LEAST_RAYS = 3  # through a box that is to count as empty
_CORE = 0.5  # share of a box's size that rays must pass: its edges may be beside the body
_LEVEL = 1e-9  # a ray that rises less along an axis never crosses a border of it


def seen_empty(scan: Scan, centre_m: Float, half_size_m: Float) -> Bool:
    """Whether rays pass through the core of each upright box, and more than end in it.

    Args:
        scan: of any sensor.
        centre_m: (M, 3) of the boxes.
        half_size_m: (M, 3).
    """
    if len(centre_m) == 0:
        return np.zeros(0, dtype=np.bool_)
    origin_m, direction, reach = _rays(scan)
    low_m, high_m = centre_m - _CORE * half_size_m, centre_m + _CORE * half_size_m
    passed, ended = _count(origin_m, direction, reach, low_m, high_m)
    return np.asarray((passed >= _LEAST_RAYS) & (passed > ended))


def _rays(scan: Scan) -> tuple[Float, Float32, Float32]:
    """Origin (3,), directions (N, 3) and how far along each it is free (N,), in lengths of these."""
    if isinstance(scan, DepthScan):
        height, width = scan.depth_m.shape
        right = (np.arange(width) - scan.centre_px[0]) / scan.focal_px[0]
        down = (np.arange(height) - scan.centre_px[1]) / scan.focal_px[1]
        image = np.stack([*np.meshgrid(right, down), np.ones((height, width))], axis=-1)
        direction = (image.reshape(-1, 3) @ scan.camera_rotation.T).astype(np.float32)
        return scan.camera_position_m, direction, np.minimum(scan.depth_m, scan.max_range_m).reshape(-1)
    return scan.origin_m, scan.direction, np.minimum(scan.range_m, np.float32(scan.max_range_m))


@nb.njit(cache=True)
def _count(origin: Float, direction: Float32, reach: Float32, low: Float, high: Float) -> tuple[Float, Float]:
    """How many rays pass through each box (M,), and how many end in it (M,); NaN is no ray."""
    passed, ended = np.zeros(low.shape[0]), np.zeros(low.shape[0])
    for n in range(direction.shape[0]):
        if not reach[n] > 0.0:
            continue
        for m in range(low.shape[0]):
            enters, leaves = 0.0, np.inf
            for axis in range(3):
                way, near, far = direction[n, axis], low[m, axis] - origin[axis], high[m, axis] - origin[axis]
                if abs(way) < _LEVEL:
                    if near > 0.0 or far < 0.0:
                        leaves = -1.0
                    continue
                enters = max(enters, min(near / way, far / way))
                leaves = min(leaves, max(near / way, far / way))
            if enters <= leaves:
                passed[m] += reach[n] > leaves
                ended[m] += enters <= reach[n] <= leaves
    return passed, ended
