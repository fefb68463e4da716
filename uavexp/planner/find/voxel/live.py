"""Voxel searches on the live map: a distance field in, a path in metres out."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from uavexp.arrays import Bool, Float, Int
from uavexp.field import DistanceField
from uavexp.planner.find.grid import FoundPath
from uavexp.planner.find.voxel.canonical import BUDGET
from uavexp.planner.find.voxel.grid import VoxelGrid, VoxelPath
from uavexp.planner.find.voxel.smoothing import smoothed
from uavexp.types import PlanStatus

Search = Callable[[VoxelGrid, Int, Int], tuple[VoxelPath, str]]  # cells (3,) to a path and a remark

_RESERVE_VOXELS = 0.25  # clearance of cells above the limit: the curve's freedom
_EXIT_VOXELS = 3.0  # a start too near to an obstacle may leave through cells as near, this far and further


class LiveGrid(NamedTuple):
    """The part of the map that a request may use, as free and blocked cells."""

    free: Bool  # (X, Y, Z)
    first: Int  # (3,) voxel of the map that cell (0, 0, 0) is
    start: Int  # (3,) cell
    goal: Int  # (3,) cell


def find(
    field: DistanceField,
    start_m: Float,
    goal_m: Float,
    bounds_m: Float,
    search: Search,
    *,
    min_clearance_m: float,
    z_band_m: float,
    known_only: bool,
    spline: bool,
) -> FoundPath:
    """Path between two points (3,) on the map, by a search of its cells.

    Args:
        field: the map.
        start_m: (3,).
        goal_m: (3,).
        bounds_m: (2, 3) that the path stays in.
        search: of the cells; its remark is the reason of the answer.
        min_clearance_m: of free cells.
        z_band_m: by which the path may leave the heights between start and goal.
        known_only: whether unknown cells are blocked.
        spline: whether the key waypoints are joined by a quadratic spline (`smoothing`).
    """
    refused = _refusal(field, start_m, goal_m, bounds_m, min_clearance_m)
    if refused is not None:
        return refused
    grid = live_grid(
        field, start_m, goal_m, bounds_m,
        min_clearance_m=min_clearance_m, z_band_m=z_band_m, known_only=known_only,
    )  # fmt: skip
    answer, remark = search(VoxelGrid(np.ascontiguousarray(grid.free)), grid.start, grid.goal)
    if not answer.found:
        spent = f"not found in {answer.expansions} expansions"
        apart = "start and goal are not joined at the clearance limit"
        return _failed(PlanStatus.NO_PATH, spent if answer.status == BUDGET else apart, answer.expansions)
    points = smoothed(grid.free, answer.centres) if spline else answer.centres
    return FoundPath(
        status=PlanStatus.OK,
        path_m=in_metres(field, grid, points, start_m, goal_m),
        cost_m=answer.cost * field.voxel_size_m,
        expansions=answer.expansions,
        reason=remark,
    )


def _refusal(
    field: DistanceField, start_m: Float, goal_m: Float, bounds_m: Float, min_clearance_m: float
) -> FoundPath | None:
    """Why start or goal make every search vain; None when they do not."""
    here, there = field.distance_m(np.stack([start_m, goal_m]))
    if here <= 0.0:
        return _failed(PlanStatus.START_BLOCKED, f"the start lies {-here:.2f} m inside an obstacle")
    if there < min_clearance_m or np.any(goal_m < bounds_m[0]) or np.any(goal_m > bounds_m[1]):
        return _failed(PlanStatus.GOAL_BLOCKED, f"the goal's clearance is {there:.2f} m, or it is outside")
    return None


def live_grid(
    field: DistanceField,
    start_m: Float,
    goal_m: Float,
    bounds_m: Float,
    *,
    min_clearance_m: float,
    z_band_m: float,
    known_only: bool,
) -> LiveGrid:
    """Cells of the flight bounds and the height band; this alone says which cells are blocked.

    A cell is free when its centre keeps the clearance (and a reserve); around a start that is
    nearer to an obstacle, when it is no nearer than the start. Movers come in as part of the
    field (`moving.stamped`), each where the vehicle would meet it.
    """
    size, last = field.voxel_size_m, np.array(field.distance.shape) - 1
    low, high = bounds_m[0].copy(), bounds_m[1].copy()
    low[2] = max(low[2], min(start_m[2], goal_m[2]) - z_band_m)
    high[2] = min(high[2], max(start_m[2], goal_m[2]) + z_band_m)
    ends = np.floor((np.stack([start_m, goal_m]) - field.origin_m) / size).astype(np.int64)
    ends = np.clip(ends, 0, last)
    first = np.ceil((low - field.origin_m) / size - 0.5 - 1e-9).astype(np.int64)
    final = np.floor((high - field.origin_m) / size - 0.5 + 1e-9).astype(np.int64)
    first = np.clip(np.minimum(first, ends.min(axis=0)), 0, last)
    final = np.clip(np.maximum(final, ends.max(axis=0)), 0, last)
    part = tuple(slice(a, b + 1) for a, b in zip(first, final, strict=True))
    distance = field.distance[part]
    least = min_clearance_m + _RESERVE_VOXELS * size
    free = distance >= least
    if known_only:
        free &= field.state[part] != 0
    start, goal = ends - first
    here = min(float(field.distance_m(start_m[None])[0]), float(distance[tuple(start)]))
    if here < least:
        reach = 2.0 * (least - here) / size + _EXIT_VOXELS
        apart = sum(
            (np.arange(n) - at).reshape([-1 if k == axis else 1 for k in range(3)]) ** 2
            for axis, (n, at) in enumerate(zip(distance.shape, start, strict=True))
        )
        free |= (apart <= reach**2) & (distance >= here)
    free[tuple(start)] = free[tuple(goal)] = True
    return LiveGrid(free, first, start, goal)


def in_metres(field: DistanceField, grid: LiveGrid, points: Float, start_m: Float, goal_m: Float) -> Float:
    """Path (P, 3) of points in cells (`smoothing`: centres at + 0.5), with the exact ends."""
    path: Float = field.origin_m + (grid.first + points) * field.voxel_size_m
    if len(path) < 2:
        return np.stack([start_m, goal_m])
    return np.concatenate([start_m[None], path[1:-1], goal_m[None]])


def _failed(status: PlanStatus, reason: str, expansions: int = 0) -> FoundPath:
    none = np.zeros((0, 3))
    return FoundPath(status=status, path_m=none, cost_m=np.inf, expansions=expansions, reason=reason)
