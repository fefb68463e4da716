"""Exact shortest lattice paths among triangles (numba).

Nodes are the centres of cubes that fill the flight bounds; a node is passable when no
triangle comes nearer than `radius`.

Clearance between nodes: for a point o and the midpoint m of a and b with |a - b| = 2h,
|m - o|² = (|a - o|² + |b - o|²)/2 - h². So balls of radius² = clearance² + h² free of
triangles at both ends prove `clearance` along the whole segment; `proof_radius_m` is that.
"""

from __future__ import annotations

import heapq
import math
from typing import NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Bool, Float, Int, Int32, UInt8
from uavexp.triangle_grid import TriangleGrid, ball_meets_mesh, box_meets_mesh, squared_distance_to_triangle
from uavexp.world.line_of_sight import in_sight

_BLOCKED, _PASSABLE, _PASSABLE_END = 0, 1, 2


class Nodes(NamedTuple):
    """A lattice among triangles."""

    grid: TriangleGrid
    low: Float  # (3,) lower corner of the flight bounds, m
    cell: float  # spacing, m
    shape: Int  # (3,) nodes along each axis
    radius: float  # of the free ball that a node needs, m


def make_nodes(grid: TriangleGrid, bounds_m: Float, cell_m: float, radius_m: float = 0.0) -> Nodes:
    """The lattice that fills the bounds (2, 3)."""
    count: Int = np.floor((bounds_m[1] - bounds_m[0]) / cell_m + 1e-9).astype(np.int64)
    return Nodes(grid, bounds_m[0], cell_m, np.maximum(1, count), radius_m)


def proof_radius_m(clearance_m: float, longest_edge_m: float) -> float:
    """Radius of free balls at both ends of an edge that proves `clearance_m` along it."""
    return math.sqrt(clearance_m**2 + 0.25 * longest_edge_m**2)


@nb.njit(cache=True)
def passable_layer(nodes: Nodes, height: float) -> Bool:
    """Which nodes (X, Y), moved to one height, are passable."""
    layer = np.empty((nodes.shape[0], nodes.shape[1]), dtype=np.bool_)
    point = np.empty(3)
    for i in range(nodes.shape[0]):
        for j in range(nodes.shape[1]):
            _put(nodes, i, j, 0, point)
            point[2] = height
            layer[i, j] = not ball_meets_mesh(nodes.grid, point, nodes.radius)
    return layer


@nb.njit(cache=True)
def empty_columns(nodes: Nodes, height: float, half: Float) -> Bool:
    """Which upright boxes (X, Y), of half lengths `half` (3,), one a cell, meet no triangle."""
    empty = np.empty((nodes.shape[0], nodes.shape[1]), dtype=np.bool_)
    centre, upright = np.empty(3), np.eye(3)
    for i in range(nodes.shape[0]):
        for j in range(nodes.shape[1]):
            _put(nodes, i, j, 0, centre)
            centre[2] = height
            empty[i, j] = not box_meets_mesh(nodes.grid, centre, upright, half)
    return empty


@nb.njit(cache=True)
def _octile(dx: float, dy: float, dz: float) -> float:
    """Length of the shortest 26-connected path over (dx, dy, dz) in empty space."""
    a, b, c = abs(dx), abs(dy), abs(dz)
    largest = max(a, b, c)
    smallest = min(a, b, c)
    middle = a + b + c - largest - smallest
    return largest + (math.sqrt(2.0) - 1.0) * middle + (math.sqrt(3.0) - math.sqrt(2.0)) * smallest


@nb.njit(cache=True, inline="always")
def _put(nodes: Nodes, i: int, j: int, k: int, point: Float) -> None:
    """Write a node's place into `point` (3,)."""
    point[0] = nodes.low[0] + (i + 0.5) * nodes.cell
    point[1] = nodes.low[1] + (j + 0.5) * nodes.cell
    point[2] = nodes.low[2] + (k + 0.5) * nodes.cell


@nb.njit(cache=True, inline="always")
def _flat(nodes: Nodes, i: int, j: int, k: int) -> int:
    """Number of a node; -1 outside the lattice."""
    if 0 <= i < nodes.shape[0] and 0 <= j < nodes.shape[1] and 0 <= k < nodes.shape[2]:
        return int((i * nodes.shape[1] + j) * nodes.shape[2] + k)
    return -1


@nb.njit(cache=True)
def passable_nodes(nodes: Nodes) -> UInt8:
    """Which nodes, in flat order, are passable: triangle by triangle, those near it are not."""
    kind = np.full(nodes.shape[0] * nodes.shape[1] * nodes.shape[2], _PASSABLE, dtype=np.uint8)
    first, last, point = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64), np.empty(3)
    for item in range(nodes.grid.corners_m.shape[0]):
        corner = nodes.grid.corners_m[item]
        for axis in range(3):  # the nodes within the radius of its box, and a rounding
            low = (corner[:, axis].min() - nodes.radius - nodes.low[axis]) / nodes.cell - 0.5
            high = (corner[:, axis].max() + nodes.radius - nodes.low[axis]) / nodes.cell - 0.5
            first[axis] = max(math.ceil(low - 1e-9), 0)
            last[axis] = min(math.floor(high + 1e-9), nodes.shape[axis] - 1)
        for i in range(first[0], last[0] + 1):
            for j in range(first[1], last[1] + 1):
                row = (i * nodes.shape[1] + j) * nodes.shape[2]
                for k in range(first[2], last[2] + 1):
                    if kind[row + k] == _BLOCKED:
                        continue
                    _put(nodes, i, j, k, point)
                    if squared_distance_to_triangle(corner, point) < nodes.radius**2:
                        kind[row + k] = _BLOCKED
    return kind


@nb.njit(cache=True)
def _entries(nodes: Nodes, clearance: float, kind: UInt8, end: Float) -> tuple[Int, Float]:
    """Nodes around an end point that can be flown to straight, ascending, and how far each is.

    The node at the point itself when there is one; else those within two cells.
    """
    found = np.empty(125, dtype=np.int64)
    hops = np.empty(125)
    count = 0
    point = np.empty(3)
    base = np.empty(3, dtype=np.int64)
    for axis in range(3):
        base[axis] = math.floor((end[axis] - nodes.low[axis]) / nodes.cell)
    for i in range(base[0] - 2, base[0] + 3):
        for j in range(base[1] - 2, base[1] + 3):
            for k in range(base[2] - 2, base[2] + 3):
                flat = _flat(nodes, i, j, k)
                if flat < 0 or kind[flat] == _BLOCKED:
                    continue
                _put(nodes, i, j, k, point)
                hop = math.sqrt(
                    (point[0] - end[0]) ** 2 + (point[1] - end[1]) ** 2 + (point[2] - end[2]) ** 2
                )
                if hop < 1e-6 * nodes.cell:
                    return np.array([flat]), np.array([0.0])
                if in_sight(nodes.grid, point, end, clearance):
                    found[count], hops[count] = flat, hop
                    count += 1
    return found[:count], hops[:count]


@nb.njit(cache=True)
def _column_bound(nodes: Nodes, kind: UInt8, starts: Int, ends: Int) -> Float:
    """Lower bound (X * Y,) of the path length from each column to the nearest end node.

    Dijkstra over columns that hold a passable node, 8-connected, from the ends until every
    start has been reached: a path's shadow on the plane is never longer than the path.
    Columns beyond get the distance at which the search stopped; all are inf when a start's
    column cannot be reached.
    """
    wide, high = nodes.shape[1], nodes.shape[2]
    bound = np.full(nodes.shape[0] * wide, np.inf)
    closed = np.zeros(bound.shape[0], dtype=np.bool_)
    wanted = np.zeros(bound.shape[0], dtype=np.bool_)
    heap = [(0.0, 0.0, np.int64(0))]  # the same type as the search's: compiled once
    heap.pop()
    for column in ends // high:
        if bound[column] > 0.0:
            bound[column] = 0.0
            heapq.heappush(heap, (0.0, 0.0, column))
    for column in starts // high:
        wanted[column] = True
    missing = wanted.sum()
    stopped = np.inf
    while len(heap) > 0 and missing > 0:
        stopped, _, column = heapq.heappop(heap)
        if closed[column]:
            continue
        closed[column] = True
        missing -= wanted[column]
        i, j = column // wide, column % wide
        for di in range(-1, 2):
            for dj in range(-1, 2):
                if _flat(nodes, i + di, j + dj, 0) < 0:
                    continue
                near = (i + di) * wide + j + dj
                longer = bound[column] + nodes.cell * math.sqrt(float(di * di + dj * dj))
                if longer < bound[near] and kind[near * high : (near + 1) * high].any():
                    bound[near] = longer
                    heapq.heappush(heap, (longer, 0.0, near))
    return np.where(closed, bound, np.inf if missing > 0 else stopped)


@nb.njit(cache=True)
def shortest_lattice_path(nodes: Nodes, clearance: float, start: Float, target: Float) -> Float:
    """Shortest path (P, 3) from start to target over passable nodes, 26-connected; A*.

    Exact on the lattice. The heuristic is the larger of two lower bounds: the octile distance,
    less what the last hop, off the lattice, can save; and the shortest path's shadow on the
    plane (`_column_bound`), which knows the walls. Ties go to the node with less ahead of it,
    then to the lower index.

    Args:
        nodes: the lattice.
        clearance: that the hops between the ends and their nearest nodes need, m.
        start: (3,).
        target: (3,).

    Returns:
        The path, ends included; (0, 3) when there is none.
    """
    kind = passable_nodes(nodes)
    ends, end_hops = _entries(nodes, clearance, kind, target)
    starts, start_hops = _entries(nodes, clearance, kind, start)
    if starts.shape[0] == 0 or ends.shape[0] == 0:
        return np.empty((0, 3))
    bound = _column_bound(nodes, kind, starts, ends)
    if bound[starts[0] // nodes.shape[2]] == np.inf:
        return np.empty((0, 3))
    for flat in ends:
        kind[flat] = _PASSABLE_END
    parent = _search(nodes, kind, bound, starts, start_hops, ends, end_hops, target)
    if parent[-1] < 0:
        return np.empty((0, 3))
    path: Float = _trace(nodes, parent, start, target)
    return path


@nb.njit(cache=True)
def _search(
    nodes: Nodes, kind: UInt8, bound: Float, starts: Int, start_hops: Float, ends: Int, end_hops: Float,
    target: Float,
) -> Int32:  # fmt: skip
    """Parent (size + 1,) of each node that the search reached, -1 of the others; the last is the target."""
    size = np.int64(kind.shape[0])
    cost = np.full(size + 1, np.inf)
    parent = np.full(size + 1, -1, dtype=np.int32)
    closed = np.append(kind == _BLOCKED, False)
    # numbers of their own: to hand `nodes` on costs more than to use them
    (deep, wide, high), (low_x, low_y, low_z), cell = nodes.shape, nodes.low, nodes.cell
    edge = np.empty(27)
    for step in range(27):
        apart = (step // 9 - 1) ** 2 + (step // 3 % 3 - 1) ** 2 + (step % 3 - 1) ** 2
        edge[step] = cell * math.sqrt(float(apart))
    slack = 0.14 * end_hops.max()  # octile is at most 1.14 times the straight distance
    heap = [(0.0, 0.0, np.int64(-1))]
    heap.pop()
    for n in range(starts.shape[0]):
        cost[starts[n]] = start_hops[n]
        heapq.heappush(heap, (start_hops[n], 0.0, starts[n]))
    while len(heap) > 0:
        _, _, flat = heapq.heappop(heap)
        if closed[flat]:
            continue
        closed[flat] = True
        if flat == size:
            break
        if kind[flat] == _PASSABLE_END:
            hop = end_hops[np.searchsorted(ends, flat)]
            if cost[flat] + hop < cost[size]:
                cost[size] = cost[flat] + hop
                parent[size] = flat
                heapq.heappush(heap, (float(cost[size]), 0.0, size))
        i, j, k = flat // (wide * high), flat // high % wide, flat % high
        for step in range(27):
            x, y, z = i + step // 9 - 1, j + step // 3 % 3 - 1, k + step % 3 - 1
            near = (x * wide + y) * high + z
            if not (0 <= x < deep and 0 <= y < wide and 0 <= z < high) or closed[near]:
                continue
            longer = cost[flat] + edge[step]
            if longer >= cost[near]:
                continue
            cost[near] = longer
            parent[near] = flat
            place = low_x + (x + 0.5) * cell, low_y + (y + 0.5) * cell, low_z + (z + 0.5) * cell
            ahead = _octile(place[0] - target[0], place[1] - target[1], place[2] - target[2])
            ahead = max(ahead - slack, bound[near // high])
            heapq.heappush(heap, (longer + ahead, ahead, np.int64(near)))
    return parent


@nb.njit(cache=True, inline="always")
def _index(nodes: Nodes, flat: int) -> tuple[int, int, int]:
    wide, high = nodes.shape[1], nodes.shape[2]
    return flat // (wide * high), flat // high % wide, flat % high


@nb.njit(cache=True)
def _trace(nodes: Nodes, parent: Int32, start: Float, target: Float) -> Float:
    """Path (P, 3) that leads to the last node."""
    count = 0
    flat = parent[-1]
    while flat >= 0:
        count += 1
        flat = parent[flat]
    path = np.empty((count + 2, 3))
    path[0], path[count + 1] = start, target
    flat = parent[-1]
    for n in range(count, 0, -1):
        i, j, k = _index(nodes, flat)
        _put(nodes, i, j, k, path[n])
        flat = parent[flat]
    return path
