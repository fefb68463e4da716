"""Kernels on the planar map: graph distances, frontier cells, clusters, unknown counts."""

from __future__ import annotations

import math

import numba as nb
import numpy as np
from scipy import ndimage

from uavexp.o3d import open3d
from uavexp.types import Bool, Float, Float32, Int32, UInt8

UNKNOWN, FREE = 0, 1  # values of `PlanarMap.state` used here

_OFFSETS = np.array([(-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1)], dtype=np.int64)


_UNIT = 100  # lengths are counted in hundredths of a cell: integers, so buckets serve as queue
_DIAGONAL = 0.7071067811865476
_BUCKETS = 1024  # > the longest step, 2 cells of the greatest cost


@nb.njit(cache=True)
def path_lengths(passable: Bool, cost: Int32, source: tuple[int, int]) -> Float32:
    """Least cost (X, Y), in cells, from the source over passable cells, 8-connected.

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
    start = source[0] * ny + source[1]
    length[start] = 0
    head[0] = start
    waiting, now = 1, 0
    while waiting > 0:
        slot = now % _BUCKETS
        flat = head[slot]
        if flat < 0:
            now += 1
            continue
        head[slot] = following[flat]
        if following[flat] >= 0:
            previous[following[flat]] = -1
        waiting -= 1
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
            if length[near] != far:  # already waiting: take it out of its bucket
                if previous[near] >= 0:
                    following[previous[near]] = following[near]
                else:
                    head[length[near] % _BUCKETS] = following[near]
                if following[near] >= 0:
                    previous[following[near]] = previous[near]
                waiting -= 1
            length[near] = there
            slot = there % _BUCKETS
            previous[near], following[near] = -1, head[slot]
            if head[slot] >= 0:
                previous[head[slot]] = near
            head[slot] = near
            waiting += 1
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
def unknown_within(state: UInt8, inside: Bool, cell: tuple[int, int], radius_cells: float) -> int:
    """Number of unknown cells inside the bounds within a radius: J_info of one goal."""
    nx, ny = state.shape
    reach = int(radius_cells)
    count = 0
    for i in range(max(cell[0] - reach, 0), min(cell[0] + reach + 1, nx)):
        for j in range(max(cell[1] - reach, 0), min(cell[1] + reach + 1, ny)):
            di, dj = i - cell[0], j - cell[1]
            if di * di + dj * dj <= radius_cells * radius_cells and inside[i, j] and state[i, j] == UNKNOWN:
                count += 1
    return count


def split_long(cells: Int32, max_extent_cells: float) -> list[Int32]:
    """Split a cluster (N, 2) along its principal axis until no part is longer than the limit.

    As in FUEL (Zhou et al. 2021): the centroid of a long curved frontier lies off it.
    """
    centred: Float = cells - cells.mean(axis=0)
    # Principal direction of a 2x2 scatter matrix, closed form: bitwise the same everywhere.
    xx, yy = float((centred[:, 0] ** 2).sum()), float((centred[:, 1] ** 2).sum())
    xy = float((centred[:, 0] * centred[:, 1]).sum())
    angle = 0.5 * math.atan2(2.0 * xy, xx - yy)
    along = centred[:, 0] * math.cos(angle) + centred[:, 1] * math.sin(angle)
    if along.max() - along.min() <= max_extent_cells or len(cells) < 2:
        return [cells]
    lower = along <= 0.5 * (along.max() + along.min())
    return split_long(cells[lower], max_extent_cells) + split_long(cells[~lower], max_extent_cells)
