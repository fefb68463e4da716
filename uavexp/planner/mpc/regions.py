"""The regions of eq. 3e as half spaces n · p >= b around a predicted motion, one step after the other.

Static: the distance to a convex obstacle is convex, so the plane that touches it at any point
never promises more than there is; it is taken where the vehicle is predicted and a little to
each side of it, or the wall opposite would go unnoticed. Dynamic: a mover's upright box, grown by
its uncertainty, a turn, the body's radius and the margin (`moving`), is convex, so any half space that
touches it keeps the vehicle out; the one chosen faces the vehicle, or, where that is inside,
lets it pass on the side on which the two would miss each other.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from uavexp.arrays import Float, Float32, Int
from uavexp.field import value_and_gradient
from uavexp.planner.movers.moving import COLUMNS, HORIZON, INSET, STANDS, grown_m, moved_s, swerved_m

_AROUND_M = 0.25  # how far to the sides the static field is asked
_REACH_M = 0.8  # a region farther than this from the predicted motion is no matter of this QP
_FLAT = 0.3  # a gradient shorter than this is on a medial axis, and means nothing
_SOON_S = 0.1  # over which the velocity of a predicted path is taken
_LEAST_MPS = 0.1  # slower relative motion has no direction


@nb.njit(cache=True)
def static_planes(
    points: Float, distance: Float32, origin_m: Float, voxel_m: float, clearance_m: float
) -> tuple[Int, Float, Float]:
    """Half spaces that keep predicted places (N, 3) out of mapped obstacles.

    Returns:
        Step (R,) in 0 .. N-1, normal (R, 3) and bound (R,).
    """
    count = len(points)
    around = np.empty((7 * count, 3))
    for k in range(count):
        around[7 * k : 7 * k + 7] = points[k]
        for axis in range(3):
            around[7 * k + 1 + 2 * axis, axis] += _AROUND_M
            around[7 * k + 2 + 2 * axis, axis] -= _AROUND_M
    value, gradient = value_and_gradient(distance, origin_m, voxel_m, around)
    step, normal = np.empty(7 * count, dtype=np.int64), np.empty((7 * count, 3))
    bound, rows = np.empty(7 * count), 0
    for m in range(7 * count):
        length = math.sqrt((gradient[m] ** 2).sum())
        if length < _FLAT:
            continue
        k, unit = m // 7, gradient[m] / length
        edge = clearance_m - value[m] + (unit * around[m]).sum()
        if (unit * points[k]).sum() - edge > _REACH_M:
            continue
        step[rows], normal[rows], bound[rows] = k, unit, edge
        rows += 1
    return step[:rows], normal[:rows], bound[:rows]


@nb.njit(cache=True)
def mover_planes(points: Float, velocities: Float, ahead_s: Float, movers: Float) -> tuple[Int, Float, Float]:
    """Half spaces that keep predicted places out of predicted movers.

    Args:
        points: (N, 3) predicted.
        velocities: (N, 3) predicted.
        ahead_s: (N,) time since the table's.
        movers: (B, COLUMNS) `moving.MovingObstacles.table`.

    Returns:
        Step (R,) in 0 .. N-1, normal (R, 3) and bound (R,).
    """
    most = len(points) * len(movers)
    step, normal = np.empty(most, dtype=np.int64), np.empty((most, 3))
    bound, rows = np.empty(most), 0
    for k in range(len(points)):
        for row in movers:
            if ahead_s[k] > row[HORIZON]:
                continue
            centre, half = row[0:3] + moved_s(row, ahead_s[k]) * row[3:6], row[6:9]
            drift = row[3:6].copy() if ahead_s[k] <= row[STANDS] else np.zeros(3)
            if row.shape[0] > COLUMNS:
                now = swerved_m(row, COLUMNS, ahead_s[k])
                then = swerved_m(row, COLUMNS, ahead_s[k] + _SOON_S)
                for axis in range(3):
                    centre[axis] += now[axis]
                    drift[axis] += (then[axis] - now[axis]) / _SOON_S
            kept = row[INSET] + grown_m(row, ahead_s[k])
            apart = points[k] - centre
            unit = facing(apart, velocities[k] - drift, half, kept)
            support = (np.abs(unit) * half).sum() + kept
            if (unit * apart).sum() - support > _REACH_M:
                continue
            step[rows], normal[rows], bound[rows] = k, unit, (unit * centre).sum() + support
            rows += 1
    return step[:rows], normal[:rows], bound[:rows]


@nb.njit(cache=True)
def facing(apart: Float, relative: Float, half: Float, kept: float) -> Float:
    """Unit normal (3,) of the half space that keeps a point out of a box grown by `kept`.

    Args:
        apart: (3,) the point, seen from the box's centre.
        relative: (3,) its velocity, seen from the box.
        half: (3,) half size of the box.
        kept: distance to be kept from the box.
    """
    away = apart - np.minimum(np.maximum(apart, -half), half)
    distance = math.sqrt((away**2).sum())
    if distance >= kept:
        return away / distance
    level = relative.copy()
    level[2] = 0.0
    speed = math.sqrt((level**2).sum())
    aside = apart.copy()
    aside[2] = 0.0
    if speed > _LEAST_MPS:  # the part of it across the motion: how far the two would miss each other
        aside -= (aside * level).sum() / speed**2 * level
    miss = math.sqrt((aside**2).sum())
    if miss > 1e-6:
        aside /= miss
    elif speed > _LEAST_MPS:  # dead on: to the left
        aside[0], aside[1] = -level[1] / speed, level[0] / speed
    else:
        aside[0], aside[1] = 1.0, 0.0
    upright = np.array([0.0, 0.0, 1.0 if apart[2] >= 0.0 else -1.0])
    level_lack = (np.abs(aside) * half).sum() - (aside * apart).sum()
    return aside if level_lack <= half[2] - abs(apart[2]) else upright
