"""Voxel searches on the live map: a request in, a path in metres out."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from uavexp.arrays import Bool, Float, Int
from uavexp.planner.constraints import Constraints
from uavexp.planner.find.base import FoundPath
from uavexp.planner.find.ends import refusal
from uavexp.planner.find.voxels.canonical import BUDGET
from uavexp.planner.find.voxels.voxel_grid import VoxelGrid, VoxelPath
from uavexp.planner.find.voxels.waypoints import smoothed
from uavexp.types import PlanRequest, PlanStatus

Search = Callable[[VoxelGrid, Int, Int], tuple[VoxelPath, str]]  # cells (3,) to a path and a remark

_RESERVE_VOXELS = 0.25  # clearance of cells above the limit: the curve's freedom
_EXIT_VOXELS = 3.0  # a start too near to an obstacle may leave through cells as near, this far and further


class LiveGrid(NamedTuple):
    """The part of the map that a request may use, as free and blocked cells."""

    free: Bool  # (X, Y, Z)
    first: Int  # (3,) voxel of the map that cell (0, 0, 0) is
    start: Int  # (3,) cell
    goal: Int  # (3,) cell


def find_among_voxels(
    request: PlanRequest, constraints: Constraints, search: Search, spline: bool
) -> FoundPath:
    """Path of a request on its map, by a search of its cells.

    Args:
        request: what was asked.
        constraints: what the path keeps.
        search: of the cells; its remark is the reason of the answer.
        spline: whether the key waypoints are joined by a quadratic spline (`waypoints`).
    """
    refused = refusal(request, constraints)
    if refused is not None:
        return refused
    grid = live_grid(request, constraints)
    answer, remark = search(VoxelGrid(np.ascontiguousarray(grid.free)), grid.start, grid.goal)
    if not answer.found:
        spent = f"not found in {answer.expansions} expansions"
        apart = "start and goal are not joined at the clearance limit"
        reason = spent if answer.status == BUDGET else apart
        return FoundPath(status=PlanStatus.NO_PATH, reason=reason, expansions=answer.expansions)
    points = smoothed(grid.free, answer.centres) if spline else answer.centres
    return FoundPath(
        status=PlanStatus.OK,
        path_m=_in_metres(request, grid, points),
        cost=answer.cost * request.field.voxel_size_m,
        expansions=answer.expansions,
        reason=remark,
    )


def live_grid(request: PlanRequest, constraints: Constraints) -> LiveGrid:
    """Cells of the flight bounds and the height band; this alone says which cells are blocked.

    A cell is free when its centre keeps the clearance (and a reserve); around a start that is
    nearer to an obstacle, when it is no nearer than the start. Movers come in as part of the
    field (`moving.stamped`), each where the vehicle would meet it.
    """
    field, start_m, goal_m = request.field, request.position_m, request.goal.position_m
    size, last = field.voxel_size_m, np.array(field.distance.shape) - 1
    low, high = request.flight_bounds_m.copy()
    low[2] = max(low[2], min(start_m[2], goal_m[2]) - constraints.z_band_m)
    high[2] = min(high[2], max(start_m[2], goal_m[2]) + constraints.z_band_m)
    ends = np.floor((np.stack([start_m, goal_m]) - field.origin_m) / size).astype(np.int64)
    ends = np.clip(ends, 0, last)
    first = np.ceil((low - field.origin_m) / size - 0.5 - 1e-9).astype(np.int64)
    final = np.floor((high - field.origin_m) / size - 0.5 + 1e-9).astype(np.int64)
    first = np.clip(np.minimum(first, ends.min(axis=0)), 0, last)
    final = np.clip(np.maximum(final, ends.max(axis=0)), 0, last)
    part = tuple(slice(a, b + 1) for a, b in zip(first, final, strict=True))
    distance = field.distance[part]
    least = constraints.min_clearance_m + _RESERVE_VOXELS * size
    free = distance >= least
    if constraints.known_only:
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


def _in_metres(request: PlanRequest, grid: LiveGrid, points: Float) -> Float:
    """Path (P, 3) of points in cells (`waypoints`: centres at + 0.5), with the exact ends."""
    start_m, goal_m, field = request.position_m, request.goal.position_m, request.field
    path: Float = field.origin_m + (grid.first + points) * field.voxel_size_m
    if len(path) < 2:
        return np.stack([start_m, goal_m])
    return np.concatenate([start_m[None], path[1:-1], goal_m[None]])
