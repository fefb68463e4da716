"""Kernels on the planar map: frontier cells, their clusters and what to fly to in them, unknown counts."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from uavexp.arrays import Bool, Float, Float32, Int, UInt8
from uavexp.field import FREE, UNKNOWN, value_and_gradient
from uavexp.mapping.projection import Part
from uavexp.o3d import open3d


@nb.njit(cache=True)
def mark_frontier(state: UInt8, inside: Part, parts: Int, frontier: Bool) -> None:
    """Mark frontier cells (X, Y): free ones with an unknown 8-neighbour, both inside the flight bounds.

    Args:
        state: (X, Y) of the planar map.
        inside: the part within the flight bounds.
        parts: (P, 4) that changed; the cells around them are looked at, too.
        frontier: is written.
    """
    i0, i1, j0, j1 = inside
    for n in range(parts.shape[0]):
        for i in range(max(parts[n, 0] - 1, i0), min(parts[n, 1] + 1, i1)):
            for j in range(max(parts[n, 2] - 1, j0), min(parts[n, 3] + 1, j1)):
                borders = False
                if state[i, j] == FREE:
                    for a in range(max(i - 1, i0), min(i + 2, i1)):
                        for b in range(max(j - 1, j0), min(j + 2, j1)):
                            borders |= state[a, b] == UNKNOWN
                frontier[i, j] = borders


@nb.njit(cache=True)
def connected_components(cells: Bool, index: Int) -> Int:
    """Cluster (N,) of each of all set cells (X, Y): 8-connected, numbered in the order of their first cell.

    Args:
        cells: (X, Y).
        index: (N, 2) of those set, in C order.
    """
    number = np.empty(cells.shape, dtype=np.int32)  # of each set cell in `index`
    for n in range(index.shape[0]):
        number[index[n, 0], index[n, 1]] = n
    cluster, count = np.full(index.shape[0], -1, dtype=np.int64), 0
    stack = np.empty(index.shape[0], dtype=np.int64)
    for first in range(index.shape[0]):
        if cluster[first] >= 0:
            continue
        cluster[first], stack[0], waiting = count, first, 1
        while waiting > 0:
            waiting -= 1
            i, j = index[stack[waiting], 0], index[stack[waiting], 1]
            for a in range(max(i - 1, 0), min(i + 2, cells.shape[0])):
                for b in range(max(j - 1, 0), min(j + 2, cells.shape[1])):
                    if cells[a, b] and cluster[number[a, b]] < 0:
                        cluster[number[a, b]] = count
                        stack[waiting] = number[a, b]
                        waiting += 1
        count += 1
    return cluster


def density_clusters(index: Int, radius_cells: float, min_neighbours: int) -> Int:
    """Cluster (N,) of each cell (N, 2) by DBSCAN (Ester et al. 1996, Open3D's); -1 of noise."""
    if len(index) == 0:
        return np.zeros(0, dtype=np.int64)
    cloud = open3d.geometry.PointCloud()
    cloud.points = open3d.utility.Vector3dVector(np.pad(index, ((0, 0), (0, 1))).astype(np.float64))
    member = cloud.cluster_dbscan(eps=radius_cells, min_points=min_neighbours)
    return np.asarray(member, dtype=np.int64)


@nb.njit(cache=True)
def unknown_within(state: UInt8, inside: Part, cells: Int, radius_cells: float) -> Int:
    """Number (N,) of unknown cells inside the bounds around cells (N, 2): J_info."""
    i0, i1, j0, j1 = inside
    reach = int(radius_cells)
    count = np.zeros(cells.shape[0], dtype=np.int64)
    for n in range(cells.shape[0]):
        x, y = cells[n, 0], cells[n, 1]
        for i in range(max(x - reach, i0), min(x + reach + 1, i1)):
            for j in range(max(y - reach, j0), min(y + reach + 1, j1)):
                near = (i - x) ** 2 + (j - y) ** 2 <= radius_cells * radius_cells
                count[n] += near and state[i, j] == UNKNOWN
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
def _bisect(cells: Int, begin: int, end: int, max_extent_cells: float) -> int:
    """Sort cells[begin:end] into the halves along their principal axis; where the second begins, or `end`."""
    size, x, y = end - begin, 0.0, 0.0
    for n in range(begin, end):
        x, y = x + cells[n, 0], y + cells[n, 1]
    x, y = x / size, y / size
    xx = yy = xy = 0.0
    for n in range(begin, end):
        dx, dy = cells[n, 0] - x, cells[n, 1] - y
        xx, yy, xy = xx + dx * dx, yy + dy * dy, xy + dx * dy
    angle = 0.5 * math.atan2(2.0 * xy, xx - yy)  # principal direction of a 2x2 scatter matrix
    along = (cells[begin:end, 0] - x) * math.cos(angle) + (cells[begin:end, 1] - y) * math.sin(angle)
    low, high = along.min(), along.max()
    if high - low <= max_extent_cells or size < 2:
        return end
    before, middle = cells[begin:end].copy(), begin
    upper = along > 0.5 * (low + high)
    for half in (False, True):
        for n in range(size):
            if upper[n] == half:
                cells[middle] = before[n]
                middle += 1
    return end - int(upper.sum())


@nb.njit(cache=True)
def split_long(cells: Int, max_extent_cells: float) -> Int:
    """Ends (P,) of the parts of a cluster (N, 2), halved along its principal axis until none is too long.

    As in FUEL (Zhou et al. 2021): the centroid of a long curved frontier lies off it. The cells are
    sorted by part, lower half first.
    """
    ends = np.empty(cells.shape[0], dtype=np.int64)
    waiting = [cells.shape[0]]  # ends of the parts still to be looked at, the next one last
    begin, count = 0, 0
    while len(waiting) > 0:
        middle = _bisect(cells, begin, waiting[-1], max_extent_cells)
        if middle < waiting[-1]:
            waiting.append(middle)
            continue
        begin = ends[count] = waiting.pop()
        count += 1
    return ends[:count]


@nb.njit(cache=True)
def cluster_centroids(index: Int, cluster: Int, least_cells: int, max_extent_cells: float) -> Float:
    """Mean cell (P, 2) of each part that `split_long` makes of each cluster that is large enough.

    Args:
        index: (N, 2) of cells, sorted by cluster.
        cluster: (N,) of each, ascending; -1: none.
        least_cells: of a cluster.
        max_extent_cells: of a part.
    """
    mean, count, end = np.empty((index.shape[0], 2)), 0, 0
    while end < index.shape[0]:
        begin = end
        while end < index.shape[0] and cluster[end] == cluster[begin]:
            end += 1
        if cluster[begin] < 0 or end - begin < least_cells:
            continue
        cells, first = index[begin:end].copy(), 0
        for last in split_long(cells, max_extent_cells):
            mean[count, 0] = cells[first:last, 0].sum() / (last - first)
            mean[count, 1] = cells[first:last, 1].sum() / (last - first)
            count, first = count + 1, last
    return mean[:count]
