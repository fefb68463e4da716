"""The map at the end of a flight as its log keeps it: the free voxels, and since when each was occupied."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uavexp.arrays import Bool, Float, Float32, Int, Int32
from uavexp.field import FREE, DistanceField
from uavexp.log import MapGrid


def map_grid(field: DistanceField, mapped: Int, found: Sequence[Int32], times_s: Sequence[float]) -> MapGrid:
    """What a log keeps of a map.

    Args:
        field: at the end.
        mapped: its occupied voxels (N,), flat.
        found: the occupied voxels of each ESDF update's change log.
        times_s: of these updates.
    """
    return MapGrid(
        origin_m=np.array(field.origin_m, dtype=np.float64),
        voxel_size_m=field.voxel_size_m,
        shape=np.array(field.state.shape, dtype=np.int64),
        free=np.packbits(field.state.ravel() == FREE),
        occupied_s=first_s(mapped, found, times_s),
    )


def free_voxels(grid: MapGrid) -> Bool:
    """Whether each voxel (X, Y, Z) was mapped as free; without any voxel where the log did not note it."""
    shape = tuple(grid.shape) if grid.shape.size else (0, 0, 0)
    return np.unpackbits(grid.free, count=int(np.prod(shape))).reshape(shape).astype(np.bool_)


def first_s(wanted: Int, found: Sequence[Int32], times_s: Sequence[float]) -> Float32:
    """When each voxel was first found.

    Args:
        wanted: voxels (N,).
        found: voxels of each time.
        times_s: ascending.

    Returns:
        (N,) times; 0 s of voxels never found, which were known before the flight.
    """
    first: Float = np.zeros(len(wanted))
    every = np.concatenate([np.zeros(0, dtype=np.int32), *found])
    if every.size and len(wanted):
        voxels, index = np.unique(every, return_index=True)  # of equal ones the first
        at_s = np.repeat(np.asarray(times_s), [len(now) for now in found])[index]
        place = np.minimum(np.searchsorted(voxels, wanted), voxels.size - 1)
        first = np.where(voxels[place] == wanted, at_s[place], 0.0)
    return first.astype(np.float32)
