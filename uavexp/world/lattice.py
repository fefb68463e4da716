"""Exact shortest lattice paths among triangles, and their shortening by lines of sight (numba).

Nodes are the centres of cubes that fill the flight bounds; a node is passable when no
triangle comes nearer than `radius_m`. Nodes are tested only when the search reaches them.

Clearance between nodes: for a point o and the midpoint m of a and b with |a - b| = 2h,
|m - o|² = (|a - o|² + |b - o|²)/2 - h². So balls of radius² = clearance² + h² free of
triangles at both ends prove `clearance` along the whole segment; `proof_radius_m` is that.
"""

from __future__ import annotations

import heapq
import math

import numba as nb
import numpy as np

from uavexp.arrays import Bool, Float, Int, UInt8
from uavexp.triangle_grid import TriangleGrid, ball_meets_mesh, box_meets_mesh

SIGHT_STEP_M = 0.05  # between the points tested along a line of sight
_UNTESTED, _BLOCKED, _PASSABLE, _PASSABLE_END = 0, 1, 2, 3


def proof_radius_m(clearance_m: float, longest_edge_m: float) -> float:
    """Radius of free balls at both ends of an edge that proves `clearance_m` along it."""
    return math.sqrt(clearance_m**2 + 0.25 * longest_edge_m**2)


def shape_of(bounds_m: Float, cell_m: float) -> Int:
    """Number of nodes (3,) along each axis of the bounds (2, 3)."""
    count: Int = np.floor((bounds_m[1] - bounds_m[0]) / cell_m + 1e-9).astype(np.int64)
    return np.maximum(1, count)


@nb.njit(cache=True)
def passable_layer(
    grid: TriangleGrid, low: Float, cell: float, shape: Int, height: float, radius: float
) -> Bool:
    """Which nodes (X, Y) of the lattice, moved to one height, have a free ball of `radius`."""
    layer = np.empty((shape[0], shape[1]), dtype=np.bool_)
    point = np.empty(3)
    point[2] = height
    for i in range(shape[0]):
        point[0] = low[0] + (i + 0.5) * cell
        for j in range(shape[1]):
            point[1] = low[1] + (j + 0.5) * cell
            layer[i, j] = not ball_meets_mesh(grid, point, radius)
    return layer


@nb.njit(cache=True)
def empty_columns(
    grid: TriangleGrid, low: Float, cell: float, shape: Int, height: float, half: Float
) -> Bool:
    """Which upright boxes (X, Y), of half lengths `half` (3,), one a cell, meet no triangle."""
    empty = np.empty((shape[0], shape[1]), dtype=np.bool_)
    centre = np.empty(3)
    centre[2] = height
    upright = np.eye(3)
    for i in range(shape[0]):
        centre[0] = low[0] + (i + 0.5) * cell
        for j in range(shape[1]):
            centre[1] = low[1] + (j + 0.5) * cell
            empty[i, j] = not box_meets_mesh(grid, centre, upright, half)
    return empty


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
def _octile(dx: float, dy: float, dz: float) -> float:
    """Length of the shortest 26-connected path over (dx, dy, dz) in empty space."""
    a, b, c = abs(dx), abs(dy), abs(dz)
    largest = max(a, b, c)
    smallest = min(a, b, c)
    middle = a + b + c - largest - smallest
    return largest + (math.sqrt(2.0) - 1.0) * middle + (math.sqrt(3.0) - math.sqrt(2.0)) * smallest


@nb.njit(cache=True)
def _is_passable(grid: TriangleGrid, tested: UInt8, flat: int, point: Float, radius: float) -> bool:
    if tested[flat] == _UNTESTED:
        tested[flat] = _BLOCKED if ball_meets_mesh(grid, point, radius) else _PASSABLE
    return bool(tested[flat] >= _PASSABLE)


@nb.njit(cache=True)
def _entries(
    grid: TriangleGrid,
    low: Float,
    cell: float,
    shape: Int,
    radius: float,
    clearance: float,
    tested: UInt8,
    end: Float,
) -> tuple[Int, Float]:
    """Nodes around an end point that can be flown to straight, ascending, and how far each is.

    The node at the point itself when there is one; else those within two cells.
    """
    nodes = np.empty(125, dtype=np.int64)
    hops = np.empty(125)
    count = 0
    point = np.empty(3)
    base = np.empty(3, dtype=np.int64)
    for axis in range(3):
        base[axis] = math.floor((end[axis] - low[axis]) / cell)
    for i in range(base[0] - 2, base[0] + 3):
        for j in range(base[1] - 2, base[1] + 3):
            for k in range(base[2] - 2, base[2] + 3):
                if not (0 <= i < shape[0] and 0 <= j < shape[1] and 0 <= k < shape[2]):
                    continue
                point[0] = low[0] + (i + 0.5) * cell
                point[1] = low[1] + (j + 0.5) * cell
                point[2] = low[2] + (k + 0.5) * cell
                flat = (i * shape[1] + j) * shape[2] + k
                if not _is_passable(grid, tested, flat, point, radius):
                    continue
                hop = math.sqrt(
                    (point[0] - end[0]) ** 2 + (point[1] - end[1]) ** 2 + (point[2] - end[2]) ** 2
                )
                if hop < 1e-6 * cell:
                    return np.array([flat]), np.array([0.0])
                if in_sight(grid, point, end, clearance):
                    nodes[count], hops[count] = flat, hop
                    count += 1
    return nodes[:count], hops[:count]


@nb.njit(cache=True)
def _column_is_passable(
    grid: TriangleGrid,
    low: Float,
    cell: float,
    shape: Int,
    radius: float,
    tested: UInt8,
    i: int,
    j: int,
    middle: int,
) -> bool:
    """Whether any node of a column is passable; those near the level `middle` are asked first."""
    point = np.empty(3)
    point[0] = low[0] + (i + 0.5) * cell
    point[1] = low[1] + (j + 0.5) * cell
    for away in range(2 * shape[2]):
        k = middle + (away + 1) // 2 * (1 if away % 2 == 0 else -1)
        if 0 <= k < shape[2]:
            point[2] = low[2] + (k + 0.5) * cell
            if _is_passable(grid, tested, (i * shape[1] + j) * shape[2] + k, point, radius):
                return True
    return False


@nb.njit(cache=True)
def _column_bound(
    grid: TriangleGrid,
    low: Float,
    cell: float,
    shape: Int,
    radius: float,
    tested: UInt8,
    starts: Int,
    ends: Int,
) -> Float:
    """Lower bound (X, Y) of the path length from each column to the nearest end node.

    Dijkstra over columns that hold a passable node, 8-connected, from the ends until every
    start has been reached: a path's shadow on the plane is never longer than the path.
    Columns beyond get the distance at which the search stopped; all are inf when a start's
    column cannot be reached.
    """
    bound = np.full(shape[0] * shape[1], np.inf)
    closed = np.zeros(shape[0] * shape[1], dtype=np.bool_)
    wanted = np.zeros(shape[0] * shape[1], dtype=np.bool_)
    heap = [(0.0, 0.0, np.int64(0))]  # the same type as the search's: compiled once
    heap.pop()
    for flat in ends:
        if bound[flat // shape[2]] > 0.0:
            bound[flat // shape[2]] = 0.0
            heapq.heappush(heap, (0.0, 0.0, flat // shape[2]))
    missing = 0
    for flat in starts:
        missing += not wanted[flat // shape[2]]
        wanted[flat // shape[2]] = True
    middle = starts[0] % shape[2]
    stopped = np.inf
    while len(heap) > 0 and missing > 0:
        stopped, _, column = heapq.heappop(heap)
        if closed[column]:
            continue
        closed[column] = True
        missing -= wanted[column]
        i, j = column // shape[1], column % shape[1]
        for di in range(-1, 2):
            for dj in range(-1, 2):
                ni, nj = i + di, j + dj
                if not (0 <= ni < shape[0] and 0 <= nj < shape[1]):
                    continue
                near = ni * shape[1] + nj
                longer = bound[column] + cell * math.sqrt(float(di * di + dj * dj))
                if longer < bound[near] and _column_is_passable(
                    grid, low, cell, shape, radius, tested, ni, nj, middle
                ):
                    bound[near] = longer
                    heapq.heappush(heap, (longer, 0.0, near))
    if missing > 0:
        stopped = np.inf
    return np.where(closed, bound, stopped)


@nb.njit(cache=True)
def shortest_path(
    grid: TriangleGrid,
    low: Float,
    cell: float,
    shape: Int,
    radius: float,
    clearance: float,
    start: Float,
    target: Float,
) -> Float:
    """Shortest path (P, 3) from start to target over passable nodes, 26-connected; A*.

    Exact on the lattice. The heuristic is the larger of two lower bounds: the octile distance,
    less what the last hop, off the lattice, can save; and the shortest path's shadow on the
    plane (`_column_bound`), which knows the walls. Ties go to the node with less ahead of it,
    then to the lower index.

    Args:
        grid: the triangles.
        low: lower corner of the flight bounds (3,), m.
        cell: node spacing, m.
        shape: nodes along each axis (3,).
        radius: of the free ball that a node needs, m.
        clearance: that the hops between the ends and their nearest nodes need, m.
        start: (3,).
        target: (3,).

    Returns:
        The path, ends included; (0, 3) when there is none.
    """
    size = shape[0] * shape[1] * shape[2]
    tested = np.zeros(size, dtype=np.uint8)
    ends, end_hops = _entries(grid, low, cell, shape, radius, clearance, tested, target)
    starts, start_hops = _entries(grid, low, cell, shape, radius, clearance, tested, start)
    if starts.shape[0] == 0 or ends.shape[0] == 0:
        return np.empty((0, 3))
    bound = _column_bound(grid, low, cell, shape, radius, tested, starts, ends)
    if bound[starts[0] // shape[2]] == np.inf:
        return np.empty((0, 3))
    for flat in ends:
        tested[flat] = _PASSABLE_END
    cost = np.full(size + 1, np.inf)  # node `size` is the target itself
    parent = np.full(size + 1, -1, dtype=np.int32)
    closed = np.zeros(size + 1, dtype=np.bool_)
    slack = 0.14 * end_hops.max()  # octile is at most 1.14 times the straight distance
    heap = [(0.0, 0.0, np.int64(-1))]
    heap.pop()
    point = np.empty(3)
    for n in range(starts.shape[0]):
        flat = starts[n]
        cost[flat] = start_hops[n]
        heapq.heappush(heap, (start_hops[n], 0.0, flat))
    while len(heap) > 0:
        _, _, flat = heapq.heappop(heap)
        if closed[flat]:
            continue
        closed[flat] = True
        if flat == size:
            break
        i, j, k = flat // (shape[1] * shape[2]), flat // shape[2] % shape[1], flat % shape[2]
        if tested[flat] == _PASSABLE_END:
            hop = end_hops[np.searchsorted(ends, flat)]
            if cost[flat] + hop < cost[size]:
                cost[size] = cost[flat] + hop
                parent[size] = flat
                heapq.heappush(heap, (cost[size], 0.0, np.int64(size)))
        for di in range(-1, 2):
            for dj in range(-1, 2):
                for dk in range(-1, 2):
                    ni, nj, nk = i + di, j + dj, k + dk
                    if not (0 <= ni < shape[0] and 0 <= nj < shape[1] and 0 <= nk < shape[2]):
                        continue
                    near = (ni * shape[1] + nj) * shape[2] + nk
                    if closed[near]:
                        continue
                    longer = cost[flat] + cell * math.sqrt(float(di * di + dj * dj + dk * dk))
                    if longer >= cost[near]:
                        continue
                    point[0] = low[0] + (ni + 0.5) * cell
                    point[1] = low[1] + (nj + 0.5) * cell
                    point[2] = low[2] + (nk + 0.5) * cell
                    if not _is_passable(grid, tested, near, point, radius):
                        continue
                    cost[near] = longer
                    parent[near] = flat
                    ahead = _octile(point[0] - target[0], point[1] - target[1], point[2] - target[2])
                    ahead = max(ahead - slack, bound[near // shape[2]])
                    heapq.heappush(heap, (longer + ahead, ahead, np.int64(near)))
    if not closed[size]:
        return np.empty((0, 3))
    path: Float = _trace(parent, size, low, cell, shape, start, target)
    return path


@nb.njit(cache=True)
def _trace(parent: Int, size: int, low: Float, cell: float, shape: Int, start: Float, target: Float) -> Float:
    count = 0
    flat = parent[size]
    while flat >= 0:
        count += 1
        flat = parent[flat]
    path = np.empty((count + 2, 3))
    path[0], path[count + 1] = start, target
    flat = parent[size]
    for n in range(count, 0, -1):
        path[n, 0] = low[0] + (flat // (shape[1] * shape[2]) + 0.5) * cell
        path[n, 1] = low[1] + (flat // shape[2] % shape[1] + 0.5) * cell
        path[n, 2] = low[2] + (flat % shape[2] + 0.5) * cell
        flat = parent[flat]
    return path


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
