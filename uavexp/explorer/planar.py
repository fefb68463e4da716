"""Kernels on the planar map: graph distances, frontier cells, clusters, unknown counts."""

from __future__ import annotations

import math

import numba as nb
import numpy as np
from scipy import ndimage

from uavexp.arrays import Bool, Float, Float32, Int, Int32, UInt8
from uavexp.field import FREE, UNKNOWN, value_and_gradient
from uavexp.o3d import open3d

_OFFSETS = np.array([(-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1)], dtype=np.int64)


_UNIT = 100  # lengths are counted in hundredths of a cell: integers, so buckets serve as queue
_DIAGONAL = 0.7071067811865476
_BUCKETS = 1024  # > the longest step, 2 cells of the greatest cost


@nb.njit(cache=True, inline="always")
def _put_in(head: Int32, following: Int32, previous: Int32, slot: int, cell: int) -> None:
    """Add a cell in front of a bucket's doubly linked list."""
    previous[cell], following[cell] = -1, head[slot]
    if head[slot] >= 0:
        previous[head[slot]] = cell
    head[slot] = cell


@nb.njit(cache=True, inline="always")
def _take_out(head: Int32, following: Int32, previous: Int32, slot: int, cell: int) -> None:
    """Take a cell out of a bucket's list."""
    if previous[cell] >= 0:
        following[previous[cell]] = following[cell]
    else:
        head[slot] = following[cell]
    if following[cell] >= 0:
        previous[following[cell]] = previous[cell]


@nb.njit(cache=True)
def path_lengths(passable: Bool, cost: Int32, source: tuple[int, int], wanted: Int) -> Float32:
    """Least cost (X, Y), in cells, from the source over passable cells, 8-connected.

    Exact at the `wanted` cells (N,), flat C-order indices: the search ends when it has them
    all; elsewhere an upper bound. With none wanted it is exact everywhere.

    A straight step costs the mean of both cells' `cost` (hundredths, 100 to 500), a
    diagonal one sqrt(2) times that, rounded down to hundredths; no corner is cut: a diagonal
    step needs both of its side cells passable. Unreached cells are inf. The source is
    expanded even if it is not passable itself. Dijkstra (1959) with Dial's (1969) buckets.
    """
    nx, ny = passable.shape
    far = np.int32(2**31 - 1)
    length = np.full(nx * ny, far, dtype=np.int32)
    following = np.full(nx * ny, -1, dtype=np.int32)  # bucket lists, doubly linked
    previous = np.full(nx * ny, -1, dtype=np.int32)
    head = np.full(_BUCKETS, -1, dtype=np.int32)
    asked = np.zeros(nx * ny, dtype=np.bool_)
    asked[wanted] = True
    missing = np.count_nonzero(asked)
    start = source[0] * ny + source[1]
    length[start], head[0], waiting, now = 0, start, 1, 0
    while waiting > 0:
        slot = now % _BUCKETS
        flat = head[slot]
        if flat < 0:
            now += 1
            continue
        _take_out(head, following, previous, slot, flat)
        waiting -= 1
        if asked[flat]:
            missing -= 1
            if missing == 0:
                break
        i, j = flat // ny, flat % ny
        for n in range(8):
            di, dj = _OFFSETS[n, 0], _OFFSETS[n, 1]
            a, b = i + di, j + dj
            if not (0 <= a < nx and 0 <= b < ny) or not passable[a, b]:
                continue
            both = cost[i, j] + cost[a, b]
            if di != 0 and dj != 0:
                if not (passable[a, j] and passable[i, b]):
                    continue
                step = int(both * _DIAGONAL)
            else:
                step = both // 2
            near, there = a * ny + b, now + step
            if there >= length[near]:
                continue
            if length[near] == far:
                waiting += 1
            else:
                _take_out(head, following, previous, length[near] % _BUCKETS, near)
            length[near] = there
            _put_in(head, following, previous, there % _BUCKETS, near)
    cells = np.empty((nx, ny), dtype=np.float32)
    for flat in range(nx * ny):
        cells[flat // ny, flat % ny] = np.inf if length[flat] == far else length[flat] / _UNIT
    return cells


@nb.njit(cache=True)
def frontier_cells(state: UInt8, inside: Bool) -> Bool:
    """Frontier (X, Y): free cells with an unknown 8-neighbour, both inside the flight bounds."""
    nx, ny = state.shape
    frontier = np.zeros((nx, ny), dtype=np.bool_)
    for i in range(nx):
        for j in range(ny):
            if state[i, j] != FREE or not inside[i, j]:
                continue
            for n in range(8):
                a, b = i + _OFFSETS[n, 0], j + _OFFSETS[n, 1]
                if 0 <= a < nx and 0 <= b < ny and inside[a, b] and state[a, b] == UNKNOWN:
                    frontier[i, j] = True
                    break
    return frontier


def connected_components(cells: Bool) -> list[Int32]:
    """Clusters, each (N, 2), of 8-connected cells, in the order of their first cell."""
    label, count = ndimage.label(cells, structure=np.ones((3, 3)))
    index = np.argwhere(cells).astype(np.int32)
    member = label[cells]
    return [index[member == n] for n in range(1, count + 1)]


def density_clusters(cells: Bool, radius_cells: float, min_neighbours: int) -> list[Int32]:
    """Clusters, each (N, 2), by DBSCAN (Ester et al. 1996, Open3D's); noise is left out."""
    index = np.argwhere(cells).astype(np.int32)
    if len(index) == 0:
        return []
    cloud = open3d.geometry.PointCloud()
    cloud.points = open3d.utility.Vector3dVector(np.pad(index, ((0, 0), (0, 1))).astype(np.float64))
    member = np.asarray(cloud.cluster_dbscan(eps=radius_cells, min_points=min_neighbours))
    return [index[member == n] for n in range(member.max() + 1)]


@nb.njit(cache=True)
def unknown_within(state: UInt8, inside: Bool, cells: Int, radius_cells: float) -> Int:
    """Number (N,) of unknown cells inside the bounds around cells (N,), flat indices: J_info."""
    nx, ny = state.shape
    reach = int(radius_cells)
    count = np.zeros(cells.shape[0], dtype=np.int64)
    for n in range(cells.shape[0]):
        x, y = cells[n] // ny, cells[n] % ny
        for i in range(max(x - reach, 0), min(x + reach + 1, nx)):
            for j in range(max(y - reach, 0), min(y + reach + 1, ny)):
                near = (i - x) ** 2 + (j - y) ** 2 <= radius_cells * radius_cells
                if near and inside[i, j] and state[i, j] == UNKNOWN:
                    count[n] += 1
    return count


@nb.njit(cache=True)
def ascend(
    distance: Float32,
    origin_m: Float,
    voxel_size_m: float,
    points_m: Float,
    step_m: float,
    steps: int,
    enough_m: float,
    bounds_m: Float,
) -> Float:
    """Points (N, 3) moved by x <- x + alpha_g grad ESDF(x) in their plane until the clearance is enough.

    Args:
        distance: the field's grid.
        origin_m: (3,) its lower corner.
        voxel_size_m: edge of its voxels.
        points_m: where to begin.
        step_m: alpha_g, the length of one step.
        steps: at most so many.
        enough_m: clearance at which a point rests.
        bounds_m: (2, 3) box that holds every moved point.
    """
    moved = points_m.copy()
    for n in range(moved.shape[0]):
        for _ in range(steps):
            value, gradient = value_and_gradient(distance, origin_m, voxel_size_m, moved[n : n + 1])
            norm = math.hypot(gradient[0, 0], gradient[0, 1])
            if value[0] >= enough_m or norm < 1e-3:
                break
            for axis in range(3):
                if axis < 2:
                    moved[n, axis] += step_m * gradient[0, axis] / norm
                moved[n, axis] = min(max(moved[n, axis], bounds_m[0, axis]), bounds_m[1, axis])
        moved[n, 2] = points_m[n, 2]
    return moved


@nb.njit(cache=True)
def split_long(cells: Int32, max_extent_cells: float) -> Int:
    """Part (N,) of each cell (N, 2) of a cluster, halved along its principal axis until none is too long.

    As in FUEL (Zhou et al. 2021): the centroid of a long curved frontier lies off it. Parts
    are numbered from 0 in the order of the halving, lower half first.
    """
    count = cells.shape[0]
    part = np.zeros(count, dtype=np.int64)
    waiting = [0]  # parts still to be looked at, the next one last
    used, done = 1, 0
    final = np.full(count, -1, dtype=np.int64)
    along = np.zeros(count)
    while len(waiting) > 0:
        now = waiting.pop()
        size, x, y = 0, 0.0, 0.0
        for n in range(count):
            if part[n] == now:
                size, x, y = size + 1, x + cells[n, 0], y + cells[n, 1]
        x, y = x / size, y / size
        xx = yy = xy = 0.0
        for n in range(count):
            if part[n] == now:
                dx, dy = cells[n, 0] - x, cells[n, 1] - y
                xx, yy, xy = xx + dx * dx, yy + dy * dy, xy + dx * dy
        angle = 0.5 * math.atan2(2.0 * xy, xx - yy)  # principal direction of a 2x2 scatter matrix
        low, high = np.inf, -np.inf
        for n in range(count):
            if part[n] == now:
                along[n] = (cells[n, 0] - x) * math.cos(angle) + (cells[n, 1] - y) * math.sin(angle)
                low, high = min(low, along[n]), max(high, along[n])
        if high - low <= max_extent_cells or size < 2:
            for n in range(count):
                if part[n] == now:
                    final[n] = done
            done += 1
            continue
        for n in range(count):
            if part[n] == now:
                part[n] = used if along[n] <= 0.5 * (low + high) else used + 1
        waiting.append(used + 1)
        waiting.append(used)
        used += 2
    return final


@nb.njit(cache=True)
def split_centroids(cells: Int32, max_extent_cells: float) -> Float:
    """Mean cell (P, 2) of each part of a cluster (N, 2) that `split_long` makes."""
    part = split_long(cells, max_extent_cells)
    mean = np.zeros((part.max() + 1, 2))
    size = np.zeros(part.max() + 1)
    for n in range(cells.shape[0]):
        size[part[n]] += 1
        mean[part[n], 0] += cells[n, 0]
        mean[part[n], 1] += cells[n, 1]
    return mean / size.reshape(-1, 1)
