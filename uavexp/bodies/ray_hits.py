"""Rays against moving bodies (numba, float64)."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from uavexp.arrays import Float, Float32, UInt8
from uavexp.bodies.distance import LOWEST_M
from uavexp.types import Bodies, Shape

_SPHERE, _CYLINDER = int(Shape.SPHERE), int(Shape.CYLINDER)


@nb.njit(cache=True)
def _crossing(shape: int, half: Float, o: Float, d: Float, normal: Float) -> float:
    """Ray parameter > 0 where a ray meets a body's surface first, inf on a miss; writes the normal.

    Each shape is an intersection of slabs and a round side; the ray is inside while it is
    inside of all of them. A ray that begins inside meets the surface from within.
    """
    enter, leave = -np.inf, np.inf
    first, last = -1, -1  # axis of the slab that bounds the interval; 3: the round side
    for axis in range(3):
        if shape == _SPHERE or (shape == _CYLINDER and axis < 2):
            continue
        if d[axis] == 0.0:
            if abs(o[axis]) > half[axis]:
                return np.inf
            continue
        middle, span = -o[axis] / d[axis], half[axis] / abs(d[axis])
        if middle - span > enter:
            enter, first = middle - span, axis
        if middle + span < leave:
            leave, last = middle + span, axis
    upright = 0.0 if shape == _CYLINDER else 1.0
    if shape in (_SPHERE, _CYLINDER):
        a = d[0] * d[0] + d[1] * d[1] + upright * d[2] * d[2]
        b = o[0] * d[0] + o[1] * d[1] + upright * o[2] * d[2]
        c = o[0] * o[0] + o[1] * o[1] + upright * o[2] * o[2] - half[0] * half[0]
        if a == 0.0:
            if c > 0.0:
                return np.inf
        else:
            square = b * b - a * c
            if square < 0.0:
                return np.inf
            root = math.sqrt(square)
            if (-b - root) / a > enter:
                enter, first = (-b - root) / a, 3
            if (-b + root) / a < leave:
                leave, last = (-b + root) / a, 3
    if enter > leave or leave <= 0.0:
        return np.inf
    t, face = (enter, first) if enter > 0.0 else (leave, last)
    normal[:] = 0.0
    if face < 3:
        normal[face] = 1.0 if o[face] + t * d[face] > 0.0 else -1.0
    else:
        for axis in range(3):
            part = upright if axis == 2 else 1.0
            normal[axis] = part * (o[axis] + t * d[axis]) / half[0]
    return t


@nb.njit(cache=True)
def _cast(shape: UInt8, half: Float, centre: Float, rays: Float32, hit: Float32, normal: Float32) -> None:
    o, d, n = np.empty(3), np.empty(3), np.empty(3)
    for b in range(shape.shape[0]):
        if centre[b, 2] < LOWEST_M:
            continue
        bound = half[b, 0] ** 2 if shape[b] == _SPHERE else (half[b] ** 2).sum()
        for r in range(rays.shape[0]):
            for axis in range(3):
                o[axis] = rays[r, axis] - centre[b, axis]
                d[axis] = rays[r, 3 + axis]
            along = o[0] * d[0] + o[1] * d[1] + o[2] * d[2]
            beyond = o[0] * o[0] + o[1] * o[1] + o[2] * o[2] - bound
            length = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
            if beyond > 0.0 and (along > 0.0 or along * along < beyond * length):
                continue  # past the ball around the body
            t = _crossing(shape[b], half[b], o, d, n)
            if t < hit[r]:
                hit[r] = t
                for axis in range(3):
                    normal[r, axis] = n[axis]


def cast_rays(bodies: Bodies, rays: Float32, hit: Float32, normal: Float32) -> None:
    """Let bodies stop rays that have gone on to fixed surfaces.

    Args:
        bodies: the bodies.
        rays: origin and direction (N, 6), m; directions of any length > 0.
        hit: ray parameter (N,) of the nearest surface so far, inf on a miss; lowered in place.
        normal: its unit normal (N, 3); outward where a body is hit; changed in place.
    """
    _cast(bodies.shape, bodies.half_size_m, bodies.position_m, rays, hit, normal)
