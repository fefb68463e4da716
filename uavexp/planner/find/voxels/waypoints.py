"""Key waypoints of a voxel path, reversals removed, joined by a quadratic spline; all checked.

Points are in voxels, cell (i, j, k) having its centre at (i, j, k) + 0.5. A segment is in sight
when every cell that it touches is free, so nothing smoothed leaves the free cells.
The spline is the quadratic B-spline of the waypoints (ends doubled): it begins and ends there,
runs through the middle of each leg and is tangent to it. An interpolating quadratic would swing
out beyond the waypoints that line of sight has proved; this one stays in the triangles of
neighbouring waypoints and is checked there. Where a corner's triangle is not free, its curve is
pulled into the corner by halves.
"""

from __future__ import annotations

from itertools import pairwise

import numba as nb
import numpy as np

from uavexp.arrays import Bool, Float

_HALVINGS = 4  # of a corner's curve before the corner is left as it is
_PER_CORNER = 8  # chords that stand for a corner's curve
_REVERSAL = 0.0  # cosine of the turn beyond which a waypoint reverses


@nb.njit(cache=True)
def in_sight(free: Bool, a: Float, b: Float) -> bool:
    """Whether every cell touched by the segment from a to b (3,) is free; voxels.

    Where it passes exactly through an edge or a corner of cells, all cells there are touched.
    """
    cell, step = np.empty(3, dtype=np.int64), np.zeros(3, dtype=np.int64)
    ahead, each = np.full(3, np.inf), np.full(3, np.inf)  # share of the segment to the next face
    for axis in range(3):
        cell[axis] = int(np.floor(a[axis]))
        way = b[axis] - a[axis]
        if abs(way) > 1e-12:
            step[axis] = 1 if way > 0.0 else -1
            face = cell[axis] + (1.0 if way > 0.0 else 0.0)
            ahead[axis], each[axis] = (face - a[axis]) / way, 1.0 / abs(way)
    side = np.empty(3, dtype=np.int64)
    while True:
        if not _is_free(free, cell):
            return False
        share = min(ahead[0], ahead[1], ahead[2])
        if share >= 1.0 - 1e-9:
            return True
        crossed = ahead <= share + 1e-9
        for mask in range(1, 8):
            useful = True
            for axis in range(3):
                chosen = mask >> axis & 1 == 1
                useful = useful and (crossed[axis] or not chosen)
                side[axis] = cell[axis] + (step[axis] if chosen else 0)
            if useful and not _is_free(free, side):
                return False
        for axis in range(3):
            if crossed[axis]:
                cell[axis] += step[axis]
                ahead[axis] += each[axis]


@nb.njit(cache=True)
def _is_free(free: Bool, cell: Float) -> bool:
    for axis in range(3):
        if cell[axis] < 0 or cell[axis] >= free.shape[axis]:
            return False
    return bool(free[cell[0], cell[1], cell[2]])


@nb.njit(cache=True)
def key_waypoints(free: Bool, points: Float) -> Float:
    """Points (K, 3) of a path (P, 3) that are needed: from each the farthest one in sight follows.

    The farthest is sought by doubling and halving, so a few points in sight may be passed over.
    """
    kept = np.empty_like(points)
    kept[0] = points[0]
    count, here, last = 1, 0, points.shape[0] - 1
    while here < last:
        reach, stride = here + 1, 1
        while reach < last:
            further = min(reach + stride, last)
            if in_sight(free, points[here], points[further]):
                reach, stride = further, 2 * stride
            elif stride == 1:
                break
            else:
                stride = max(stride // 4, 1)
        kept[count] = points[reach]
        count += 1
        here = reach
    return kept[:count].copy()


def without_reversals(free: Bool, points: Float) -> Float:
    """Drop waypoints (K, 3) at which the path turns by more than 90° if their neighbours see each other."""
    kept = [points[0]]
    for n in range(1, len(points) - 1):
        into, out = points[n] - kept[-1], points[n + 1] - points[n]
        if not (into @ out < _REVERSAL and in_sight(free, kept[-1], points[n + 1])):
            kept.append(points[n])
    return np.array([*kept, points[-1]])


def quadratic_spline(free: Bool, points: Float) -> Float:
    """Polyline (S, 3) of the quadratic B-spline with the control points (K, 3), every chord in sight."""
    curve = [points[0]]
    for n in range(1, len(points) - 1):
        curve.extend(_corner(free, *points[n - 1 : n + 2]))
    curve.append(points[-1])
    return np.array(curve)


def _corner(free: Bool, before: Float, corner: Float, after: Float) -> Float:
    """Chords (_PER_CORNER + 1, 3) of the curve round one waypoint; the waypoint itself when not free."""
    u = np.linspace(0.0, 1.0, _PER_CORNER + 1)[:, None]
    share = 0.5
    for _ in range(_HALVINGS):
        first, last = corner + share * (before - corner), corner + share * (after - corner)
        arc = (1.0 - u) ** 2 * first + 2.0 * u * (1.0 - u) * corner + u**2 * last
        if all(in_sight(free, a, b) for a, b in pairwise(arc)):
            return np.asarray(arc)
        share *= 0.5
    return corner[None]


def smoothed(free: Bool, points: Float) -> Float:
    """Waypoints, reversals, spline: a smooth polyline (S, 3) with the same ends, in free cells."""
    return quadratic_spline(free, without_reversals(free, key_waypoints(free, points)))
