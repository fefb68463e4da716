"""Generalised winding number of a mesh around points (numba)."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from uavexp.arrays import Float, Float32, Int32


@nb.njit(cache=True)
def winding_numbers(vertices: Float32, triangles: Int32, points: Float) -> Float:
    """Solid angle (N,), over 4π, that the triangles' front and back sides fill around points (N, 3).

    1 inside a closed surface with outward normals, 0 outside; between where it has holes.

    Source: Jacobson, Kavan and Sorkine-Hornung 2013, equation 5; the solid angle by van Oosterom
    and Strackee 1983.
    """
    total = np.zeros(points.shape[0])
    for n in range(points.shape[0]):
        x, y, z = points[n]
        angle = 0.0
        for t in range(triangles.shape[0]):
            p, q, r = triangles[t]
            ax, ay, az = vertices[p, 0] - x, vertices[p, 1] - y, vertices[p, 2] - z
            bx, by, bz = vertices[q, 0] - x, vertices[q, 1] - y, vertices[q, 2] - z
            cx, cy, cz = vertices[r, 0] - x, vertices[r, 1] - y, vertices[r, 2] - z
            a = math.sqrt(ax * ax + ay * ay + az * az)
            b = math.sqrt(bx * bx + by * by + bz * bz)
            c = math.sqrt(cx * cx + cy * cy + cz * cz)
            volume = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
            ab, bc, ca = ax * bx + ay * by + az * bz, bx * cx + by * cy + bz * cz, cx * ax + cy * ay + cz * az
            angle += math.atan2(volume, a * b * c + ab * c + bc * a + ca * b)
        total[n] = angle / (2.0 * math.pi)
    return total
