"""Which cells of the surface have really been seen, and which could be: asked of the true geometry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavexp.arrays import Bool, Float, Int
from uavexp.field import DistanceField
from uavexp.inspection.inspection_plan import sparse_places
from uavexp.inspection.reference_surface import Surface
from uavexp.inspection.travel_lattice import lattice_of
from uavexp.inspection.visibility import Camera, Grid, witnesses
from uavexp.mission.eye import Eye
from uavexp.scene import Scene
from uavexp.types import World


@dataclass(frozen=True, slots=True, kw_only=True)
class Coverage:
    """When each cell was first seen, in truth.

    Attributes:
        surface: target cells (N,), of the reference map or of the truth.
        seen_s: (N,) first time seen; inf: not yet. Written by `count`.
    """

    surface: Surface
    seen_s: Float

    def count(self, eye: Eye, time_s: float) -> None:
        """Count what the eye saw in its last look."""
        self.seen_s[eye.sees(self.surface, np.isinf(self.seen_s))] = time_s


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
