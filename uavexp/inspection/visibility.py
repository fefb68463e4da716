"""What a level, yawing camera sees: target cells by rays through a voxel grid (numba).

A cell is in sight when it lies within range, is met at no more than the incidence limit,
and nothing occupied lies on the straight line to it. Rays visit exactly the voxels that the
line crosses (Amanatides and Woo 1987). The last `tolerance_m` before the cell are not
looked at: the cell's own surface fills voxels there, thicker in a map made from noisy depth.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Bool, Float, Int, Int32, UInt8
from uavexp.errors import require, require_non_negative, require_positive

OCCUPIED = 2  # value of `DistanceField.state`


@dataclass(frozen=True, slots=True, kw_only=True)
class Camera:
    """Inspection camera: level, its optical axis along the vehicle's yaw.

    Attributes:
        horizontal_fov_rad: full horizontal angle of view.
        vertical_fov_rad: full vertical angle of view, of the image's middle column.
        min_range_m: nearest distance at which a cell counts as seen.
        max_range_m: farthest such distance.
        max_incidence_rad: greatest angle between the line of sight and a cell's normal.
        tolerance_m: last part of a line of sight that need not be free.
    """

    horizontal_fov_rad: float = math.radians(90.0)
    vertical_fov_rad: float = math.radians(73.7)
    min_range_m: float = 0.2
    max_range_m: float = 5.0
    max_incidence_rad: float = math.radians(70.0)
    tolerance_m: float = 0.2

    def __post_init__(self) -> None:
        require_positive(max_range_m=self.max_range_m)
        require_non_negative(min_range_m=self.min_range_m, tolerance_m=self.tolerance_m)
        require(
            self.min_range_m < self.max_range_m,
            f"min_range_m must be < max_range_m = {self.max_range_m}, got {self.min_range_m}",
        )
        for name, angle in (
            ("horizontal_fov_rad", self.horizontal_fov_rad),
            ("vertical_fov_rad", self.vertical_fov_rad),
        ):
            require(0.0 < angle < math.pi, f"{name} must be > 0 and < pi, got {angle}")
        require(
            0.0 < self.max_incidence_rad <= 0.5 * math.pi,
            f"max_incidence_rad must be > 0 and <= pi / 2, got {self.max_incidence_rad}",
        )

    @property
    def optics(self) -> Optics:
        """The same as plain numbers for kernels."""
        return Optics(
            0.5 * self.horizontal_fov_rad,
            math.tan(0.5 * self.vertical_fov_rad),
            self.min_range_m,
            self.max_range_m,
            math.cos(self.max_incidence_rad),
            self.tolerance_m,
        )


class Optics(NamedTuple):
    """A camera as its kernels read it."""

    half_width_rad: float
    half_height_slope: float  # tangent of half the vertical angle
    min_range_m: float
    max_range_m: float
    least_cosine: float
    tolerance_m: float


class Grid(NamedTuple):
    """A voxel grid as kernels read it: `DistanceField`'s state, lower corner and voxel size."""

    state: UInt8  # (X, Y, Z)
    origin_m: Float  # (3,)
    voxel_size_m: float


class Views(NamedTuple):
    """Cells seen from each of V views: view v sees `cells[starts[v]:starts[v + 1]]`, ascending."""

    starts: Int  # (V + 1,)
    cells: Int32  # (starts[-1],)

    def of(self, view: int) -> Int32:
        """Cells of one view."""
        return self.cells[self.starts[view] : self.starts[view + 1]]


@nb.njit(cache=True)
def is_clear(grid: Grid, eye: Float, point: Float, tolerance_m: float) -> bool:
    """Whether no occupied voxel lies between two points (3,), the eye's own and the last part left out."""
    shape = grid.state.shape
    delta = np.empty(3)
    cell = np.empty(3, dtype=np.int64)
    side = np.empty(3, dtype=np.int64)
    crossing = np.empty(3)  # ray parameter, 0 to 1, at which the next voxel along an axis begins
    gap = np.empty(3)
    length = 0.0
    for axis in range(3):
        start = (eye[axis] - grid.origin_m[axis]) / grid.voxel_size_m
        delta[axis] = (point[axis] - eye[axis]) / grid.voxel_size_m
        length += delta[axis] ** 2
        cell[axis] = int(np.floor(start))
        side[axis] = 1 if delta[axis] > 0.0 else -1
        if abs(delta[axis]) < 1e-12:
            crossing[axis] = gap[axis] = np.inf
        else:
            gap[axis] = 1.0 / abs(delta[axis])
            ahead = cell[axis] + 1 - start if delta[axis] > 0.0 else start - cell[axis]
            crossing[axis] = ahead * gap[axis]
    length = math.sqrt(length) * grid.voxel_size_m
    until = 1.0 - tolerance_m / length if length > 0.0 else 0.0
    while True:
        axis = 0
        if crossing[1] < crossing[axis]:
            axis = 1
        if crossing[2] < crossing[axis]:
            axis = 2
        if crossing[axis] >= until:
            return True
        cell[axis] += side[axis]
        crossing[axis] += gap[axis]
        inside = 0 <= cell[0] < shape[0] and 0 <= cell[1] < shape[1] and 0 <= cell[2] < shape[2]
        if inside and grid.state[cell[0], cell[1], cell[2]] == OCCUPIED:
            return False


@nb.njit(cache=True, inline="always")
def _is_met(optics: Optics, eye: Float, point: Float, normal: Float) -> bool:
    """Whether a cell lies within range, incidence and height for some yaw."""
    x, y, z = point[0] - eye[0], point[1] - eye[1], point[2] - eye[2]
    square = x * x + y * y + z * z
    if square > optics.max_range_m**2 or square < optics.min_range_m**2:
        return False
    if -(x * normal[0] + y * normal[1] + z * normal[2]) < optics.least_cosine * math.sqrt(square):
        return False
    return bool(abs(z) <= optics.half_height_slope * math.sqrt(x * x + y * y))


@nb.njit(cache=True, inline="always")
def half_turn(angle_rad: float) -> float:
    """The same angle within [-pi, pi): `geometry.wrap_angle` in less time, for 72 yaws of every cell."""
    return angle_rad - 2.0 * math.pi * math.floor(angle_rad / (2.0 * math.pi) + 0.5)


@nb.njit(cache=True, inline="always")
def framed_turns(optics: Optics, eye: Float, point: Float) -> tuple[float, float]:
    """Azimuth of a point, and how far a level camera's yaw may be from it to have it in the image.

    With the yaw at an angle t from the azimuth, the image's half height at a level distance d is
    slope * d * cos(t). Negative: the point is in no image.
    """
    x, y, z = point[0] - eye[0], point[1] - eye[1], abs(point[2] - eye[2])
    high = optics.half_height_slope * math.hypot(x, y)
    half_rad = min(optics.half_width_rad, math.acos(z / high)) if z < high else -1.0
    return math.atan2(y, x), half_rad


@nb.njit(cache=True, inline="always")
def is_framed(optics: Optics, eye: Float, yaw: float, point: Float) -> bool:
    """Whether a point lies in the image of a level camera with this yaw."""
    azimuth_rad, half_rad = framed_turns(optics, eye, point)
    return bool(abs(half_turn(azimuth_rad - yaw)) <= half_rad)


@nb.njit(cache=True)
def sighted_cells(grid: Grid, optics: Optics, eye: Float, point: Float, normal: Float, sought: Bool) -> Int32:
    """Of the cells looked for, those that a camera at `eye` (3,) sees with some yaw, ascending.

    Args:
        grid: what blocks sight.
        optics: the camera's.
        eye: (3,).
        point: of the cells (N, 3).
        normal: of the cells (N, 3), towards free space.
        sought: whether each cell (N,) is looked for.
    """
    found = np.empty(point.shape[0], dtype=np.int32)
    count = 0
    for n in range(point.shape[0]):
        if (
            sought[n]
            and _is_met(optics, eye, point[n], normal[n])
            and is_clear(grid, eye, point[n], optics.tolerance_m)
        ):
            found[count] = n
            count += 1
    return found[:count].copy()


@nb.njit(cache=True)
def visible_cells(
    grid: Grid, optics: Optics, eye: Float, yaw: float, point: Float, normal: Float, sought: Bool
) -> Int32:
    """Of the cells looked for, those that a camera at `eye` sees with yaw `yaw`, as `sighted_cells`."""
    found = np.empty(point.shape[0], dtype=np.int32)
    count = 0
    for n in range(point.shape[0]):
        if (
            sought[n]
            and _is_met(optics, eye, point[n], normal[n])
            and is_framed(optics, eye, yaw, point[n])
            and is_clear(grid, eye, point[n], optics.tolerance_m)
        ):
            found[count] = n
            count += 1
    return found[:count].copy()


@nb.njit(cache=True)
def _views(
    grid: Grid, optics: Optics, eyes: Float, yaws: Float, point: Float, normal: Float
) -> tuple[Int, Int32]:
    starts = np.zeros(eyes.shape[0] + 1, dtype=np.int64)
    cells = np.empty(1024, dtype=np.int32)
    sought = np.ones(point.shape[0], dtype=np.bool_)
    for view in range(eyes.shape[0]):
        seen = visible_cells(grid, optics, eyes[view], yaws[view], point, normal, sought)
        begin, end = starts[view], starts[view] + seen.shape[0]
        while end > cells.shape[0]:
            cells = np.concatenate((cells, np.empty_like(cells)))
        cells[begin:end] = seen
        starts[view + 1] = end
    return starts, cells[: starts[-1]].copy()


def views_of(
    grid: Grid, camera: Camera, eyes_m: Float, yaws_rad: Float, point_m: Float, normal: Float
) -> Views:
    """Cells seen from views (V, 3) with yaws (V,); cells as `sighted_cells`."""
    return Views(*_views(grid, camera.optics, eyes_m, yaws_rad, point_m, normal))


@nb.njit(cache=True)
def witnesses(grid: Grid, optics: Optics, eyes: Float, point: Float, normal: Float) -> Int:
    """The first of the eyes (E, 3) from which each cell is seen with some yaw (N,); -1: none."""
    witness = np.full(point.shape[0], -1, dtype=np.int64)
    waiting = np.arange(point.shape[0])
    size = waiting.shape[0]
    for eye in range(eyes.shape[0]):
        kept = 0
        for item in range(size):
            n = waiting[item]
            if _is_met(optics, eyes[eye], point[n], normal[n]) and is_clear(
                grid, eyes[eye], point[n], optics.tolerance_m
            ):
                witness[n] = eye
            else:
                waiting[kept] = n
                kept += 1
        size = kept
    return witness


def seen_by(views: Views, cells: int) -> Bool:
    """Whether each of so many cells is in any of the views (cells,)."""
    seen = np.zeros(cells, dtype=np.bool_)
    seen[views.cells] = True
    return seen
