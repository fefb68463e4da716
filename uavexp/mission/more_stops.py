"""Stops for what the planned ones have left unseen, by the live map [ours]."""

from __future__ import annotations

import numpy as np

from uavexp.arrays import Bool, Float
from uavexp.field import DistanceField
from uavexp.inspection.inspection_plan import Settings, path_from, sparse_places
from uavexp.inspection.reference_surface import Surface
from uavexp.inspection.travel import is_reachable, travel_lengths, travel_matrix
from uavexp.inspection.travel_lattice import lattice_of
from uavexp.inspection.viewpoints import Viewpoints, added
from uavexp.inspection.visibility import Camera, Grid, Views, witnesses
from uavexp.types import Observation


def more_stops(
    left: Surface, observation: Observation, camera: Camera, settings: Settings
) -> tuple[Viewpoints, list[int]]:
    """Stops for cells not yet scanned, by the live map, in the order of a short path.

    Args:
        left: the cells.
        observation: of the vehicle, now.
        camera: that looks.
        settings: of the plan.
    """
    grid, position_m, bounds_m = (
        live_grid(observation.field),
        observation.state.position_m,
        observation.flight_bounds_m,
    )
    lattice = lattice_of(
        observation.field, bounds_m, position_m, settings.clearance_m, settings.cell_m, settings.layer_m
    )
    eyes_m = sparse_places(lattice)
    witness = witnesses(grid, camera.optics, eyes_m, left.point_m, left.normal)

    def fits(points_m: Float) -> Bool:
        inside = ((points_m >= bounds_m[0]) & (points_m <= bounds_m[1])).all(axis=1)
        return np.asarray(inside & is_reachable(lattice, points_m))

    nothing = Viewpoints(
        position_m=np.zeros((0, 3)), yaw_rad=np.zeros(0), segment=np.zeros(0, dtype=np.int64)
    )
    unowned = np.full(len(left), -1)
    unseen = Views(np.zeros(1, dtype=np.int64), np.zeros(0, dtype=np.int32))
    stops = added(left, unowned, nothing, unseen, eyes_m, witness, grid, camera, settings.pattern, fits)
    start_m = travel_lengths(lattice, position_m[None], stops.position_m)[0]
    if len(stops) == 0 or not np.isfinite(start_m).all():
        return stops, list(range(len(stops)))
    order = path_from(start_m, travel_matrix(lattice, stops.position_m), settings.seed)
    return stops, [int(stop) for stop in order]


def live_grid(live: DistanceField) -> Grid:
    """What blocks sight on the live map."""
    return Grid(live.state, live.origin_m, live.voxel_size_m)
