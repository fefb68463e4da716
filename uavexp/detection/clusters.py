"""Clusters of points: Euclidean, through the voxels that the points occupy (numba)."""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Bool, Float, Int

_CELL_M = 0.1  # points of one cell belong together
_SPAN = 1 << 20  # cells along an axis that a key can tell apart: 100 km


class Clusters(NamedTuple):
    """Groups of points that lie together, each as a box and as the sensor sees it."""

    label: Int  # (N,) cluster of each point, -1: of none
    low_m: Float  # (K, 3) corners of the upright box around each
    high_m: Float  # (K, 3)
    sight: Float  # (K, 2) horizontal direction of each from the sensor, unit length
    span_m: Float  # (K, 5) seen from there: nearest, rightmost, leftmost, lowest, highest

    def __len__(self) -> int:
        return len(self.low_m)


@nb.njit(cache=True, inline="always")
def _root(parent: Int, cell: int) -> int:
    while parent[cell] != cell:
        parent[cell] = parent[parent[cell]]
        cell = parent[cell]
    return cell


@nb.njit(cache=True)
def _join_cells(key: Int, reach_cells: float) -> Int:
    """Smallest cell of its component for each cell; `key` (U,) ascending, x slowest."""
    count = key.shape[0]
    parent = np.arange(count)
    reach = int(np.floor(reach_cells))
    for a in range(count):
        ax, ay, az = key[a] // (_SPAN * _SPAN), key[a] // _SPAN % _SPAN, key[a] % _SPAN
        for b in range(a + 1, count):
            dx = key[b] // (_SPAN * _SPAN) - ax
            if dx > reach:
                break
            dy, dz = key[b] // _SPAN % _SPAN - ay, key[b] % _SPAN - az
            if dx * dx + dy * dy + dz * dz <= reach_cells * reach_cells:
                ra, rb = _root(parent, a), _root(parent, b)
                parent[max(ra, rb)] = min(ra, rb)
    for a in range(count):
        parent[a] = _root(parent, a)
    return parent


@nb.njit(cache=True)
def _extents(points_m: Float, label: Int, count: int, sensor_m: Float) -> tuple[Float, Float, Float, Float]:
    """Corners (K, 3) twice, direction of sight (K, 2) and extent in its frame (K, 5) of labelled points."""
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    sight = np.zeros((count, 2))
    for n in range(points_m.shape[0]):
        if label[n] >= 0:
            for axis in range(3):
                low[label[n], axis] = min(low[label[n], axis], points_m[n, axis])
                high[label[n], axis] = max(high[label[n], axis], points_m[n, axis])
    for k in range(count):
        dx = 0.5 * (low[k, 0] + high[k, 0]) - sensor_m[0]
        dy = 0.5 * (low[k, 1] + high[k, 1]) - sensor_m[1]
        far = np.sqrt(dx * dx + dy * dy)
        sight[k, 0], sight[k, 1] = (dx / far, dy / far) if 0.0 < far < np.inf else (1.0, 0.0)
    span = np.empty((count, 5))
    for k in range(count):
        span[k, 0], span[k, 1], span[k, 2] = np.inf, np.inf, -np.inf
        span[k, 3], span[k, 4] = low[k, 2], high[k, 2]
    for n in range(points_m.shape[0]):
        k = label[n]
        if k >= 0:
            dx, dy = points_m[n, 0] - sensor_m[0], points_m[n, 1] - sensor_m[1]
            across = dy * sight[k, 0] - dx * sight[k, 1]
            span[k, 0] = min(span[k, 0], dx * sight[k, 0] + dy * sight[k, 1])
            span[k, 1], span[k, 2] = min(span[k, 1], across), max(span[k, 2], across)
    return low, high, sight, span


def cluster(points_m: Float, sensor_m: Float, reach_m: float, min_points: int, max_size_m: float) -> Clusters:
    """Group points that are joined by gaps of at most about `reach_m`.

    Args:
        points_m: (N, 3), finite.
        sensor_m: (3,) from where they were seen.
        reach_m: points are put into cells of 0.1 m; cells so near to each other are joined.
        min_points: smaller groups are no cluster.
        max_size_m: nor are groups that are longer than this along an axis.

    Returns:
        Clusters in the order of their least cell: the order of the points does not matter.
    """
    if len(points_m) < min_points:
        return _measured(points_m, np.full(len(points_m), -1), sensor_m, min_points, max_size_m)
    cell = np.floor(points_m / _CELL_M).astype(np.int64) + _SPAN // 2
    key, of_point = np.unique((cell[:, 0] * _SPAN + cell[:, 1]) * _SPAN + cell[:, 2], return_inverse=True)
    label = np.unique(_join_cells(key, reach_m / _CELL_M), return_inverse=True)[1][of_point]
    return _measured(points_m, label, sensor_m, min_points, max_size_m)


def split(clusters: Clusters, points_m: Float, sensor_m: Float, low_m: Float, high_m: Float) -> Clusters:
    """Cut clusters that reach into several boxes: each point goes to the nearest of those.

    Bodies that pass each other closely are one cluster; where they are expected tells them apart.

    Args:
        clusters: of the points.
        points_m: (N, 3).
        sensor_m: (3,) from where they were seen.
        low_m: (B, 3) lower corners of the boxes.
        high_m: (B, 3) upper corners.
    """
    meets = (clusters.low_m[:, None] <= high_m) & (clusters.high_m[:, None] >= low_m)
    reached: Bool = np.asarray(meets.all(axis=2))  # (K, B)
    label = clusters.label.copy()
    for k in np.flatnonzero(reached.sum(axis=1) > 1):
        (mine,), (boxes,) = np.nonzero(clusters.label == k), np.nonzero(reached[k])
        here = points_m[mine, None]
        outside = np.maximum(np.maximum(low_m[boxes] - here, here - high_m[boxes]), 0.0)
        nearest = np.argmin((outside**2).sum(axis=2), axis=1)
        label[mine[nearest > 0]] = label.max() + nearest[nearest > 0]
    if np.array_equal(label, clusters.label):
        return clusters
    return _measured(points_m, label, sensor_m, 1, np.inf)


def _measured(points_m: Float, label: Int, sensor_m: Float, min_points: int, max_size_m: float) -> Clusters:
    """Clusters of labelled points (-1: of none), renumbered; those of too few points or too long left out."""
    count = int(label.max(initial=-1)) + 1
    low, high, sight, span = _extents(points_m, label, count, sensor_m)
    points = np.bincount(label[label >= 0], minlength=count)
    kept = (points >= max(min_points, 1)) & ((high - low).max(axis=1, initial=0.0) <= max_size_m)
    renamed = np.append(np.where(kept, np.cumsum(kept) - 1, -1), -1)
    return Clusters(renamed[label], low[kept], high[kept], sight[kept], span[kept])
