"""Voxels of the true geometry, for the static studies of paper 2."""

from __future__ import annotations

import numba as nb
import numpy as np
from scipy import ndimage

from uavexp.arrays import Bool, Float, Float32, Int, Int32
from uavexp.errors import require, require_positive
from uavexp.triangle_grid import box_meets_triangle
from uavexp.types import World

_MAX_VOXELS = 1 << 31


def voxel_model(world: World, voxel_size_m: float, bounds_m: Float | None = None) -> tuple[Bool, Float]:
    """Occupied voxels of a world: those that a surface enters, and all that air does not reach.

    Exact for the triangles (separating axes), but a voxel that a surface enters by less than a
    thousandth of its size is free, and a surface between two voxels fills the upper. Air is
    what is joined with the start through faces of free voxels: the inside of a solid is
    occupied, and so is what lies behind a closed wall.

    Args:
        world: its mesh and start.
        voxel_size_m: edge of a voxel.
        bounds_m: box (2, 3) to fill; the world's own when None. Voxels over the edge are left out.

    Returns:
        Occupancy (X, Y, Z) and the lower corner (3,) of voxel (0, 0, 0), m.
    """
    require_positive(voxel_size_m=voxel_size_m)
    bounds = world.bounds_m if bounds_m is None else np.asarray(bounds_m, dtype=np.float64)
    shape = np.floor((bounds[1] - bounds[0]) / voxel_size_m + 1e-6).astype(np.int64)
    require(
        bool((shape >= 1).all()) and int(np.prod(shape)) <= _MAX_VOXELS,
        f"voxel_size_m {voxel_size_m:g} makes {' x '.join(map(str, shape))} voxels of the bounds",
    )
    surface = _rasterise(world.vertices_m, world.triangles, bounds[0].copy(), voxel_size_m, shape)
    start = np.floor((world.start_m - bounds[0]) / voxel_size_m).astype(np.int64)
    require(
        bool(((start >= 0) & (start < shape)).all()) and not surface[tuple(start)],
        "start_m lies outside the bounds, or in a voxel that a surface enters",
    )
    part, _ = ndimage.label(~surface)
    return np.asarray(part != part[tuple(start)]), bounds[0].copy()


@nb.njit(cache=True)
def _rasterise(vertices: Float32, triangles: Int32, low: Float, voxel: float, shape: Int) -> Bool:
    """Voxels (X, Y, Z) that a triangle enters."""
    occupied = np.zeros((shape[0], shape[1], shape[2]), dtype=np.bool_)
    upright, half = np.eye(3), np.full(3, 0.501 * voxel)
    corner, centre = np.empty((3, 3)), np.empty(3)
    first, last = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    for t in range(triangles.shape[0]):
        for n in range(3):
            for axis in range(3):
                corner[n, axis] = vertices[triangles[t, n], axis]
        for axis in range(3):
            least, most = corner[:, axis].min(), corner[:, axis].max()
            first[axis] = max(int(np.floor((least - low[axis]) / voxel + 0.001)), 0)
            end = max(int(np.ceil((most - low[axis]) / voxel - 0.001)) - 1, first[axis])
            last[axis] = min(end, shape[axis] - 1)
        for i in range(first[0], last[0] + 1):
            centre[0] = low[0] + (i + 0.5) * voxel
            for j in range(first[1], last[1] + 1):
                centre[1] = low[1] + (j + 0.5) * voxel
                for k in range(first[2], last[2] + 1):
                    if occupied[i, j, k]:
                        continue
                    centre[2] = low[2] + (k + 0.5) * voxel
                    occupied[i, j, k] = box_meets_triangle(corner, centre, upright, half)
    return occupied


def inflate(occupied: Bool, radius_voxels: float) -> Bool:
    """Voxels (X, Y, Z) whose centre lies nearer than a radius to the centre of an occupied one."""
    reach = int(np.ceil(radius_voxels))
    cap = (reach + 1) ** 2
    squared = np.where(occupied, 0, cap).astype(np.int32)
    for axis in range(3):
        squared = _spread(np.ascontiguousarray(np.moveaxis(squared, axis, 0)), reach)
        squared = np.moveaxis(squared, 0, axis)
    return np.asarray(squared < radius_voxels**2)


@nb.njit(cache=True)
def _spread(squared: Int32, reach: int) -> Int32:
    """Least squared distance over the neighbours within reach along the first axis."""
    spread = squared.copy()
    for i in range(squared.shape[0]):
        for shift in range(1, reach + 1):
            add = np.int32(shift * shift)
            for other in (i - shift, i + shift):
                if 0 <= other < squared.shape[0]:
                    for j in range(squared.shape[1]):
                        source, target = squared[other, j], spread[i, j]
                        for k in range(squared.shape[2]):
                            target[k] = min(target[k], np.int32(source[k] + add))
    return spread
