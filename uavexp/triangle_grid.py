"""Exact overlap of a box or a ball with a triangle mesh (numba).

The mesh is cut into a uniform grid of cells, each with the list of the triangles that
reach into it, in compressed rows: cell c holds `items[starts[c]:starts[c + 1]]`, in
ascending order. A query visits the few cells its bounding box covers. A triangle that is
large against a cell (a floor) is listed only in the cells it really cuts, so that a tilted
roof does not fill its whole bounding box.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Float, Float32, Int, Int32

CELL_M = 0.4  # about the size of a body, so that a query visits 8 to 27 cells
MAX_CELLS = 4_000_000  # a larger world gets larger cells
ALWAYS_LIST_CELLS = 8  # a triangle whose bounding box spans no more is listed without a test


class TriangleGrid(NamedTuple):
    """Triangles and, per cell, which of them reach into it."""

    corners_m: Float  # (F, 3, 3) a triangle's corners in rows
    origin_m: Float  # (3,) lower corner of cell (0, 0, 0)
    cell_m: float
    shape: Int  # (3,)
    starts: Int  # (X * Y * Z + 1,)
    items: Int32  # (starts[-1],)


def build(vertices_m: Float32, triangles: Int32) -> TriangleGrid:
    """Return the grid of a mesh with at least one triangle; the same mesh gives the same grid."""
    corners = np.ascontiguousarray(vertices_m[triangles], dtype=np.float64)
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    cell = CELL_M
    shape = _shape(low, high, cell)
    while int(np.prod(shape)) > MAX_CELLS:
        cell *= 1.25
        shape = _shape(low, high, cell)
    counts = np.zeros(int(np.prod(shape)) + 1, dtype=np.int64)
    nothing = np.empty(0, dtype=np.int32)
    _list_triangles(corners, low, cell, shape, counts, nothing)
    starts = np.cumsum(counts)
    items = np.empty(int(starts[-1]), dtype=np.int32)
    _list_triangles(corners, low, cell, shape, starts.copy(), items)
    return TriangleGrid(corners, low, cell, shape, starts, items)


def _shape(low: Float, high: Float, cell_m: float) -> Int:
    return np.maximum(1, np.floor((high - low) / cell_m).astype(np.int64) + 1)


@nb.njit(cache=True)
def _list_triangles(
    corners: Float, origin: Float, cell: float, shape: Int, cursor: Int, items: Int32
) -> None:
    """Count per cell into cursor[1:] (no items), or write items where cursor points, advancing it."""
    counting = items.shape[0] == 0
    centre = np.empty(3)
    half = np.full(3, 0.5 * cell * (1.0 + 1e-9) + 1e-9)
    identity = np.eye(3)
    low = np.empty(3, dtype=np.int64)
    high = np.empty(3, dtype=np.int64)
    for f in range(corners.shape[0]):
        spans = 1
        for axis in range(3):
            a, b, c = corners[f, 0, axis], corners[f, 1, axis], corners[f, 2, axis]
            low[axis] = _cell_of(min(a, b, c), origin[axis], cell, shape[axis])
            high[axis] = _cell_of(max(a, b, c), origin[axis], cell, shape[axis])
            spans *= high[axis] - low[axis] + 1
        for i in range(low[0], high[0] + 1):
            for j in range(low[1], high[1] + 1):
                for k in range(low[2], high[2] + 1):
                    if spans > ALWAYS_LIST_CELLS:
                        centre[0] = origin[0] + (i + 0.5) * cell
                        centre[1] = origin[1] + (j + 0.5) * cell
                        centre[2] = origin[2] + (k + 0.5) * cell
                        if not box_meets_triangle(corners[f], centre, identity, half):
                            continue
                    flat = (i * shape[1] + j) * shape[2] + k
                    if counting:
                        cursor[flat + 1] += 1
                    else:
                        items[cursor[flat]] = f
                        cursor[flat] += 1


@nb.njit(cache=True)
def _cell_of(coordinate: float, origin: float, cell: float, count: int) -> int:
    return min(max(int(np.floor((coordinate - origin) / cell)), 0), count - 1)


@nb.njit(cache=True)
def box_meets_triangle(corner: Float, centre: Float, rotation: Float, half: Float) -> bool:
    """Whether a closed box meets a closed triangle: the 13 axes of the separating axis theorem.

    Args:
        corner: the triangle's corners (3, 3), a row each.
        centre: of the box (3,).
        rotation: box to world (3, 3).
        half: the box's half lengths (3,).

    Source: Akenine-Möller 2001, "Fast 3D triangle-box overlap testing".
    """
    v = np.empty((3, 3))  # corners in the box's frame
    for n in range(3):
        dx, dy, dz = corner[n, 0] - centre[0], corner[n, 1] - centre[1], corner[n, 2] - centre[2]
        for axis in range(3):
            v[n, axis] = rotation[0, axis] * dx + rotation[1, axis] * dy + rotation[2, axis] * dz
    for axis in range(3):  # the box's own three axes
        if min(v[0, axis], v[1, axis], v[2, axis]) > half[axis]:
            return False
        if max(v[0, axis], v[1, axis], v[2, axis]) < -half[axis]:
            return False
    for n in range(3):  # each box axis crossed with each edge: 9 axes
        m, o = (n + 1) % 3, (n + 2) % 3
        ex, ey, ez = v[m, 0] - v[n, 0], v[m, 1] - v[n, 1], v[m, 2] - v[n, 2]
        # along an axis perpendicular to the edge both its ends project to one value
        p, q = ey * v[n, 2] - ez * v[n, 1], ey * v[o, 2] - ez * v[o, 1]
        reach = half[1] * abs(ez) + half[2] * abs(ey)
        if min(p, q) > reach or max(p, q) < -reach:
            return False
        p, q = ez * v[n, 0] - ex * v[n, 2], ez * v[o, 0] - ex * v[o, 2]
        reach = half[0] * abs(ez) + half[2] * abs(ex)
        if min(p, q) > reach or max(p, q) < -reach:
            return False
        p, q = ex * v[n, 1] - ey * v[n, 0], ex * v[o, 1] - ey * v[o, 0]
        reach = half[0] * abs(ey) + half[1] * abs(ex)
        if min(p, q) > reach or max(p, q) < -reach:
            return False
    ax, ay, az = v[1, 0] - v[0, 0], v[1, 1] - v[0, 1], v[1, 2] - v[0, 2]  # the triangle's normal
    bx, by, bz = v[2, 0] - v[0, 0], v[2, 1] - v[0, 1], v[2, 2] - v[0, 2]
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    offset = abs(nx * v[0, 0] + ny * v[0, 1] + nz * v[0, 2])
    return bool(offset <= half[0] * abs(nx) + half[1] * abs(ny) + half[2] * abs(nz))


@nb.njit(cache=True)
def box_meets_mesh(grid: TriangleGrid, centre: Float, rotation: Float, half: Float) -> bool:
    """Whether a closed oriented box meets any triangle; arguments as `box_meets_triangle`."""
    low = np.empty(3)
    high = np.empty(3)
    for axis in range(3):
        reach = (
            abs(rotation[axis, 0]) * half[0]
            + abs(rotation[axis, 1]) * half[1]
            + abs(rotation[axis, 2]) * half[2]
        )
        low[axis], high[axis] = centre[axis] - reach, centre[axis] + reach
    starts, items, corners = grid.starts, grid.items, grid.corners_m
    (first_i, end_i), (first_j, end_j) = _span(grid, low, high, 0), _span(grid, low, high, 1)
    first_k, end_k = _span(grid, low, high, 2)
    wide, deep = grid.shape[1], grid.shape[2]
    for i in range(first_i, end_i):
        for j in range(first_j, end_j):
            row = (i * wide + j) * deep
            for item in range(starts[row + first_k], starts[row + end_k]):
                corner = corners[items[item]]
                if _is_near(corner, low, high) and box_meets_triangle(corner, centre, rotation, half):
                    return True
    return False


@nb.njit(cache=True)
def ball_meets_mesh(grid: TriangleGrid, centre: Float, radius: float) -> bool:
    """Whether some triangle comes nearer to the centre (3,) than `radius`."""
    low = centre - radius
    high = centre + radius
    starts, items, corners = grid.starts, grid.items, grid.corners_m
    (first_i, end_i), (first_j, end_j) = _span(grid, low, high, 0), _span(grid, low, high, 1)
    first_k, end_k = _span(grid, low, high, 2)
    wide, deep = grid.shape[1], grid.shape[2]
    for i in range(first_i, end_i):
        for j in range(first_j, end_j):
            row = (i * wide + j) * deep
            for item in range(starts[row + first_k], starts[row + end_k]):
                corner = corners[items[item]]
                if _is_near(corner, low, high) and squared_distance_to_triangle(corner, centre) < radius**2:
                    return True
    return False


@nb.njit(cache=True)
def _span(grid: TriangleGrid, low: Float, high: Float, axis: int) -> tuple[int, int]:
    """First cell that an interval covers along one axis, and the one after the last; outside: none."""
    origin, cell, count = grid.origin_m[axis], grid.cell_m, grid.shape[axis]
    if high[axis] < origin or low[axis] > origin + count * cell:
        return 0, 0
    return _cell_of(low[axis], origin, cell, count), _cell_of(high[axis], origin, cell, count) + 1


@nb.njit(cache=True)
def _is_near(corner: Float, low: Float, high: Float) -> bool:
    """Whether a triangle's bounding box meets [low, high]."""
    for axis in range(3):
        a, b, c = corner[0, axis], corner[1, axis], corner[2, axis]
        if min(a, b, c) > high[axis] or max(a, b, c) < low[axis]:
            return False
    return True


@nb.njit(cache=True)
def squared_distance_to_triangle(corner: Float, point: Float) -> float:
    """Squared distance of a point (3,) to a triangle with corner rows (3, 3).

    Source: Ericson 2005, "Real-Time Collision Detection", section 5.1.5.
    """
    abx, aby, abz = corner[1, 0] - corner[0, 0], corner[1, 1] - corner[0, 1], corner[1, 2] - corner[0, 2]
    acx, acy, acz = corner[2, 0] - corner[0, 0], corner[2, 1] - corner[0, 1], corner[2, 2] - corner[0, 2]
    apx, apy, apz = point[0] - corner[0, 0], point[1] - corner[0, 1], point[2] - corner[0, 2]
    d1 = abx * apx + aby * apy + abz * apz
    d2 = acx * apx + acy * apy + acz * apz
    bpx, bpy, bpz = apx - abx, apy - aby, apz - abz
    d3 = abx * bpx + aby * bpy + abz * bpz
    d4 = acx * bpx + acy * bpy + acz * bpz
    cpx, cpy, cpz = apx - acx, apy - acy, apz - acz
    d5 = abx * cpx + aby * cpy + abz * cpz
    d6 = acx * cpx + acy * cpy + acz * cpz
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0.0 and d2 <= 0.0:  # nearest to corner a
        v, w = 0.0, 0.0
    elif d3 >= 0.0 and d4 <= d3:  # corner b
        v, w = 1.0, 0.0
    elif d6 >= 0.0 and d5 <= d6:  # corner c
        v, w = 0.0, 1.0
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:  # edge ab
        v, w = (d1 / (d1 - d3) if d1 > d3 else 0.0), 0.0
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:  # edge ac
        v, w = 0.0, (d2 / (d2 - d6) if d2 > d6 else 0.0)
    elif va <= 0.0 and d4 >= d3 and d5 >= d6:  # edge bc
        span = (d4 - d3) + (d5 - d6)
        w = (d4 - d3) / span if span > 0.0 else 0.0
        v = 1.0 - w
    else:  # the inside
        v, w = vb / (va + vb + vc), vc / (va + vb + vc)
    x, y, z = apx - v * abx - w * acx, apy - v * aby - w * acy, apz - v * abz - w * acz
    return float(x * x + y * y + z * z)
