"""One step of the sequential convex programme of `min_acc`: local model, QP data, merit.

Merit: ∫ ‖r''‖² + λ c(r) dt + μ Σ ‖r - p‖² over the samples that are tethered to path points p.
The obstacle cost is c(d) = (1 - d/safe)₊² + 10 ((hard - d)/safe)₊², d the mapped distance, or what
is left of the distance to a mover at the sample's instant (`moving`) if that is less.
It has a kink on the medial axis of a gap, where Gauss-Newton would jump from wall to wall;
so each sample takes slope and (non-negative) curvature of c from differences over a voxel,
along the curve, across it, and up. The model of every step is convex.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Float, Float32
from uavexp.field import value_and_gradient
from uavexp.planner.movers.moving import clearance_after
from uavexp.planner.spline.uniform import SAMPLES

HARD_WEIGHT = 10.0
NEAR_LIMIT, NEAR_BOUND_M = 0.6, 0.5  # what is farther from its limit gets no row
EXCESS_WEIGHT = 1000.0  # of relative excess over a limit in the merit: an exact penalty
_HARD_STARTS = 4  # first accelerations, where a moving start leaves the least freedom
# half spaces around a vector, in (along, level across, up from both): towards it and 24° from it,
# then to the other sides as well
FAN = np.array(
    [
        [1.0, 0.0, 0.0],
        [0.91, 0.4146083, 0.0],
        [0.91, -0.4146083, 0.0],
        [0.91, 0.0, 0.4146083],
        [0.91, 0.0, -0.4146083],
        [0.0, 1.0, 0.0],
        [0.0, -1.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.0, 0.0, -1.0],
        [-1.0, 0.0, 0.0],
    ]
)


class Merit(NamedTuple):
    """What a curve is judged by, all but its control points."""

    h: float  # knot spacing, s
    energy: Float  # (N, N) of the spline (`Uniform.effort`)
    position: Float  # (S, N) its samples
    distance: Float32  # the map
    origin_m: Float
    voxel_m: float
    obstacle_weight: float  # λ
    safe_m: float
    hard_m: float
    least_m: float  # clearance that is kept
    tether_m: Float  # (S, 3) where samples are pulled to
    tether_weight: Float  # (S,)
    limits: Float  # (2,) of speed and acceleration
    movers: Float  # (B, COLUMNS) table of `moving`, its times counted from the start of the curve


@nb.njit(cache=True, inline="always")
def clearance_cost(distance_m: float, safe_m: float, hard_m: float) -> float:
    """c(d) = (1 - d/safe)₊² + 10 ((hard - d)/safe)₊² of a clearance d, m."""
    soft = max(1.0 - distance_m / safe_m, 0.0)
    hard = max((hard_m - distance_m) / safe_m, 0.0)
    return soft * soft + HARD_WEIGHT * hard * hard


@nb.njit(cache=True)
def merit(control: Float, by: Merit) -> float:
    """Value of the merit at control points (N, 3)."""
    h = by.h
    bent = by.energy @ control
    total = (control * bent).sum() / h**3
    for i in range(2, control.shape[0] - 3):
        fast, strong = 0.0, 0.0
        for axis in range(3):
            fast += (control[i + 1, axis] - control[i, axis]) ** 2
            strong += (control[i - 1, axis] - 2.0 * control[i, axis] + control[i + 1, axis]) ** 2
        total += EXCESS_WEIGHT * max(np.sqrt(fast) / (h * by.limits[0]) - 1.0, 0.0)
        total += EXCESS_WEIGHT * max(np.sqrt(strong) / (h * h * by.limits[1]) - 1.0, 0.0)
    points = _samples(control, by.position)
    d = _felt_m(points, 1, by)
    share = h / SAMPLES
    for k in range(points.shape[0]):
        total += by.obstacle_weight * share * clearance_cost(d[k], by.safe_m, by.hard_m)
        if by.tether_weight[k] > 0.0:
            total += by.tether_weight[k] * share * ((points[k] - by.tether_m[k]) ** 2).sum()
    return float(total)


@nb.njit(cache=True)
def _felt_m(points: Float, each: int, by: Merit) -> Float:
    """Distances of points, `each` of a sample, to what is mapped, lowered near movers at its instant.

    To be just clear of a mover is worth as much as to have the least distance from what is fixed.
    """
    distance_m: Float = value_and_gradient(by.distance, by.origin_m, by.voxel_m, points)[0]
    if by.movers.shape[0] == 0:
        return distance_m
    for n in range(points.shape[0]):
        ahead_s = (n // each + 0.5) * by.h / SAMPLES
        clearance = clearance_after(by.movers, points[n, 0], points[n, 1], points[n, 2], ahead_s)
        distance_m[n] = min(distance_m[n], clearance + by.least_m)
    return distance_m


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
def _frame(vector: Float) -> Float:
    """Unit vectors (3, 3) along a vector, level across it, and up from both.

    The world's own axes when it is zero or within 6° of the vertical.
    """
    frame = np.zeros((3, 3))
    norm = np.sqrt((vector * vector).sum())
    flat = np.sqrt(vector[0] * vector[0] + vector[1] * vector[1])
    if flat < 1e-6 or flat < 0.1 * norm:
        for axis in range(3):
            frame[axis, axis] = 1.0
        return frame
    for axis in range(3):
        frame[0, axis] = vector[axis] / norm
    frame[1, 0], frame[1, 1] = -vector[1] / flat, vector[0] / flat
    frame[2, 0] = -frame[0, 2] * frame[1, 1]
    frame[2, 1] = frame[0, 2] * frame[1, 0]
    frame[2, 2] = flat / norm
    return frame


@nb.njit(cache=True)
def _frames(control: Float) -> Float:
    """Frame (3, 3) of the direction of motion at each of the SAMPLES * M samples."""
    segments = control.shape[0] - 3
    chord = control[control.shape[0] - 1] - control[0]
    frames = np.empty((SAMPLES * segments, 3, 3))
    tangent = np.empty(3)
    for k in range(SAMPLES * segments):
        m = k // SAMPLES
        u = (k % SAMPLES + 0.5) / SAMPLES
        for axis in range(3):
            d0 = control[m + 1, axis] - control[m, axis]
            d1 = control[m + 2, axis] - control[m + 1, axis]
            d2 = control[m + 3, axis] - control[m + 2, axis]
            tangent[axis] = 0.5 * (1 - u) * (1 - u) * d0 + (0.5 + u - u * u) * d1 + 0.5 * u * u * d2
        if (tangent * tangent).sum() < 1e-8:
            tangent[:] = chord
        frames[k] = _frame(tangent)
    return frames


@nb.njit(cache=True)
def quadratic_model(control: Float, by: Merit) -> tuple[Float, Float]:
    """Hessian (3n, 3n) and gradient (3n,) of the merit over the n = N - 6 free control points.

    Variable 3 j + axis moves control point 3 + j.
    """
    hessian, gradient = _energy_model(control, by)
    points, frames = _samples(control, by.position), _frames(control)
    d = _felt_m(around(points, frames, by.voxel_m), 7, by)
    slope, bend = np.empty(3), np.empty((3, 3))
    for k in range(points.shape[0]):
        cost_model(
            d[7 * k : 7 * k + 7], frames[k], by.voxel_m, by.obstacle_weight, by.safe_m, by.hard_m, slope, bend
        )
        pull = by.tether_weight[k]
        if pull > 0.0:
            for a in range(3):
                slope[a] += 2.0 * pull * (points[k, a] - by.tether_m[k, a])
                bend[a, a] += 2.0 * pull
        _add_sample(hessian, gradient, k, by.h / SAMPLES, by.position, slope, bend)
    for i in range(len(gradient)):
        hessian[i, i] += 1e-6
    return hessian, gradient


@nb.njit(cache=True)
def _energy_model(control: Float, by: Merit) -> tuple[Float, Float]:
    """Hessian and gradient (`quadratic_model`) of the energy alone."""
    n = control.shape[0] - 6
    hessian, gradient = np.zeros((3 * n, 3 * n)), np.zeros(3 * n)
    slope_of_energy = (by.energy @ control) * (2.0 / by.h**3)
    for i in range(n):
        for axis in range(3):
            gradient[3 * i + axis] = slope_of_energy[3 + i, axis]
        for j in range(max(i - 3, 0), min(i + 4, n)):
            for axis in range(3):
                hessian[3 * i + axis, 3 * j + axis] = 2.0 * by.energy[3 + i, 3 + j] / by.h**3
    return hessian, gradient


@nb.njit(cache=True)
def around(points: Float, frames: Float, voxel_m: float) -> Float:
    """Each point (S, 3) and those a voxel from it along its frame (3, 3), forward and back: (7 S, 3)."""
    out = np.empty((7 * points.shape[0], 3))
    for k in range(points.shape[0]):
        out[7 * k] = points[k]
        for e in range(3):
            out[7 * k + 1 + 2 * e] = points[k] + voxel_m * frames[k, e]
            out[7 * k + 2 + 2 * e] = points[k] - voxel_m * frames[k, e]
    return out


@nb.njit(cache=True, inline="always")
def cost_model(
    d: Float, frame: Float, voxel_m: float, weight: float, safe_m: float, hard_m: float,
    slope: Float, bend: Float,
) -> None:  # fmt: skip
    """Write slope (3,) and non-negative curvature (3, 3) of the weighted cost, of distances (7,) `around`."""
    slope[:], bend[:] = 0.0, 0.0
    middle = clearance_cost(d[0], safe_m, hard_m)
    for e in range(3):
        ahead = clearance_cost(d[1 + 2 * e], safe_m, hard_m)
        behind = clearance_cost(d[2 + 2 * e], safe_m, hard_m)
        first = weight * (ahead - behind) / (2.0 * voxel_m)
        second = weight * max(ahead - 2.0 * middle + behind, 0.0) / voxel_m**2
        for a in range(3):
            slope[a] += first * frame[e, a]
            for b in range(3):
                bend[a, b] += second * frame[e, a] * frame[e, b]


@nb.njit(cache=True, inline="always")
def _add_sample(
    hessian: Float, gradient: Float, k: int, share: float, position: Float, slope: Float, bend: Float
) -> None:
    """Add a sample's slope and curvature to those of the free ones of its four control points."""
    m, n = k // SAMPLES, len(gradient) // 3
    for i in range(max(m - 3, 0), min(m + 1, n)):  # control point 3 + i is one of m .. m + 3
        wi = share * position[k, 3 + i]
        for a in range(3):
            gradient[3 * i + a] += wi * slope[a]
        for j in range(max(m - 3, 0), min(m + 1, n)):
            wij = wi * position[k, 3 + j]
            for a in range(3):
                for b in range(3):
                    hessian[3 * i + a, 3 * j + b] += wij * bend[a, b]


@nb.njit(cache=True)
def limit_rows(control: Float, h: float, limits: Float, bounds: Float) -> tuple[Float, Float]:
    """Rows (R, 3n) and right sides (R,) of the QP: speed, acceleration and flight bounds.

    Each norm limit is replaced by half spaces that touch its ball: where the present vector
    points, and for accelerations also around that. They hold the ball, so a QP without
    solution means that the limits themselves cannot be kept; an acceleration that turns by up
    to 36° exceeds its limit by 2.3 % at most. Only vectors beyond 0.6 of their limit, the first
    accelerations, and control points within 0.5 m of a bound get rows.
    """
    count = control.shape[0]
    rows, sides = np.zeros((20 * count, 3 * (count - 6))), np.empty(20 * count)
    size = 0
    stencil = np.array([[-1.0, 1.0, 0.0], [1.0, -2.0, 1.0]])
    vector, normal = np.empty(3), np.empty(3)
    for order in range(2):
        limit = limits[order] * h ** (1 + order)
        for i in range(2 - order, count - 3):
            for axis in range(3):
                vector[axis] = 0.0
                for j in range(2 + order):
                    vector[axis] += stencil[order, j] * control[i + j, axis]
            norm = np.sqrt((vector * vector).sum())
            hard = order == 1 and i <= _HARD_STARTS
            if not hard and norm < NEAR_LIMIT * limit:
                continue
            frame = _frame(vector)
            for turn in range(10 if hard else 1 + 2 * order):
                sides[size] = limit
                for axis in range(3):
                    normal[axis] = (
                        FAN[turn, 0] * frame[0, axis]
                        + FAN[turn, 1] * frame[1, axis]
                        + FAN[turn, 2] * frame[2, axis]
                    )
                    sides[size] -= normal[axis] * vector[axis]
                for j in range(2 + order):
                    if 3 <= i + j < count - 3:
                        for axis in range(3):
                            rows[size, 3 * (i + j - 3) + axis] = stencil[order, j] * normal[axis]
                size += 1
    for i in range(3, count - 3):
        for axis in range(3):
            for side in range(2):
                sign = 2.0 * side - 1.0  # -1 at the lower bound, 1 at the upper
                room = sign * (bounds[side, axis] - control[i, axis])
                if room < NEAR_BOUND_M:
                    rows[size, 3 * (i - 3) + axis] = sign
                    sides[size] = room
                    size += 1
    return rows[:size], sides[:size]


@nb.njit(cache=True)
def line_search(control: Float, step: Float, by: Merit) -> tuple[Float, float]:
    """First of a few shares of a QP's step (n, 3) that lowers the merit, and by what share of it.

    `control` (N, 3) are all control points, `step` moves the free ones.
    """
    last = control.shape[0] - 3
    present = merit(control, by)
    share = 1.0
    for _ in range(4):
        trial = control.copy()
        trial[3:last] += share * step
        value = merit(trial, by)
        if value < present:
            return trial, (present - value) / present
        share *= 0.4
    return control, 0.0
