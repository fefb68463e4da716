"""Whether a world's narrowest place can be passed by what is to fly through it, told before the flight.

A map of voxels shows a passage narrower than it is: its sides fall into voxels that are occupied as a whole,
half a voxel each on average and one at worst, and the middle of what is left lies up to half a voxel from the
nearest place that a search tries. So a planner passes every door whose true clearance is a voxel and a
quarter more than what it keeps, however the door lies in the map (measured on doors of 0.64 to 0.9 m at four
places and angles each: all were passed from 1.15 voxels on, and three of four with one).
"""

from __future__ import annotations

import math

import numpy as np

from uavexp.errors import WorldError
from uavexp.explorer.base import Explorer
from uavexp.mapping.base import MapBackend
from uavexp.planner.base import Planner
from uavexp.scene import Scene
from uavexp.types import World
from uavexp.world.widest import bottleneck_m

VOXELS = 1.25  # by which a passage looks narrower in the map, at worst
_LEAST_M = 0.15  # of clearance that is advised: less is the body itself
_SAMPLE_M = 0.05
_SAME_M = 0.002  # what the bottleneck may be off


def needed_m(planner: Planner, explorer: Explorer, mapping: MapBackend) -> float:
    """True clearance of a passage that is passed however it lies in the map, m."""
    return max(_kept_m(planner), _kept_m(explorer)) + VOXELS * _voxel_m(mapping)


def _kept_m(part: object) -> float:
    """The least mapped clearance that a planner or an explorer keeps, m; 0: it asks for none."""
    usual_m = float(getattr(part, "min_clearance_m", 0.0))
    narrow_m = float(getattr(part, "narrow_clearance_m", 0.0))  # where the usual one finds no way
    return min(usual_m, narrow_m) if narrow_m > 0.0 else usual_m


def _voxel_m(mapping: object) -> float:
    return float(getattr(mapping, "voxel_size_m", 0.0))


def check_passage(world: World, planner: Planner, explorer: Explorer, mapping: MapBackend) -> None:
    """Refuse a world in which the way to the target is too narrow for what flies.

    Raises:
        WorldError: it names the parameters with which it can be flown.
    """
    enough_m = needed_m(planner, explorer, mapping)
    scene = Scene(world)
    if _clearance_along_m(world, scene) >= enough_m - _SAME_M:
        return
    widest_m = bottleneck_m(scene, world.flight_bounds_m, world.start_m, world.target_m, enough_m)
    if widest_m >= enough_m - _SAME_M:
        return
    voxel_m = _voxel_m(mapping)
    lesser_m = math.floor(100.0 * (widest_m + _SAME_M - VOXELS * voxel_m)) / 100.0
    advice = (
        f"narrow_clearance_m={lesser_m:g}"
        if lesser_m >= _LEAST_M
        else "other ends, or a finer mapping.voxel_size_m"
    )
    raise WorldError(
        f"the way from start to target leaves {widest_m:.2f} m on each side at its narrowest place; to keep "
        f"{enough_m - VOXELS * voxel_m:.2f} m in voxels of {voxel_m:g} m takes {enough_m:.2f} m; pass it "
        f"with {advice}"
    )


def _clearance_along_m(world: World, scene: Scene) -> float:
    """Least clearance along the shortest path."""
    path = world.shortest_path
    counts = np.maximum(2, np.linalg.norm(np.diff(path, axis=0), axis=1) / _SAMPLE_M).astype(int)
    pieces = [np.linspace(a, b, n) for a, b, n in zip(path[:-1], path[1:], counts, strict=True)]
    return float(scene.fixed_distance_m(np.concatenate(pieces)).min())
