"""One step of the sequential convex programme of `min_acc`: local model, QP data, merit.

Merit: ∫ ‖r''‖² + λ c(r) dt + μ Σ ‖r - p‖² over the samples that are tethered to path points p.
The obstacle cost is c(d) = (1 - d/safe)₊² + 10 ((hard - d)/safe)₊², d the mapped distance.
It has a kink on the medial axis of a gap, where Gauss-Newton would jump from wall to wall;
so each sample takes slope and (non-negative) curvature of c from differences over a voxel,
along the curve, across it, and up. The model of every step is convex.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from uavexp.mapping.field import value_and_gradient
from uavexp.planner.spline import SAMPLES
from uavexp.types import Float, Float32

HARD_WEIGHT = 10.0
_NEAR_LIMIT = 0.6
_NEAR_BOUND_M = 0.5
_EXCESS_WEIGHT = 300.0  # of relative excess over a limit in the merit: an exact penalty
_TURN = np.array([[1.0, 0.0], [0.85, 0.5267827], [0.85, -0.5267827]])  # cosine, sine of 0, ±32°


@nb.njit(cache=True, inline="always")
def _cost(distance_m: float, safe_m: float, hard_m: float) -> float:
    soft = max(1.0 - distance_m / safe_m, 0.0)
    hard = max((hard_m - distance_m) / safe_m, 0.0)
    return soft * soft + HARD_WEIGHT * hard * hard


@nb.njit(cache=True)
def merit(
    control: Float,
    h: float,
    energy: Float,
    position: Float,
    distance: Float32,
    origin_m: Float,
    voxel_m: float,
    weights: Float,
    tether_m: Float,
    tether_weight: Float,
    limits: Float,
) -> float:
    """Value of the merit at control points (N, 3).

    `weights` are λ, safe and hard distance; `limits` are those of speed and acceleration.
    """
    bent = energy @ control
    total = (control * bent).sum() / h**3
    for i in range(2, control.shape[0] - 3):
        fast, strong = 0.0, 0.0
        for axis in range(3):
            fast += (control[i + 1, axis] - control[i, axis]) ** 2
            strong += (control[i - 1, axis] - 2.0 * control[i, axis] + control[i + 1, axis]) ** 2
        total += _EXCESS_WEIGHT * max(np.sqrt(fast) / (h * limits[0]) - 1.0, 0.0)
        total += _EXCESS_WEIGHT * max(np.sqrt(strong) / (h * h * limits[1]) - 1.0, 0.0)
    points = _samples(control, position)
    d, _ = value_and_gradient(distance, origin_m, voxel_m, points)
    share = h / SAMPLES
    for k in range(points.shape[0]):
        total += weights[0] * share * _cost(d[k], weights[1], weights[2])
        if tether_weight[k] > 0.0:
            total += tether_weight[k] * share * ((points[k] - tether_m[k]) ** 2).sum()
    return float(total)


@nb.njit(cache=True)
def _samples(control: Float, position: Float) -> Float:
    """Sample points (SAMPLES * M, 3); row k of `position` has its four entries from k // SAMPLES on."""
    count = position.shape[0]
    points = np.zeros((count, 3))
    for k in range(count):
        m = k // SAMPLES
        for j in range(m, m + 4):
            for axis in range(3):
                points[k, axis] += position[k, j] * control[j, axis]
    return points


@nb.njit(cache=True)
def _frames(control: Float) -> Float:
    """Unit vectors (SAMPLES * M, 3, 3) along the curve, level across it, and up from both."""
    segments = control.shape[0] - 3
    chord = control[control.shape[0] - 1] - control[0]
    frames = np.zeros((SAMPLES * segments, 3, 3))
    for k in range(SAMPLES * segments):
        m = k // SAMPLES
        u = (k % SAMPLES + 0.5) / SAMPLES
        t = np.empty(3)
        for axis in range(3):
            d0 = control[m + 1, axis] - control[m, axis]
            d1 = control[m + 2, axis] - control[m + 1, axis]
            d2 = control[m + 3, axis] - control[m + 2, axis]
            t[axis] = 0.5 * (1 - u) * (1 - u) * d0 + (0.5 + u - u * u) * d1 + 0.5 * u * u * d2
        if (t * t).sum() < 1e-8:
            t[:] = chord
        if t[0] * t[0] + t[1] * t[1] < 1e-2 * (t * t).sum() or (t * t).sum() < 1e-12:
            for axis in range(3):  # steep or standing: the world's own axes
                frames[k, axis, axis] = 1.0
            continue
        t /= np.sqrt((t * t).sum())
        flat = np.sqrt(t[0] * t[0] + t[1] * t[1])
        frames[k, 0] = t
        frames[k, 1, 0], frames[k, 1, 1] = -t[1] / flat, t[0] / flat
        frames[k, 2, 0] = -t[2] * frames[k, 1, 1]
        frames[k, 2, 1] = t[2] * frames[k, 1, 0]
        frames[k, 2, 2] = flat
    return frames


@nb.njit(cache=True)
def quadratic_model(
    control: Float,
    h: float,
    energy: Float,
    position: Float,
    distance: Float32,
    origin_m: Float,
    voxel_m: float,
    weights: Float,
    tether_m: Float,
    tether_weight: Float,
    limits: Float,
) -> tuple[Float, Float]:
    """Hessian (3n, 3n) and gradient (3n,) of the merit over the n = N - 6 free control points.

    Variable 3 j + axis moves control point 3 + j.
    """
    n = control.shape[0] - 6
    hessian, gradient = np.zeros((3 * n, 3 * n)), np.zeros(3 * n)
    slope_of_energy = (energy @ control) * (2.0 / h**3)
    for i in range(n):
        for axis in range(3):
            gradient[3 * i + axis] = slope_of_energy[3 + i, axis]
        for j in range(max(i - 3, 0), min(i + 4, n)):
            for axis in range(3):
                hessian[3 * i + axis, 3 * j + axis] = 2.0 * energy[3 + i, 3 + j] / h**3
    points, frames = _samples(control, position), _frames(control)
    count = points.shape[0]
    around = np.empty((7 * count, 3))
    for k in range(count):
        around[7 * k] = points[k]
        for e in range(3):
            around[7 * k + 1 + 2 * e] = points[k] + voxel_m * frames[k, e]
            around[7 * k + 2 + 2 * e] = points[k] - voxel_m * frames[k, e]
    d, _ = value_and_gradient(distance, origin_m, voxel_m, around)
    slope, bend = np.empty(3), np.empty((3, 3))
    for k in range(count):
        slope[:], bend[:] = 0.0, 0.0
        middle = _cost(d[7 * k], weights[1], weights[2])
        for e in range(3):
            ahead = _cost(d[7 * k + 1 + 2 * e], weights[1], weights[2])
            behind = _cost(d[7 * k + 2 + 2 * e], weights[1], weights[2])
            first = weights[0] * (ahead - behind) / (2.0 * voxel_m)
            second = weights[0] * max(ahead - 2.0 * middle + behind, 0.0) / voxel_m**2
            for a in range(3):
                slope[a] += first * frames[k, e, a]
                for b in range(3):
                    bend[a, b] += second * frames[k, e, a] * frames[k, e, b]
        if tether_weight[k] > 0.0:
            for a in range(3):
                slope[a] += 2.0 * tether_weight[k] * (points[k, a] - tether_m[k, a])
                bend[a, a] += 2.0 * tether_weight[k]
        m, share = k // SAMPLES, h / SAMPLES
        for i in range(max(m - 3, 0), min(m + 1, n)):  # control point 3 + i is one of m .. m + 3
            wi = share * position[k, 3 + i]
            for a in range(3):
                gradient[3 * i + a] += wi * slope[a]
            for j in range(max(m - 3, 0), min(m + 1, n)):
                wij = wi * position[k, 3 + j]
                for a in range(3):
                    for b in range(3):
                        hessian[3 * i + a, 3 * j + b] += wij * bend[a, b]
    for i in range(3 * n):
        hessian[i, i] += 1e-6
    return hessian, gradient


@nb.njit(cache=True)
def limit_rows(control: Float, h: float, limits: Float, bounds: Float) -> tuple[Float, Float]:
    """Rows (R, 3n) and right sides (R,) of the QP: speed, acceleration and flight bounds.

    Each norm limit is replaced by half spaces touching its ball: where the present vector
    points, and for accelerations also at 32° to either side of it in plan. They hold the ball,
    so a QP without solution means that the limits themselves cannot be kept; an acceleration
    that turns by up to 48° exceeds its limit by 4 % at most. Only vectors beyond 0.6 of their limit
    and control points within 0.5 m of a bound get rows.
    """
    count = control.shape[0]
    rows, sides = np.zeros((10 * count, 3 * (count - 6))), np.empty(10 * count)
    size = 0
    stencil = np.array([[-1.0, 1.0, 0.0], [1.0, -2.0, 1.0]])
    vector = np.empty(3)
    for order in range(2):
        limit = limits[order] * h ** (1 + order)
        for i in range(2 - order, count - 3):
            for axis in range(3):
                vector[axis] = 0.0
                for j in range(2 + order):
                    vector[axis] += stencil[order, j] * control[i + j, axis]
            norm = np.sqrt((vector * vector).sum())
            if norm < _NEAR_LIMIT * limit:
                continue
            for turn in range(1 + 2 * order):
                x = (_TURN[turn, 0] * vector[0] - _TURN[turn, 1] * vector[1]) / norm
                y = (_TURN[turn, 1] * vector[0] + _TURN[turn, 0] * vector[1]) / norm
                z = vector[2] / norm
                sides[size] = limit * np.sqrt(x * x + y * y + z * z)
                sides[size] -= x * vector[0] + y * vector[1] + z * vector[2]
                for j in range(2 + order):
                    if 3 <= i + j < count - 3:
                        at = 3 * (i + j - 3)
                        rows[size, at] = stencil[order, j] * x
                        rows[size, at + 1] = stencil[order, j] * y
                        rows[size, at + 2] = stencil[order, j] * z
                size += 1
    for i in range(3, count - 3):
        for axis in range(3):
            for side in range(2):
                sign = 2.0 * side - 1.0  # -1 at the lower bound, 1 at the upper
                room = sign * (bounds[side, axis] - control[i, axis])
                if room < _NEAR_BOUND_M:
                    rows[size, 3 * (i - 3) + axis] = sign
                    sides[size] = room
                    size += 1
    return rows[:size], sides[:size]


@nb.njit(cache=True)
def line_search(
    control: Float,
    step: Float,
    h: float,
    energy: Float,
    position: Float,
    distance: Float32,
    origin_m: Float,
    voxel_m: float,
    weights: Float,
    tether_m: Float,
    tether_weight: Float,
    limits: Float,
) -> tuple[Float, float]:
    """First of a few shares of a QP's step (n, 3) that lowers the merit, and by what share.

    Args:
        control: (N, 3).
        step: of the free control points.
        h: and the rest: see `merit`.
    """
    last = control.shape[0] - 3
    grid = (distance, origin_m, voxel_m)
    pull = (weights, tether_m, tether_weight, limits)
    present = merit(control, h, energy, position, *grid, *pull)
    share = 1.0
    for _ in range(4):
        trial = control.copy()
        trial[3:last] += share * step
        value = merit(trial, h, energy, position, *grid, *pull)
        if value < present:
            return trial, (present - value) / present
        share *= 0.4
    return control, 0.0
