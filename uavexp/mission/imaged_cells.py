"""Which cells of a surface a depth image shows (numba).

A cell is shown when its middle falls into the image, within the camera's range and incidence, and what is
measured at that pixel lies on the cell's plane: no farther from it, along the cell's normal, than a tolerance
and what the sensor's noise may add there (`depth_noise.error_bound_m`). A pixel without a return shows
nothing. The cell's plane is compared at the pixel's own ray, so that a wide pixel on a slanted wall does not
count against the cell. At 5 m a cell of 0.2 m, met square on, is two pixels wide in the image of
`sensor=rgbd`. Left out: motion blur (a frame is taken in an instant), light, colour and texture.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Bool, Float, Float32, Int32
from uavexp.inspection.visibility import Optics
from uavexp.sensor.depth_noise import DepthNoise, error_bound_m


class Frame(NamedTuple):
    """A depth image as its kernel reads it (see `scan.DepthScan`)."""

    depth_m: Float32  # (H, W)
    fx: float
    fy: float
    cx: float
    cy: float
    position_m: Float  # (3,)
    rotation: Float  # (3, 3) camera to world


@nb.njit(cache=True, error_model="numpy")
def _pixel(frame: Frame, x: float, y: float, z: float) -> tuple[int, int]:
    """Row and column that a direction falls on, in the world's axes; -1: on none."""
    r = frame.rotation
    depth = r[0, 2] * x + r[1, 2] * y + r[2, 2] * z
    if not depth > 0.0:
        return -1, -1
    u = frame.fx * (r[0, 0] * x + r[1, 0] * y + r[2, 0] * z) / depth + frame.cx
    v = frame.fy * (r[0, 1] * x + r[1, 1] * y + r[2, 1] * z) / depth + frame.cy
    height, width = frame.depth_m.shape
    if not (-0.5 <= u < width - 0.5 and -0.5 <= v < height - 0.5):
        return -1, -1
    return math.floor(v + 0.5), math.floor(u + 0.5)


@nb.njit(cache=True, error_model="numpy")
def imaged_cells(
    frame: Frame, optics: Optics, noise: DepthNoise, tolerance_m: float, point: Float, normal: Float,
    sought: Bool,
) -> Int32:  # fmt: skip
    """Of the cells looked for, those that a depth image shows, ascending.

    Args:
        frame: the image.
        optics: range and incidence within which a cell counts.
        noise: of the sensor.
        tolerance_m: between a cell and the surface measured in its place, along the normal.
        point: of the cells (N, 3).
        normal: of the cells (N, 3), towards free space.
        sought: whether each cell (N,) is looked for.
    """
    found = np.empty(point.shape[0], dtype=np.int32)
    count, r = 0, frame.rotation
    for n in range(point.shape[0]):
        if not sought[n]:
            continue
        x, y = point[n, 0] - frame.position_m[0], point[n, 1] - frame.position_m[1]
        z = point[n, 2] - frame.position_m[2]
        square = x * x + y * y + z * z
        if square > optics.max_range_m**2 or square < optics.min_range_m**2:
            continue
        plane_m = -(x * normal[n, 0] + y * normal[n, 1] + z * normal[n, 2])  # the camera before the cell
        if plane_m < optics.least_cosine * math.sqrt(square):
            continue
        row, column = _pixel(frame, x, y, z)
        if row < 0:
            continue
        across, down = (column - frame.cx) / frame.fx, (row - frame.cy) / frame.fy
        facing = 0.0  # how fast a point nears the plane, by depth along the pixel's ray
        for axis in range(3):
            facing -= normal[n, axis] * (r[axis, 0] * across + r[axis, 1] * down + r[axis, 2])
        measured = float(frame.depth_m[row, column])
        allowed_m = tolerance_m + abs(facing) * error_bound_m(measured, noise)
        if abs(measured * facing - plane_m) <= allowed_m < np.inf:  # false where nothing was measured
            found[count] = n
            count += 1
    return found[:count].copy()
