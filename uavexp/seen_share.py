"""How much of what could be seen has been seen, in truth: at the end, and over time."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from uavexp.arrays import Float, Int32
from uavexp.field import DistanceField
from uavexp.scene import Scene
from uavexp.types import Limits, World


def reachable_m(world: World, scene: Scene, limits: Limits, cell_m: float = 0.25) -> Float:
    """Middles (E, 3) of the cells of the reachable volume.

    Reachable: free cells of the flight bounds whose true clearance exceeds the body's radius,
    face-connected to the start; none where none is so clear.
    """
    low, high = world.flight_bounds_m
    axes = [np.arange(low[axis] + 0.5 * cell_m, high[axis], cell_m) for axis in range(3)]
    axes = [
        axis if len(axis) else np.array([middle])
        for axis, middle in zip(axes, 0.5 * (low + high), strict=True)
    ]
    cells_m = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    points_m = cells_m.reshape(-1, 3)
    clear = (scene.distance_m(points_m) > limits.body_radius_m) & scene.space.is_free(points_m)
    clear = clear.reshape(cells_m.shape[:3])
    if not clear.any():
        return np.zeros((0, 3))
    label, _ = ndimage.label(clear)
    start = np.unravel_index(
        np.argmin(np.where(clear, np.linalg.norm(cells_m - world.start_m, axis=-1), np.inf)), clear.shape
    )
    return np.asarray(cells_m[label == label[start]])


def seen_share(field: DistanceField, cells_m: Float) -> float:
    """Observed share of cells (E, 3), 0 to 1; NaN of none."""
    return float(field.observed(cells_m).mean()) if len(cells_m) else math.nan


def seen_so_far(field: DistanceField, cells_m: Float, first_seen: Sequence[Int32]) -> Float:
    """Observed share (M,) of cells (E, 3) after each update of a map.

    Args:
        field: the map.
        cells_m: all within it.
        first_seen: the voxels that each update saw for the first time.
    """
    index = np.floor((cells_m - field.origin_m) / field.voxel_size_m).astype(np.int64)
    voxel = np.ravel_multi_index(tuple(index.T), field.state.shape)
    cells_in = np.bincount(voxel, minlength=field.state.size)
    seen = np.cumsum([int(cells_in[voxels].sum()) for voxels in first_seen])
    return np.asarray(seen / (len(cells_m) or math.nan))
