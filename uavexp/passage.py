"""Whether a world's narrowest place can be passed by what is to fly through it, told before the flight.

A map of voxels shows a passage narrower than it is: its sides fall into voxels that are occupied as a whole,
half a voxel each on average and one at worst, and the middle of what is left lies up to half a voxel from the
nearest place that a search tries. So a planner passes every door whose true clearance is a voxel and a half
more than what it keeps, however the door lies in the map (measured on doors of 0.65 to 0.9 m at four places
and angles: it passed all from there on, and about half of those by up to a voxel narrower).
"""

from __future__ import annotations

import math

import numpy as np

from uavexp.errors import WorldError
from uavexp.explorer.base import Explorer
from uavexp.mapping.base import MapBackend
from uavexp.planner.base import Planner
from uavexp.scene import Scene
from uavexp.types import Limits, World
from uavexp.world.widest import bottleneck_m

VOXELS = 1.5  # by which a passage looks narrower in the map, at worst
_LEAST_M = 0.15  # of clearance that is advised: less is the body itself
_SAMPLE_M = 0.05
_SAME_M = 0.002  # what the bottleneck may be off


def needed_m(planner: Planner, explorer: Explorer, mapping: MapBackend, limits: Limits) -> float:
    """True clearance of a passage that is passed however it lies in the map, m.

    An explorer that finds no other goal takes the body's radius for its own clearance.
    """
    voxel_m = float(getattr(mapping, "voxel_size_m", 0.0))
    explores_m = min(float(getattr(explorer, "min_clearance_m", 0.0)), limits.body_radius_m)
    return max(float(getattr(planner, "min_clearance_m", 0.0)), explores_m) + VOXELS * voxel_m


def check_passage(
    world: World, planner: Planner, explorer: Explorer, mapping: MapBackend, limits: Limits
) -> None:
    """Refuse a world in which the way to the target is too narrow for what flies.

    Raises:
        WorldError: it names the parameters with which it can be flown.
    """
    enough_m = needed_m(planner, explorer, mapping, limits)
    scene = Scene(world)
    if _clearance_along_m(world, scene) >= enough_m - _SAME_M:
        return
    widest_m = bottleneck_m(scene, world.flight_bounds_m, world.start_m, world.target_m, enough_m)
    if widest_m >= enough_m - _SAME_M:
        return
    voxel_m = float(getattr(mapping, "voxel_size_m", 0.0))
    lesser_m = math.floor(100.0 * (widest_m + _SAME_M - VOXELS * voxel_m)) / 100.0
    advice = (
        f"planner.min_clearance_m={lesser_m:g} explorer.min_clearance_m={lesser_m:g}"
        if lesser_m >= _LEAST_M
        else "other ends, or a finer mapping.voxel_size_m with a lesser planner.min_clearance_m"
    )
    raise WorldError(
        f"the way from start to target is {widest_m:.2f} m wide on each side at its narrowest place; "
        f"planner.min_clearance_m and voxels of {voxel_m:g} m ask for {enough_m:.2f} m; pass it with {advice}"
    )


def _clearance_along_m(world: World, scene: Scene) -> float:
    """Least clearance along the shortest path."""
    path = world.shortest_path
    counts = np.maximum(2, np.linalg.norm(np.diff(path, axis=0), axis=1) / _SAMPLE_M).astype(int)
    pieces = [np.linspace(a, b, n) for a, b, n in zip(path[:-1], path[1:], counts, strict=True)]
    return float(scene.fixed_distance_m(np.concatenate(pieces)).min())
