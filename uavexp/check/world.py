"""What every world promises, drawn or read: a task in it that can be flown."""

from __future__ import annotations

import functools

import numpy as np

from uavexp.arrays import Float
from uavexp.check.promise import Make, keep, same
from uavexp.scene import Scene
from uavexp.seeding import Stream, generator
from uavexp.types import World

_SAMPLE_M = 0.02


@functools.lru_cache(maxsize=2)
def _world(make: Make, seed: int = 3) -> World:
    world: World = make().generate(generator(seed, Stream.WORLD))
    return world


def _along(path_m: Float) -> Float:
    """Points (N, 3) of a path, at most `_SAMPLE_M` apart."""
    counts = np.maximum(2, np.linalg.norm(np.diff(path_m, axis=0), axis=1) / _SAMPLE_M).astype(int)
    pieces = [np.linspace(a, b, n) for a, b, n in zip(path_m[:-1], path_m[1:], counts, strict=True)]
    return np.concatenate(pieces)


def has_geometry_inside_the_map(make: Make) -> None:
    """Triangles of vertices that exist; flight bounds inside the box that is mapped."""
    world = _world(make)
    keep(len(world.triangles) > 0, "it has no triangle")
    top = int(world.triangles.max(initial=-1))
    keep(top < len(world.vertices_m), f"a triangle names vertex {top} of {len(world.vertices_m)}")
    keep(np.isfinite(world.vertices_m).all(), "a vertex is not finite")
    beyond_m = np.maximum(
        world.bounds_m[0] - world.flight_bounds_m[0], world.flight_bounds_m[1] - world.bounds_m[1]
    ).max()
    keep(beyond_m <= 0.0, f"the flight bounds reach {beyond_m:.3f} m beyond what is mapped")


def joins_start_and_target_by_a_free_path(make: Make) -> None:
    """The shortest path leads from one to the other, in the flight bounds and through no surface."""
    world = _world(make)
    ends_m = np.linalg.norm(world.shortest_path[[0, -1]] - [world.start_m, world.target_m], axis=1)
    keep(ends_m.max() < 1e-6, f"the shortest path ends {ends_m.max():.3g} m from start or target")
    points = _along(world.shortest_path)
    low, high = world.flight_bounds_m
    beyond_m = np.maximum(low - points, points - high).max()
    keep(beyond_m <= 1e-9, f"the shortest path leads {beyond_m:.3f} m out of the flight bounds")
    clear_m = Scene(world).distance_m(points).min()
    keep(clear_m > 0.1, f"the shortest path comes to {clear_m:.3f} m from a surface")


def measures_how_hard_it_is(make: Make) -> None:
    """Straight line, shortest path, narrowest gap and clutter agree with the task."""
    world = _world(make)
    straight_m = float(np.linalg.norm(world.target_m - world.start_m))
    told = world.difficulty
    apart_m = abs(told.straight_line_m - straight_m)
    keep(apart_m < 1e-6, f"the straight line is off by {apart_m:.3g} m")
    shorter_m = straight_m - told.shortest_path_m
    keep(shorter_m < 1e-6, f"the shortest path is {shorter_m:.3g} m shorter than the straight line")
    keep(told.narrowest_gap_m > 0.0, f"the narrowest gap is {told.narrowest_gap_m} m")
    keep(0.0 <= told.clutter_density < 1.0, f"the clutter density is {told.clutter_density}")


def is_the_same_world_for_the_same_seed(make: Make) -> None:
    """To the last bit, digest included."""
    again = make().generate(generator(3, Stream.WORLD))
    keep(same(_world(make), again), "the same seed gives another world")
