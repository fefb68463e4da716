"""How much of what could be seen has been seen, in truth."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from uavexp.field import DistanceField
from uavexp.scene import Scene
from uavexp.types import Limits, World


def seen_share(
    world: World, scene: Scene, field: DistanceField, limits: Limits, cell_m: float = 0.25
) -> float:
    """Observed share of the reachable volume, 0 to 1.

    Reachable: free cells of the flight bounds whose true clearance exceeds the body's radius,
    face-connected to the start.
    """
    low, high = world.flight_bounds_m
    axes = [np.arange(low[axis] + 0.5 * cell_m, high[axis], cell_m) for axis in range(3)]
    cells_m = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    points_m = cells_m.reshape(-1, 3)
    clear = (scene.distance_m(points_m) > limits.body_radius_m) & scene.space.is_free(points_m)
    clear = clear.reshape(cells_m.shape[:3])
    label, _ = ndimage.label(clear)
    start = np.unravel_index(
        np.argmin(np.where(clear, np.linalg.norm(cells_m - world.start_m, axis=-1), np.inf)), clear.shape
    )
    reachable = label == label[start]
    return float(field.observed(cells_m[reachable]).mean())
