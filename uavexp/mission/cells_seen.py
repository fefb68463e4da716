"""Which cells of the surface have really been seen, and which could be: asked of the true geometry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavexp.arrays import Bool, Float, Int
from uavexp.field import DistanceField
from uavexp.inspection.inspection_plan import sparse_places
from uavexp.inspection.reference_surface import Surface
from uavexp.inspection.travel_lattice import lattice_of
from uavexp.inspection.visibility import Camera, Grid, visible_cells, witnesses
from uavexp.scene import Scene
from uavexp.types import World

_NOTHING = Grid(np.zeros((1, 1, 1), dtype=np.uint8), np.zeros(3), 1e3)  # blocks no sight


@dataclass(frozen=True, slots=True, kw_only=True)
class Coverage:
    """When each cell was first seen, in truth.

    Attributes:
        surface: target cells (N,), of the reference map or of the truth.
        camera: that looks, level.
        tolerance_m: a cell counts as seen when the true surface met on the line of sight lies
            within this of the cell, along the cell's normal.
        seen_s: (N,) first time seen; inf: not yet. Written by `look`.
    """

    surface: Surface
    camera: Camera
    tolerance_m: float
    seen_s: Float

    def look(self, scene: Scene, time_s: float, eye_m: Float, yaw_rad: float) -> None:
        """Count what the camera sees now; movers block sight like everything else."""
        point, normal = self.surface.point_m, self.surface.normal
        unseen = np.isinf(self.seen_s)
        framed = visible_cells(_NOTHING, self.camera.optics, eye_m, yaw_rad, point, normal, unseen)
        met = is_met(scene, eye_m, point[framed], normal[framed], self.tolerance_m)
        self.seen_s[framed[met]] = time_s


def is_met(scene: Scene, eye_m: Float, point_m: Float, normal: Float, tolerance_m: float) -> Bool:
    """Whether lines of sight end at the cells (N,): the true surface is there and nothing is before it.

    Args:
        scene: the truth.
        eye_m: (3,).
        point_m: of the cells (N, 3).
        normal: of the cells (N, 3).
        tolerance_m: between cell and true surface, along the normal.
    """
    line = point_m - eye_m
    length = np.linalg.norm(line, axis=1)
    way = line / length[:, None]
    eyes = np.broadcast_to(eye_m, way.shape)
    hit = scene.cast(np.hstack([eyes, way]).astype(np.float32))[0].astype(np.float64)
    return np.asarray(np.abs(hit - length) * -(way * normal).sum(axis=1) <= tolerance_m)


def reachable_m(field: DistanceField, world: World, clearance_m: float) -> Float:
    """Free places (E, 3) that the vehicle can reach from the start by a map of the world, 0.4 m apart."""
    places_m = sparse_places(lattice_of(field, world.flight_bounds_m, world.start_m, clearance_m))
    return places_m[world.space.is_free(places_m)]


def visible_anywhere(
    field: DistanceField, scene: Scene, camera: Camera, surface: Surface, eyes_m: Float, tolerance_m: float
) -> Bool:
    """Cells (N,) that exist in truth and are seen from some place that the vehicle can reach there.

    Args:
        field: of the truth (`reference_field`), its movers left out.
        scene: of the same.
        camera: that looks.
        surface: target cells (N,).
        eyes_m: (E, 3) the places (`reachable_m`).
        tolerance_m: between cell and true surface.
    """
    grid = Grid(field.state, field.origin_m, field.voxel_size_m)
    witness: Int = witnesses(grid, camera.optics, eyes_m, surface.point_m, surface.normal)
    return np.asarray((witness >= 0) & (scene.fixed_distance_m(surface.point_m) <= tolerance_m))
