"""How far somebody who is hidden would have to walk: from where nobody sees, around what is mapped.

On a level grid at the height of the way: a place is hidden that was never seen, or that a mapped obstacle
hides from the vehicle where it is now. Somebody may stand at any hidden place with room for a person, and
walks the shortest way that keeps a person's half width from what is mapped (so through no wall). A way is
measured along the axes and diagonals of the grid, at most 8 % too long.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from uavexp.arrays import Float, Float32, UInt8
from uavexp.field import UNKNOWN, DistanceField, value_at

PERSON_M = 0.25  # half width of a person
_CELL_M = 0.2
_LEAST_STEP_M = 0.05  # of a ray through the distance field
_THIN_M = 0.05  # a ray that comes so near to a mapped obstacle ends there


def walks_m(field: DistanceField, eye_m: Float, points_m: Float, far_m: float) -> Float:
    """Least way (N,) from any hidden place to each point, m; `far_m` where it is that or more.

    Args:
        field: the map.
        eye_m: (3,) the vehicle.
        points_m: (N, 3) at about one height.
        far_m: ways that are longer are of no interest.
    """
    low, high = points_m[:, :2].min(axis=0) - far_m, points_m[:, :2].max(axis=0) + far_m
    shape = np.ceil((high - low) / _CELL_M).astype(np.int64) + 1
    level_m = float(np.median(points_m[:, 2]))
    grid = (field.distance, field.state, field.origin_m, field.voxel_size_m)
    way_m = _ways(*grid, eye_m, low, level_m, shape[0], shape[1], far_m)
    return np.asarray(_at(way_m, low, points_m))


@nb.njit(cache=True)
def _ways(
    distance: Float32, state: UInt8, origin_m: Float, voxel_m: float, eye_m: Float, low: Float,
    level_m: float, nx: int, ny: int, far_m: float,
) -> Float:  # fmt: skip
    """Ways (nx, ny) from the hidden cells to each cell; cells without room for a person: `far_m`."""
    way, room = np.full((nx, ny), far_m), np.zeros((nx, ny), dtype=np.bool_)
    for i in range(nx):
        for j in range(ny):
            x, y = low[0] + i * _CELL_M, low[1] + j * _CELL_M
            room[i, j] = value_at(distance, origin_m, voxel_m, x, y, level_m) >= PERSON_M
            if room[i, j] and _is_hidden(distance, state, origin_m, voxel_m, eye_m, x, y, level_m):
                way[i, j] = 0.0
    changed = True
    while changed:  # there and back again, until no way gets shorter
        changed = _swept(way, room, 1) | _swept(way, room, -1)
    return way


@nb.njit(cache=True)
def _swept(way: Float, room: Float, sign: int) -> bool:
    """Shorten ways by those of the neighbours that come before in this order; whether any was."""
    nx, ny = way.shape
    changed = False
    for a in range(nx):
        i = a if sign > 0 else nx - 1 - a
        for b in range(ny):
            j = b if sign > 0 else ny - 1 - b
            if not room[i, j]:
                continue
            for di, dj, step in ((-1, 0, 1.0), (0, -1, 1.0), (-1, -1, 1.41421356), (-1, 1, 1.41421356)):
                p, q = i + sign * di, j + sign * dj
                if 0 <= p < nx and 0 <= q < ny and room[p, q]:
                    shorter = way[p, q] + step * _CELL_M
                    if shorter < way[i, j] - 1e-9:
                        way[i, j] = shorter
                        changed = True
    return changed


@nb.njit(cache=True)
def _is_hidden(
    distance: Float32, state: UInt8, origin_m: Float, voxel_m: float, eye_m: Float, x: float, y: float,
    level_m: float,
) -> bool:  # fmt: skip
    """Whether a place was never seen, or a mapped obstacle lies between it and the eye."""
    i = int(np.floor((x - origin_m[0]) / voxel_m))
    j = int(np.floor((y - origin_m[1]) / voxel_m))
    k = int(np.floor((level_m - origin_m[2]) / voxel_m))
    if not (0 <= i < state.shape[0] and 0 <= j < state.shape[1] and 0 <= k < state.shape[2]):
        return False  # beyond the map there is nobody
    if state[i, j, k] == UNKNOWN:
        return True
    if not (
        0 <= eye_m[0] - origin_m[0] < voxel_m * state.shape[0]
        and 0 <= eye_m[1] - origin_m[1] < voxel_m * state.shape[1]
        and 0 <= eye_m[2] - origin_m[2] < voxel_m * state.shape[2]
    ):
        return True
    dx, dy, dz = eye_m[0] - x, eye_m[1] - y, eye_m[2] - level_m
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    gone = 0.0
    while gone < length:
        s = gone / length
        i = int((x + s * dx - origin_m[0]) / voxel_m)
        j = int((y + s * dy - origin_m[1]) / voxel_m)
        k = int((level_m + s * dz - origin_m[2]) / voxel_m)
        free = distance[i, j, k]  # of the voxel: a ray needs no more
        if free <= _THIN_M:
            return True
        gone += max(free - _THIN_M, _LEAST_STEP_M)
    return False


@nb.njit(cache=True)
def _at(way: Float, low: Float, points: Float) -> Float:
    """The way to the cell nearest to each point (N, 3), or to the nearest around it."""
    found = np.empty(len(points))
    for n in range(len(points)):
        u, v = (points[n, 0] - low[0]) / _CELL_M, (points[n, 1] - low[1]) / _CELL_M
        least = np.inf
        for i in range(int(u), int(u) + 2):
            for j in range(int(v), int(v) + 2):
                if 0 <= i < way.shape[0] and 0 <= j < way.shape[1]:
                    least = min(least, way[i, j] + _CELL_M * math.hypot(u - i, v - j))
        found[n] = least
    return found
