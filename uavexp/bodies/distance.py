"""Distances of points to moving bodies (numba, float64)."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from uavexp.arrays import Bool, Float, Float32, UInt8
from uavexp.types import Bodies, Shape

ABSENT_M = np.array([0.0, 0.0, -1000.0])  # where a body is while it is not there
LOWEST_M = -500.0  # a body below is not there
_SPHERE, _CYLINDER = int(Shape.SPHERE), int(Shape.CYLINDER)


def present(position_m: Float | Float32) -> Bool:
    """Which bodies (...,) at positions (..., 3) are there at all, and not at `ABSENT_M`."""
    return position_m[..., 2] > LOWEST_M


@nb.njit(cache=True)
def _signed_distance(shape: int, half: Float, dx: float, dy: float, dz: float) -> float:
    """Signed distance of a point at (dx, dy, dz) from a body's centre to its surface, - inside."""
    if shape == _SPHERE:
        return float(math.sqrt(dx * dx + dy * dy + dz * dz) - half[0])
    if shape == _CYLINDER:
        radial, axial = math.hypot(dx, dy) - half[0], abs(dz) - half[2]
        outside = math.hypot(max(radial, 0.0), max(axial, 0.0))
        return float(outside + min(max(radial, axial), 0.0))
    qx, qy, qz = abs(dx) - half[0], abs(dy) - half[1], abs(dz) - half[2]
    outside = math.sqrt(max(qx, 0.0) ** 2 + max(qy, 0.0) ** 2 + max(qz, 0.0) ** 2)
    return float(outside + min(max(qx, max(qy, qz)), 0.0))


@nb.njit(cache=True)
def _nearest(shape: UInt8, half: Float, centre: Float, points: Float) -> Float:
    distance = np.full(points.shape[0], np.inf)
    for n in range(points.shape[0]):
        for b in range(shape.shape[0]):
            d = _signed_distance(
                shape[b],
                half[b],
                points[n, 0] - centre[b, 0],
                points[n, 1] - centre[b, 1],
                points[n, 2] - centre[b, 2],
            )
            distance[n] = min(distance[n], d)
    return distance


def distance_m(bodies: Bodies, points_m: Float) -> Float:
    """Distance (N,) of points (N, 3) to the nearest body's surface, m; 0 inside one, inf without any."""
    signed: Float = _nearest(bodies.shape, bodies.half_size_m, bodies.position_m, points_m)
    return np.maximum(signed, 0.0)
