"""What a sampling-based search may enter, and whether a motion stays inside: sphere tracing.

A step along a motion no longer than the clearance above the limit cannot reach an obstacle: the
distance field is 1-Lipschitz. Its trilinear interpolation is steeper by a few per cent away from
surfaces, so steps are a tenth shorter; steps are never below a quarter of a voxel, and the limit
is a quarter of a voxel above the clearance asked for, more than can be lost on half such a step.
For motions both are smaller (`for_motions`), so that a motion along a straight line found free is
free, wherever its steps fall. Each look at the field is one collision check.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Float, Float32, UInt8
from uavexp.field import DistanceField
from uavexp.planner.constraints import Constraints
from uavexp.planner.find.batch_tree.cubic_motion import cubic_coefficients
from uavexp.types import PlanRequest

_RESERVE_VOXELS = 0.25
_LEAST_STEP_VOXELS = 0.25
_MOTION_RESERVE_VOXELS, _MOTION_STEP_VOXELS = 0.11, 0.2
_KNOWN_STEP_VOXELS = 0.5  # where unknown space is closed: the field does not tell how far it is
_SHARE = 0.9


class FreeSpace(NamedTuple):
    """A distance field, the clearance asked for in it, and the box that may be used."""

    distance: Float32  # (X, Y, Z) m
    state: UInt8  # (X, Y, Z)
    origin_m: Float  # (3,)
    voxel_m: float
    known_only: bool
    low_m: Float  # (3,)
    high_m: Float  # (3,)
    limit_m: float  # least clearance away from both ends
    ends_m: Float  # (2, 3) start and goal
    end_limit_m: Float  # (2,) least clearance next to them
    end_reach_m: Float  # (2,) how far "next to" goes
    least_step_m: float  # between two looks


def space_of(request: PlanRequest, constraints: Constraints) -> FreeSpace:
    """Free space of a request."""
    ends = np.stack([request.position_m, request.goal.position_m])
    kept = (constraints.min_clearance_m, constraints.z_band_m, constraints.known_only)
    return free_space(request.field, ends, request.flight_bounds_m, *kept)


def free_space(
    field: DistanceField,
    ends_m: Float,
    bounds_m: Float,
    min_clearance_m: float,
    z_band_m: float,
    known_only: bool,
) -> FreeSpace:
    """Free space between two points; next to an end of less clearance, that much is enough.

    Args:
        field: the map.
        ends_m: (2, 3) start and goal.
        bounds_m: (2, 3) flight bounds.
        min_clearance_m: asked for.
        z_band_m: the heights between the ends may be left by this much.
        known_only: whether unknown space is closed.
    """
    limit = min_clearance_m + _RESERVE_VOXELS * field.voxel_size_m
    clearance = field.distance_m(ends_m)
    missing = np.maximum(limit - clearance, 0.0)
    low, high = bounds_m.astype(np.float64)
    low[2] = max(low[2], ends_m[:, 2].min() - z_band_m)
    high[2] = min(high[2], ends_m[:, 2].max() + z_band_m)
    return FreeSpace(
        field.distance,
        field.state,
        field.origin_m,
        field.voxel_size_m,
        known_only,
        np.minimum(low, ends_m.min(axis=0)),
        np.maximum(high, ends_m.max(axis=0)),
        limit,
        ends_m,
        np.minimum(clearance, limit) - 1e-6,
        np.where(missing > 0.0, 2.0 * missing + 3.0 * field.voxel_size_m, 0.0),
        _LEAST_STEP_VOXELS * field.voxel_size_m,
    )


def for_motions(space: FreeSpace) -> FreeSpace:
    """The same space with less reserve and shorter steps, for motions in place of straight lines."""
    spare_m = (_RESERVE_VOXELS - _MOTION_RESERVE_VOXELS) * space.voxel_m
    return space._replace(limit_m=space.limit_m - spare_m, least_step_m=_MOTION_STEP_VOXELS * space.voxel_m)


@nb.njit(cache=True)
def look(space: FreeSpace, x: float, y: float, z: float) -> tuple[bool, float]:
    """Whether a point is free, and how far one may go from it before looking again, m."""
    if not (
        space.low_m[0] <= x <= space.high_m[0]
        and space.low_m[1] <= y <= space.high_m[1]
        and space.low_m[2] <= z <= space.high_m[2]
    ):
        return False, 0.0
    nx, ny, nz = space.distance.shape
    cx = min(max((x - space.origin_m[0]) / space.voxel_m - 0.5, 0.0), nx - 1.0)
    cy = min(max((y - space.origin_m[1]) / space.voxel_m - 0.5, 0.0), ny - 1.0)
    cz = min(max((z - space.origin_m[2]) / space.voxel_m - 0.5, 0.0), nz - 1.0)
    if space.known_only and space.state[int(cx + 0.5), int(cy + 0.5), int(cz + 0.5)] == 0:
        return False, 0.0
    i, j, k = min(int(cx), max(nx - 2, 0)), min(int(cy), max(ny - 2, 0)), min(int(cz), max(nz - 2, 0))
    fx, fy, fz = cx - i, cy - j, cz - k
    i1, j1, k1 = min(i + 1, nx - 1), min(j + 1, ny - 1), min(k + 1, nz - 1)
    d = space.distance
    d00 = d[i, j, k] + (d[i1, j, k] - d[i, j, k]) * fx
    d01 = d[i, j, k1] + (d[i1, j, k1] - d[i, j, k1]) * fx
    d10 = d[i, j1, k] + (d[i1, j1, k] - d[i, j1, k]) * fx
    d11 = d[i, j1, k1] + (d[i1, j1, k1] - d[i, j1, k1]) * fx
    d0, d1 = d00 + (d10 - d00) * fy, d01 + (d11 - d01) * fy
    here = d0 + (d1 - d0) * fz
    limit = space.limit_m
    for end in range(2):
        reach = space.end_reach_m[end]
        if reach > 0.0:
            p = space.ends_m[end]
            if (x - p[0]) ** 2 + (y - p[1]) ** 2 + (z - p[2]) ** 2 <= reach * reach:
                limit = min(limit, space.end_limit_m[end])
    # the stride counts from the strict limit, which holds wherever the step may lead
    stride = max(_SHARE * (here - space.limit_m), space.least_step_m)
    if space.known_only:
        stride = min(stride, _KNOWN_STEP_VOXELS * space.voxel_m)
    return bool(here >= limit), float(stride)


@nb.njit(cache=True)
def straight_is_free(space: FreeSpace, a: Float, b: Float) -> tuple[bool, int]:
    """Whether the straight line between two points (3,) or states is free, and the checks it took."""
    dx, dy, dz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    length = np.sqrt(dx * dx + dy * dy + dz * dz)
    along, checks = 0.0, 0
    while True:
        share = along / length if length > 0.0 else 0.0
        free, stride = look(space, a[0] + share * dx, a[1] + share * dy, a[2] + share * dz)
        checks += 1
        if not free:
            return False, checks
        if along >= length:
            return True, checks
        along = min(along + stride, length)


@nb.njit(cache=True)
def cubic_is_free(
    space: FreeSpace, start: Float, end: Float, duration_s: float, top: float
) -> tuple[bool, int]:
    """Whether the cubic motion between two states (6,) is free, and the checks it took.

    Args:
        space: where.
        start: (6,).
        end: (6,).
        duration_s: of the motion.
        top: a bound on its speed, m/s: in a time dt it goes no further than top dt.
    """
    c = cubic_coefficients(start, end, duration_s)
    t, checks = 0.0, 0
    while True:
        x = c[0, 0] + t * (c[1, 0] + t * (c[2, 0] + t * c[3, 0]))
        y = c[0, 1] + t * (c[1, 1] + t * (c[2, 1] + t * c[3, 1]))
        z = c[0, 2] + t * (c[1, 2] + t * (c[2, 2] + t * c[3, 2]))
        free, stride = look(space, x, y, z)
        checks += 1
        if not free:
            return False, checks
        if t >= duration_s:
            return True, checks
        t = min(t + stride / top, duration_s)
