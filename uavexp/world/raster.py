"""Cells of a grid that triangles enter (numba)."""

from __future__ import annotations

import numba as nb
import numpy as np

from uavexp.arrays import Bool, Float, Float32, Int, Int32
from uavexp.triangle_grid import box_meets_triangle


@nb.njit(cache=True)
def rasterise(vertices: Float32, triangles: Int32, low: Float, cell: float, shape: Int) -> Bool:
    """Cells (X, Y, Z) that a triangle enters, exact (separating axes).

    One that it enters by less than a thousandth of the cell's size is left out, and a surface
    between two cells fills the upper.
    """
    occupied = np.zeros((shape[0], shape[1], shape[2]), dtype=np.bool_)
    upright, half = np.eye(3), np.full(3, 0.501 * cell)
    corner, centre = np.empty((3, 3)), np.empty(3)
    first, last = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    for t in range(triangles.shape[0]):
        for n in range(3):
            for axis in range(3):
                corner[n, axis] = vertices[triangles[t, n], axis]
        for axis in range(3):
            least, most = corner[:, axis].min(), corner[:, axis].max()
            first[axis] = max(int(np.floor((least - low[axis]) / cell + 0.001)), 0)
            end = max(int(np.ceil((most - low[axis]) / cell - 0.001)) - 1, first[axis])
            last[axis] = min(end, shape[axis] - 1)
        for i in range(first[0], last[0] + 1):
            centre[0] = low[0] + (i + 0.5) * cell
            for j in range(first[1], last[1] + 1):
                centre[1] = low[1] + (j + 0.5) * cell
                for k in range(first[2], last[2] + 1):
                    if occupied[i, j, k]:
                        continue
                    centre[2] = low[2] + (k + 0.5) * cell
                    occupied[i, j, k] = box_meets_triangle(corner, centre, upright, half)
    return occupied
