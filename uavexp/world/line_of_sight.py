"""Lines of sight among triangles, and the shortening of paths by them (numba)."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from uavexp.arrays import Float
from uavexp.triangle_grid import TriangleGrid, ball_meets_mesh

SIGHT_STEP_M = 0.05  # between the points tested along a line of sight


@nb.njit(cache=True)
def in_sight(grid: TriangleGrid, a: Float, b: Float, clearance: float) -> bool:
    """Whether the segment from a to b (3,) keeps `clearance` from every triangle.

    Never true wrongly; false at most by the proof radius, 0.7 mm at 0.45 m.
    """
    length = math.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)
    count = max(1, math.ceil(length / SIGHT_STEP_M))
    radius = math.sqrt(clearance * clearance + 0.25 * (length / count) ** 2)
    stride = 1
    while stride < count:
        stride *= 2
    point = np.empty(3)
    first = 0
    while stride >= 1:  # coarse to fine: an obstacle in between shows early
        for n in range(first, count + 1, stride if first == 0 else 2 * stride):
            for axis in range(3):
                point[axis] = a[axis] + (b[axis] - a[axis]) * (n / count)
            if ball_meets_mesh(grid, point, radius):
                return False
        stride //= 2
        first = stride
    return True


@nb.njit(cache=True)
def skip_ahead(grid: TriangleGrid, path: Float, clearance: float) -> Float:
    """Drop the points (P, 3) that a line of sight passes by: one greedy pass from the start."""
    kept = np.empty_like(path)
    kept[0] = path[0]
    count, here = 1, 0
    while here < path.shape[0] - 1:
        reach = here + 1
        while reach + 1 < path.shape[0] and in_sight(grid, path[here], path[reach + 1], clearance):
            reach += 1
        kept[count] = path[reach]
        count += 1
        here = reach
    return kept[:count].copy()


@nb.njit(cache=True)
def tighten(grid: TriangleGrid, points: Float, clearance: float) -> Float:
    """Shortest chain, first to last, of a subset of the points (P, 3), neighbours in sight.

    Points that follow one another count as in sight. Dynamic programming; for each point the
    predecessors are tried in the order of the length they would give, the first in sight wins.
    """
    count = points.shape[0]
    length = np.zeros(count)
    before = np.zeros(count, dtype=np.int64)
    for j in range(1, count):
        total = np.empty(j)
        for i in range(j):
            total[i] = length[i] + math.sqrt(
                (points[i, 0] - points[j, 0]) ** 2
                + (points[i, 1] - points[j, 1]) ** 2
                + (points[i, 2] - points[j, 2]) ** 2
            )
        length[j], before[j] = total[j - 1], j - 1
        while True:
            i = int(np.argmin(total))
            if total[i] >= length[j]:
                break
            if in_sight(grid, points[i], points[j], clearance):
                length[j], before[j] = total[i], i
                break
            total[i] = np.inf
    chain = np.empty_like(points)
    filled, here = 0, count - 1
    while here > 0:
        chain[filled] = points[here]
        filled += 1
        here = before[here]
    chain[filled] = points[0]
    return chain[: filled + 1][::-1].copy()
