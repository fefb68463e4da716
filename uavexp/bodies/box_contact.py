"""Oriented boxes against moving bodies: touching, and the planes between (numba, float64).

All three shapes are convex and symmetric about their centres, so a plane with unit normal n
separates a body from a box when |n . offset| exceeds the reaches of both along n; the gap
across it is the difference. Touching is decided exactly: for a sphere by the distance of its
centre to the box, for a box by the 15 axes of the separating axis theorem (Gottschalk, Lin and
Manocha 1996), for an upright cylinder by the outline, seen from above, of the part of the box
between its two caps.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from uavexp.arrays import Float, Int, UInt8
from uavexp.types import Bodies, Shape

_ROUNDS = 8  # of projections between a body and a box
_SPHERE, _CYLINDER = int(Shape.SPHERE), int(Shape.CYLINDER)


@nb.njit(cache=True)
def _gap_across(shape: int, half: Float, offset: Float, rotation: Float, box: Float, n: Float) -> float:
    """Gap between a body and a box across the plane of unit normal n; < 0: it separates nothing."""
    if shape == _SPHERE:
        reach = half[0]
    elif shape == _CYLINDER:
        reach = half[0] * math.hypot(n[0], n[1]) + half[2] * abs(n[2])
    else:
        reach = half[0] * abs(n[0]) + half[1] * abs(n[1]) + half[2] * abs(n[2])
    for c in range(3):
        reach += box[c] * abs(n[0] * rotation[0, c] + n[1] * rotation[1, c] + n[2] * rotation[2, c])
    return float(abs(n[0] * offset[0] + n[1] * offset[1] + n[2] * offset[2]) - reach)


@nb.njit(cache=True)
def _towards_box(shape: int, half: Float, offset: Float, rotation: Float, box: Float, n: Float) -> None:
    """Write the way from a body to a box between their nearest points, found by projecting to and fro."""
    a, b = np.zeros(3), np.empty(3)
    for _ in range(_ROUNDS):
        for axis in range(3):
            b[axis] = offset[axis]
        for c in range(3):
            along = 0.0
            for axis in range(3):
                along += rotation[axis, c] * (a[axis] - offset[axis])
            along = min(max(along, -box[c]), box[c])
            for axis in range(3):
                b[axis] += along * rotation[axis, c]
        if shape == _SPHERE:
            far = math.sqrt(b[0] * b[0] + b[1] * b[1] + b[2] * b[2])
            a[:] = b * min(1.0, half[0] / far) if far > 0.0 else b
        else:
            for axis in range(3):
                a[axis] = min(max(b[axis], -half[axis]), half[axis])
            if shape == _CYLINDER:
                far = math.hypot(b[0], b[1])
                short = min(1.0, half[0] / far) if far > 0.0 else 1.0
                a[0], a[1] = b[0] * short, b[1] * short
    for axis in range(3):
        n[axis] = b[axis] - a[axis]


@nb.njit(cache=True)
def _try(
    shape: int, half: Float, offset: Float, rotation: Float, box: Float, n: Float, best: float, out: Float
) -> float:
    """Keep direction n (3,) of any length in `out` when it separates better than `best`."""
    length = math.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    if length < 1e-9:
        return best
    unit = n / length
    gap = _gap_across(shape, half, offset, rotation, box, unit)
    if gap <= best:
        return best
    away = unit[0] * offset[0] + unit[1] * offset[1] + unit[2] * offset[2]
    out[:] = unit if away >= 0.0 else -unit
    return float(gap)


@nb.njit(cache=True)
def _separation(shape: int, half: Float, offset: Float, rotation: Float, box: Float, out: Float) -> float:
    """Widest gap across a plane between a body and a box; the unit normal to the box goes to `out`.

    The planes of the separating axis theorem and the one across the nearest points. > 0: apart;
    for two boxes and for a sphere, <= 0 also means that they meet.
    """
    best, n = -np.inf, np.zeros(3)
    for i in range(3):
        best = _try(shape, half, offset, rotation, box, rotation[:, i].copy(), best, out)
        n[:] = 0.0
        n[i] = 1.0
        best = _try(shape, half, offset, rotation, box, n, best, out)
        for j in range(3):
            best = _try(shape, half, offset, rotation, box, np.cross(n, rotation[:, j]), best, out)
    _towards_box(shape, half, offset, rotation, box, n)
    best = _try(shape, half, offset, rotation, box, n, best, out)
    n[:] = offset  # out of a body that the box has run into, the short way
    if shape == _CYLINDER:
        n[2] = 0.0
    best = _try(shape, half, offset, rotation, box, n, best, out)
    return float(best)


@nb.njit(cache=True)
def _outline(offset: Float, rotation: Float, box: Float, level: float, points: Float) -> int:
    """Corners, seen from above, of the part of a box with |z| <= level; writes (x, y), returns how many."""
    corner, count = np.empty((8, 3)), 0
    for c in range(8):
        for axis in range(3):
            corner[c, axis] = offset[axis]
            for side in range(3):
                sign = 1.0 if (c >> side) & 1 else -1.0
                corner[c, axis] += sign * box[side] * rotation[axis, side]
        if abs(corner[c, 2]) <= level:
            points[count, 0], points[count, 1] = corner[c, 0], corner[c, 1]
            count += 1
    for c in range(8):
        for side in range(3):
            e = c | (1 << side)
            if e == c:
                continue
            for cap in (-level, level):
                if (corner[c, 2] < cap) != (corner[e, 2] < cap):
                    share = (cap - corner[c, 2]) / (corner[e, 2] - corner[c, 2])
                    for axis in range(2):
                        points[count, axis] = corner[c, axis] + share * (corner[e, axis] - corner[c, axis])
                    count += 1
    return count


@nb.njit(cache=True)
def _meets_disc(points: Float, count: int, radius: float) -> bool:
    """Whether the convex hull of points (N, 2) meets a disc around the origin.

    The hull's nearest point lies on a segment between two of the points; when none of them
    lies behind it, it is the nearest one indeed, else the origin is inside.
    """
    nearest, qx, qy = np.inf, 0.0, 0.0
    for i in range(count):
        for j in range(i + 1):
            dx, dy = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
            square, share = dx * dx + dy * dy, 0.0
            if square > 0.0:
                share = min(max(-(points[i, 0] * dx + points[i, 1] * dy) / square, 0.0), 1.0)
            x, y = points[i, 0] + share * dx, points[i, 1] + share * dy
            if x * x + y * y < nearest:
                nearest, qx, qy = x * x + y * y, x, y
    if nearest <= radius * radius:
        return True
    behind = False
    for i in range(count):
        behind = behind or (points[i, 0] - qx) * qx + (points[i, 1] - qy) * qy < -1e-12
    return behind


@nb.njit(cache=True)
def _meets(shape: int, half: Float, offset: Float, rotation: Float, box: Float) -> bool:
    if shape == _CYLINDER:
        points = np.empty((32, 2))
        return bool(_meets_disc(points, _outline(offset, rotation, box, half[2], points), half[0]))
    return bool(_separation(shape, half, offset, rotation, box, np.empty(3)) <= 0.0)


@nb.njit(cache=True)
def _touching(
    shape: UInt8, half: Float, centre: Float, box_centre: Float, rotation: Float, box: Float
) -> Int:
    found, count = np.empty(shape.shape[0], np.int64), 0
    reach = math.sqrt((box**2).sum())
    for b in range(shape.shape[0]):
        offset = box_centre - centre[b]
        bound = reach + math.sqrt((half[b] ** 2).sum())
        near = (offset**2).sum() <= bound * bound
        if near and _meets(shape[b], half[b], offset, rotation, box):
            found[count] = b
            count += 1
    return found[:count]


def touching(bodies: Bodies, position_m: Float, rotation: Float, half_m: Float) -> Int:
    """Which bodies an oriented box meets, exactly: indices (K,), ascending.

    Args:
        bodies: the bodies.
        position_m: centre of the box (3,).
        rotation: box to world (3, 3).
        half_m: half length, width, height (3,).
    """
    found: Int = _touching(bodies.shape, bodies.half_size_m, bodies.position_m, position_m, rotation, half_m)
    return found


@nb.njit(cache=True)
def _planes(
    shape: UInt8, half: Float, centre: Float, box_centre: Float, rotation: Float, box: Float, within: float
) -> tuple[Int, Float, Float]:
    index = np.empty(shape.shape[0], np.int64)
    normal, gap, count = np.empty((shape.shape[0], 3)), np.empty(shape.shape[0]), 0
    for b in range(shape.shape[0]):
        offset = box_centre - centre[b]
        apart = _separation(shape[b], half[b], offset, rotation, box, normal[count])
        if apart <= within:
            index[count], gap[count] = b, apart
            count += 1
    return index[:count], normal[:count], gap[:count]


def separating_planes(
    bodies: Bodies, position_m: Float, rotation: Float, half_m: Float, within_m: float
) -> tuple[Int, Float, Float]:
    """The planes between an oriented box and the bodies near it; arguments as `touching`.

    Returns:
        Indices (K,) of the bodies not farther than `within_m`, unit normals (K, 3) from them to
        the box, and the gaps (K,) across, m; a gap <= 0 is how deep the two are in each other
        along that normal (or, beside the rim of a cylinder, that no exact normal was found).
    """
    index, normal, gap = _planes(
        bodies.shape, bodies.half_size_m, bodies.position_m, position_m, rotation, half_m, within_m
    )
    return index, normal, gap
