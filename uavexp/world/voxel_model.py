"""Voxels of the true geometry, for the static studies of paper 2."""

from __future__ import annotations

import numba as nb
import numpy as np
from scipy import ndimage

from uavexp.arrays import Bool, Float, Int32
from uavexp.errors import require, require_positive
from uavexp.types import World
from uavexp.world.raster import rasterise

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
    surface = rasterise(world.vertices_m, world.triangles, bounds[0].copy(), voxel_size_m, shape)
    start = np.floor((world.start_m - bounds[0]) / voxel_size_m).astype(np.int64)
    require(
        bool(((start >= 0) & (start < shape)).all()) and not surface[tuple(start)],
        "start_m lies outside the bounds, or in a voxel that a surface enters",
    )
    part, _ = ndimage.label(~surface)
    return np.asarray(part != part[tuple(start)]), bounds[0].copy()


def inflate(occupied: Bool, radius_voxels: float) -> Bool:
    """Voxels (X, Y, Z) whose centre lies nearer than a radius to the centre of an occupied one."""
    return np.asarray(squared_distance(occupied, radius_voxels) < radius_voxels**2)


def squared_distance(occupied: Bool, reach_voxels: float) -> Int32:
    """Squared distance (X, Y, Z) to the nearest occupied voxel, in voxels; too large where none is near."""
    reach = int(np.ceil(reach_voxels))
    cap = (reach + 1) ** 2
    squared = np.where(occupied, np.int32(0), np.int32(cap))
    for axis in range(3):
        squared = _spread(np.ascontiguousarray(np.moveaxis(squared, axis, 0)), reach)
        squared = np.moveaxis(squared, 0, axis)
    return squared


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
