"""Where movers can be: on air that is joined with the start."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from uavexp.arrays import Bool, Float
from uavexp.errors import WorldError
from uavexp.scene import Scene
from uavexp.types import World
from uavexp.world.task import LAYER_CELL_M, free_layer

FLOOR_GAP_M = 0.02  # under those that stand: so that the floor does not block them
_LAYER_CLEARANCE_M = 0.15


class Air:
    """The air at the start's height that is joined with it, and the floor under it."""

    def __init__(self, world: World, scene: Scene) -> None:
        self._scene, self._flight_m = scene, world.flight_bounds_m
        self._height_m = float(world.start_m[2])
        points_m, part, _ = free_layer(scene, world.flight_bounds_m, self._height_m, _LAYER_CLEARANCE_M)
        if points_m.shape[0] == 0:
            raise WorldError("movers: no free air at the start's height")
        nearest = np.linalg.norm(points_m - world.start_m, axis=1).argmin()
        self._points_m = points_m[part == part[nearest]]
        self._tree = cKDTree(self._points_m[:, :2])

    def floor_m(self, points_m: Float) -> Float:
        """Height (N,) of the floor under points (N, 2): the first surface below the start's height.

        Where there is none it is the lower flight bound.
        """
        rays = np.zeros((points_m.shape[0], 6), np.float32)
        rays[:, :2], rays[:, 2], rays[:, 5] = points_m, self._height_m, -1.0
        fall_m = self._scene.fixed_cast(rays)[0].astype(np.float64)
        return np.where(np.isfinite(fall_m), self._height_m - fall_m, self._flight_m[0, 2])

    def draw(self, rng: np.random.Generator, half_m: Float, *, stands: bool) -> Float:
        """Draw a centre (3,), on the floor or anywhere between the flight bounds."""
        index, shift, rise = rng.integers(len(self._points_m)), rng.random(2) - 0.5, rng.random()
        xy = self._points_m[index, :2] + LAYER_CELL_M * shift
        if stands:
            return np.array([*xy, float(self.floor_m(xy[None])[0]) + half_m[2] + FLOOR_GAP_M])
        low, high = self._flight_m[:, 2]
        return np.array([*xy, low + rise * (high - low)])

    def bounds_m(self, half_m: Float, centre_m: Float, *, stands: bool) -> tuple[Float, Float]:
        """Least and greatest centre (3,) of a body: inside the flight bounds, on its floor if it stands."""
        low, high = self._flight_m.copy()
        low[:2] += half_m[:2]
        high[:2] -= half_m[:2]
        if stands:
            low[2] = high[2] = centre_m[2]
        return low, high

    def holds(self, centre_m: Float, half_m: Float) -> bool:
        """Whether no surface lies between a centre (3,) and the layer, nor meets the box around it."""
        ray = np.array([*centre_m[:2], self._height_m, 0.0, 0.0, centre_m[2] - self._height_m], np.float32)
        blocked = ray[5] != 0.0 and float(self._scene.fixed_cast(ray[None])[0][0]) <= 1.0
        return not blocked and not self._scene.touches_fixed(centre_m, np.eye(3), 2.0 * half_m)

    def near_layer(self, points_m: Float) -> Bool:
        """Whether points (N, 2) lie over the free layer, to its spacing."""
        distance_m, _ = self._tree.query(points_m)
        return np.asarray(distance_m <= 0.75 * LAYER_CELL_M)
