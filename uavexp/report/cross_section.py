"""A horizontal section of the true geometry as an image: what stands at flight height."""

from __future__ import annotations

from dataclasses import dataclass

import numba as nb
import numpy as np
from scipy import ndimage

from uavexp.arrays import Float, UInt8
from uavexp.types import World

OPEN, SOLID, SURFACE = 0, 1, 2  # values of `Section.cells`


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """What the mesh covers of the ground plan, between two heights."""

    cells: UInt8  # (X, Y): OPEN, SOLID or SURFACE
    lower_m: Float  # (2,) corner of cell (0, 0)
    upper_m: Float  # (2,)
    heights_m: tuple[float, float]


def cut(world: World, heights_m: tuple[float, float], visited_m: Float, cell_m: float) -> Section:
    """Return the plan view of everything between two heights.

    A cell is SURFACE where the mesh passes through it between the heights, OPEN where it
    joins up with a visited place around surfaces, and SOLID otherwise: the inside of an
    obstacle, or a space shut off at this height. That needs no closed mesh.

    Args:
        world: true geometry.
        heights_m: lower and upper end of the slab, m.
        visited_m: places (N, 3) known to be free, such as the flown path.
        cell_m: edge of a cell, m.
    """
    lower_m, upper_m = world.bounds_m[0, :2], world.bounds_m[1, :2]
    shape = np.maximum(np.ceil((upper_m - lower_m) / cell_m).astype(int), 1)
    cells = np.zeros(tuple(shape), dtype=np.uint8)
    _stamp(
        np.ascontiguousarray(world.vertices_m, dtype=np.float64),
        world.triangles.astype(np.int64),
        np.array(heights_m),
        lower_m,
        cell_m,
        cells,
    )
    _fill(cells, _cell_of(visited_m, lower_m, cell_m, cells.shape))
    return Section(cells=cells, lower_m=lower_m, upper_m=lower_m + shape * cell_m, heights_m=heights_m)


def _cell_of(points_m: Float, lower_m: Float, cell_m: float, shape: tuple[int, ...]) -> np.ndarray:
    """Cells (N, 2) of the points that lie on the image."""
    index = np.floor((points_m[:, :2] - lower_m) / cell_m).astype(int)
    return index[np.all((index >= 0) & (index < shape), axis=1)]


def _fill(cells: UInt8, visited: np.ndarray) -> None:
    """Mark SOLID whatever is no surface and does not join up with a visited cell."""
    labels, _ = ndimage.label(cells != SURFACE)
    reached = np.unique(labels[visited[:, 0], visited[:, 1]])
    solid = ~np.isin(labels, reached[reached > 0]) & (labels > 0)
    cells[solid] = SOLID


@nb.njit(cache=True)
def _stamp(
    vertices_m: Float,
    triangles: np.ndarray,
    heights_m: Float,
    lower_m: Float,
    cell_m: float,
    cells: UInt8,
) -> None:
    """Mark SURFACE every cell under the part of a triangle between the two heights."""
    polygon = np.empty((8, 3))
    clipped = np.empty((8, 3))
    for f in range(triangles.shape[0]):
        for corner in range(3):
            polygon[corner] = vertices_m[triangles[f, corner]]
        low = min(polygon[0, 2], polygon[1, 2], polygon[2, 2])
        high = max(polygon[0, 2], polygon[1, 2], polygon[2, 2])
        if not (low <= heights_m[1] and high >= heights_m[0]):
            continue
        count = _clip(polygon, 3, heights_m[0], 1.0, clipped)
        count = _clip(clipped, count, heights_m[1], -1.0, polygon)
        for n in range(count):  # to cells
            polygon[n, 0] = (polygon[n, 0] - lower_m[0]) / cell_m
            polygon[n, 1] = (polygon[n, 1] - lower_m[1]) / cell_m
        _stamp_outline(polygon, count, cells)
        _stamp_inside(polygon, count, cells)


@nb.njit(cache=True)
def _clip(polygon: Float, count: int, height_m: float, side: float, out: Float) -> int:
    """Keep of a convex polygon what lies above (side 1) or below (-1) a height; Sutherland-Hodgman."""
    kept = 0
    for n in range(count):
        here, after = polygon[n], polygon[(n + 1) % count]
        here_m, after_m = side * (here[2] - height_m), side * (after[2] - height_m)
        if here_m >= 0.0:
            out[kept] = here
            kept += 1
        if (here_m > 0.0 and after_m < 0.0) or (here_m < 0.0 and after_m > 0.0):
            out[kept] = here + (after - here) * (here_m / (here_m - after_m))
            kept += 1
    return kept


@nb.njit(cache=True)
def _stamp_outline(polygon: Float, count: int, cells: UInt8) -> None:
    """Mark the cells along the edges, in steps of half a cell."""
    for n in range(count):
        x0, y0 = polygon[n, 0], polygon[n, 1]
        dx, dy = polygon[(n + 1) % count, 0] - x0, polygon[(n + 1) % count, 1] - y0
        steps = int(2.0 * max(abs(dx), abs(dy))) + 1
        for step in range(steps + 1):
            i = int(np.floor(x0 + dx * step / steps))
            j = int(np.floor(y0 + dy * step / steps))
            if 0 <= i < cells.shape[0] and 0 <= j < cells.shape[1]:
                cells[i, j] = 2


@nb.njit(cache=True)
def _stamp_inside(polygon: Float, count: int, cells: UInt8) -> None:
    """Mark the cells whose centre is inside: per row of cells, between the crossings of its edges."""
    if count < 3:
        return
    first = max(int(np.floor(polygon[:count, 0].min())), 0)
    last = min(int(np.floor(polygon[:count, 0].max())), cells.shape[0] - 1)
    for i in range(first, last + 1):
        x = i + 0.5
        enter, leave = np.inf, -np.inf
        for n in range(count):
            x0, y0 = polygon[n, 0], polygon[n, 1]
            x1, y1 = polygon[(n + 1) % count, 0], polygon[(n + 1) % count, 1]
            if (x0 <= x) != (x1 <= x):
                y = y0 + (y1 - y0) * (x - x0) / (x1 - x0)
                enter, leave = min(enter, y), max(leave, y)
        if enter <= leave:
            for j in range(
                max(int(np.ceil(enter - 0.5)), 0), min(int(np.floor(leave - 0.5)), cells.shape[1] - 1) + 1
            ):
                cells[i, j] = 2
