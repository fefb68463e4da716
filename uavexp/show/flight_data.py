"""What the page's script draws of stored flights, as plain data: lengths in m, times in s."""

from __future__ import annotations

import base64
import gzip
from collections.abc import Sequence
from typing import Any

import numpy as np

from uavexp.arrays import Float, Int
from uavexp.bodies import present
from uavexp.causes import cause_named
from uavexp.export.map_voxels import spacing_m
from uavexp.export.moments import PlanChange, plan_changes
from uavexp.geometry import yaw_of
from uavexp.log import TrialLog
from uavexp.report.search_view import SAME_M, frontier_m
from uavexp.store.stored_trial import StoredTrial

MOST_ROWS = 1500  # of a path
MOST_MOVER_ROWS = 400
MOST_VOXELS = 120_000  # of a map; more are drawn at twice the edge
MOST_PLAN_POINTS = 40
MOST_FRONTIER = 1500  # cells
_ABOVE_FLIGHT_M = 0.3  # the map is cut here at first, so that one looks into the rooms
_VEHICLE_RADIUS_M = 0.2  # where the log does not tell

Json = dict[str, Any]


def page_data(trials: Sequence[StoredTrial]) -> Json:
    """Everything the page shows of flights in one world."""
    causes = dict.fromkeys(replan.cause for trial in trials for replan in trial.log.replans)
    world = trials[0].world
    start_m = trials[0].log.steps.position_m[0]
    target_m = world.target_m if world is not None else np.full(3, np.inf)
    heights_m = np.concatenate([trial.log.steps.position_m[:, 2] for trial in trials])
    return {
        "end_s": max(float(trial.log.steps.time_s[-1]) for trial in trials),
        "start": _numbers(start_m),
        "target": _numbers(world.target_m) if world is not None else None,
        "cut_m": round(float(heights_m.max()) + _ABOVE_FLIGHT_M, 1),
        "causes": {name: _cause(name) for name in causes},
        "flights": [{"label": trial.label, **flight_data(trial.log, target_m)} for trial in trials],
    }


def flight_data(log: TrialLog, target_m: Float) -> Json:
    """One flight: rows of its path, its plans and goals, its map by the time it grew, its movers.

    Args:
        log: of the flight.
        target_m: (3,) of its world; plans to elsewhere have a `goal`.
    """
    steps, rows = log.steps, thinned(log.steps.time_s.size, MOST_ROWS)
    height_m = float(steps.position_m[0, 2])
    frontier = frontier_m(log, height_m)
    frontier = frontier[thinned(len(frontier), MOST_FRONTIER)] if len(frontier) else frontier
    radius_m = log.limits.body_radius_m
    return {
        "headline": log.summary,
        "time_s": _numbers(steps.time_s[rows]),
        "path": _numbers(steps.position_m[rows].ravel()),
        "yaw": [round(yaw_of(q), 2) for q in steps.quaternion_wxyz[rows]],
        "clearance_m": _numbers(steps.clearance_m[rows]),
        "radius_m": round(float(radius_m), 3) if np.isfinite(radius_m) else _VEHICLE_RADIUS_M,
        "plans": [_plan(change, target_m) for change in plan_changes(log)],
        "frontier": _numbers(np.column_stack([frontier, np.full(len(frontier), height_m)]).ravel()),
        "contacts": [{"at": _numbers(item.position_m), "s": item.start_s} for item in log.contacts],
        "map": map_data(log),
        "movers": movers_data(log),
    }


def map_data(log: TrialLog) -> Json:
    """Occupied voxels that show a face, oldest first.

    Returns:
        `size_m`, `origin_m` (centre of voxel 0, 0, 0), `top_m`, `grows` (whether the log tells when) and
        `voxels`: all x, all y, all z, then all times in 1/10 s, as little-endian int16, packed by gzip
        and base64.
    """
    centres_m = log.mapped_m.reshape(-1, 3).astype(np.float64)
    grows = len(log.grid.occupied_s) == len(centres_m) > 0
    times_s = log.grid.occupied_s if grows else np.zeros(len(centres_m))
    size_m, origin_m = spacing_m(centres_m), np.zeros(3)
    packed = b""
    if len(centres_m):
        origin_m = centres_m.min(axis=0)
        index = np.rint((centres_m - origin_m) / size_m).astype(np.int64)
        edge = 1
        while len(index) > MOST_VOXELS:
            edge *= 2
            index, times_s = _coarser(index, times_s)
        origin_m, size_m = origin_m + 0.5 * (edge - 1) * size_m, edge * size_m
        shown = _shows_a_face(index)
        index, times_s = index[shown], times_s[shown]
        order = np.argsort(times_s, kind="stable")
        columns = np.column_stack([index, np.rint(10.0 * times_s)])[order]
        packed = np.clip(columns, 0, 32767).astype("<i2").T.tobytes()
    return {
        "size_m": round(size_m, 4),
        "origin_m": _numbers(origin_m),
        "top_m": round(float(centres_m[:, 2].max(initial=0.0)) + size_m, 1),
        "grows": grows,
        "voxels": base64.b64encode(gzip.compress(packed, mtime=0)).decode("ascii"),
    }


def movers_data(log: TrialLog) -> Json:
    """Shapes and half sizes of movers, and where each is at `time_s`; null where it is not."""
    movers = log.movers
    if not movers.shape.size:
        return {"shape": []}
    rows = thinned(len(movers.position_m), MOST_MOVER_ROWS)
    places_m = movers.position_m[rows].astype(np.float64)
    there = present(places_m)
    return {
        "shape": movers.shape.tolist(),
        "half_m": [_numbers(half) for half in movers.half_size_m],
        "time_s": _numbers(log.steps.time_s[rows]),
        "at": [
            [_numbers(place) if here else None for place, here in zip(now, seen, strict=True)]
            for now, seen in zip(places_m, there, strict=True)
        ],
    }


def thinned(count: int, most: int) -> Int:
    """At most so many rows (and one) of so many, evenly, with the first and the last."""
    return np.unique(np.append(np.arange(0, count, max(1, -(-count // most))), count - 1))


def _coarser(index: Int, times_s: Any) -> tuple[Int, Any]:
    """Voxels of twice the edge, each as old as its oldest part."""
    found, inverse = np.unique(index // 2, axis=0, return_inverse=True)
    oldest_s = np.full(len(found), np.inf)
    np.minimum.at(oldest_s, inverse.ravel(), times_s)
    return found, oldest_s


def _shows_a_face(index: Int) -> Any:
    """Whether each voxel (N, 3) has a side without a neighbour."""
    solid = np.zeros(tuple(index.max(axis=0) + 3), dtype=np.bool_)
    solid[tuple((index + 1).T)] = True
    hidden = np.ones(len(index), dtype=np.bool_)
    for axis in range(3):
        for side in (0, 2):
            hidden &= solid[tuple((index + np.where(np.arange(3) == axis, side, 1)).T)]
    return ~hidden


def _plan(change: PlanChange, target_m: Float) -> Json:
    is_target = float(np.linalg.norm(change.goal_m - target_m)) < SAME_M
    points_m: Float = change.trajectory_m
    if len(points_m):
        points_m = points_m[thinned(len(points_m), MOST_PLAN_POINTS)]
    return {
        "s": round(change.time_s, 3),
        "from_s": round(change.effective_s, 3) if np.isfinite(change.effective_s) else None,
        "cause": change.cause,
        "words": change.words,
        "at": _numbers(change.position_m),
        "goal": None if is_target or not np.isfinite(change.goal_m).all() else _numbers(change.goal_m),
        "points": _numbers(points_m.ravel()),
    }


def _cause(name: str) -> Json:
    cause = cause_named(name)
    return {"label": cause.label, "colour": cause.colour, "marker": cause.marker}


def _numbers(values: Any) -> list[float]:
    return [round(float(value), 3) if np.isfinite(value) else 0.0 for value in values]
