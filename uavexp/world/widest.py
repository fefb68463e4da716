"""The widest way between two places: its clearance, exact to about a centimetre."""

from __future__ import annotations

import math

import numpy as np

from uavexp.arrays import Float
from uavexp.scene import Scene
from uavexp.world import task

LATTICE_STEP_M = 0.01  # of the clearances tried on the lattice
MOST_FINE = 20_000_000  # nodes of the fine lattice; of a larger building the coarser one is searched
ROUNDS = 60  # of pushing a path away from what is near
_KNOT_M = 0.02  # between the points of a path that is pushed
_PUSH_M = 0.02  # in the first round; less in each that follows, none after the last


def widest_path(
    scene: Scene, flight_bounds_m: Float, start_m: Float, target_m: Float, enough_m: float
) -> tuple[Float, float]:
    """A path (P, 3) with about the largest clearance that joins two places, and that clearance.

    The best of the fine lattice, whose nodes miss the middle of a door by up to half their spacing,
    pushed from there to the middle.

    Args:
        scene: true geometry.
        flight_bounds_m: (2, 3).
        start_m: (3,).
        target_m: (3,).
        enough_m: more clearance than this is not looked for.

    Returns:
        The path, empty when they are not joined at all, and its clearance, m; proved along all of it.
    """
    fine = float(np.prod(flight_bounds_m[1] - flight_bounds_m[0])) <= MOST_FINE * task.FINE_CELL_M**3
    cell_m = task.FINE_CELL_M if fine else task.CELL_M  # the middle is found by the pushing in either
    low, high = 0, math.ceil(enough_m / LATTICE_STEP_M) + 1
    path = np.empty((0, 3))
    while high - low > 1:
        middle = (low + high) // 2
        ends = (start_m, target_m, middle * LATTICE_STEP_M)
        found = task.lattice_path(scene, flight_bounds_m, *ends, cell_m)
        low, high, path = (middle, high, found) if found.shape[0] else (low, middle, path)
    if path.shape[0] == 0:
        return path, 0.0
    pushed, clearance_m = _pushed(scene, path, flight_bounds_m, enough_m)
    lattice_m = low * LATTICE_STEP_M
    return (pushed, clearance_m) if clearance_m > lattice_m else (path, lattice_m)


def bottleneck_m(
    scene: Scene, flight_bounds_m: Float, start_m: Float, target_m: Float, enough_m: float
) -> float:
    """Largest clearance at which two places are joined; 0 when they are not. Arguments as `widest_path`."""
    return widest_path(scene, flight_bounds_m, start_m, target_m, enough_m)[1]


def _pushed(scene: Scene, path_m: Float, flight_bounds_m: Float, enough_m: float) -> tuple[Float, float]:
    """The path pushed sideways off the surfaces nearer than `enough_m`, and its clearance."""
    best, best_m = path_m, -math.inf
    for turn in range(ROUNDS):
        points = _knots(path_m)
        away = points - scene.fixed_closest_point_m(points)
        room_m = np.linalg.norm(away, axis=1)
        apart_m = np.linalg.norm(np.diff(points, axis=0), axis=1).max()
        clearance_m = math.sqrt(max(float(room_m.min()) ** 2 - 0.25 * apart_m**2, 0.0))  # see `shortest`
        if clearance_m > best_m:
            best, best_m = points, clearance_m
        along = np.gradient(points, axis=0)
        along /= np.maximum(np.linalg.norm(along, axis=1), 1e-9)[:, None]
        away -= (away * along).sum(axis=1)[:, None] * along
        away /= np.maximum(np.linalg.norm(away, axis=1), 1e-9)[:, None]
        push_m = np.clip(enough_m + _KNOT_M - room_m, 0.0, _PUSH_M * (1.0 - turn / ROUNDS))
        push_m[[0, -1]] = 0.0
        path_m = np.clip(points + push_m[:, None] * away, *flight_bounds_m)
    return best, best_m


def _knots(path_m: Float) -> Float:
    """The path with points at most `_KNOT_M` apart, and none much nearer."""
    kept = [path_m[0]]
    for point in path_m[1:]:
        last, length = kept[-1], float(np.linalg.norm(point - kept[-1]))
        if length >= 0.5 * _KNOT_M:
            count = math.ceil(length / _KNOT_M)
            kept += [last + (point - last) * share for share in np.arange(1, count + 1) / count]
    return np.array([*kept[:-1], path_m[-1]])
