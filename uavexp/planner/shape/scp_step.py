"""One step of the sequential convex programme of `min_acc`: local model, QP data, merit.

Merit: ∫ ‖r''‖² + τ² ‖r'''‖² + λ c(r) dt + μ Σ ‖r - p‖² over the samples that are tethered to path points p.
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
from uavexp.field import value_at
from uavexp.planner.movers.moving import clearance_after
from uavexp.planner.shape.band_qp import Rows, solve_band_qp
from uavexp.planner.spline.uniform import SAMPLES

HARD_WEIGHT = 10.0
NEAR_LIMIT, NEAR_BOUND_M = 0.6, 0.5  # what is farther from its limit gets no row
EXCESS_WEIGHT = 1000.0  # of relative excess over a limit in the merit: an exact penalty
_STENCILS = np.array([[-1.0, 1.0, 0.0], [1.0, -2.0, 1.0]])
_BAND = 11  # of the Hessian: control points three apart share a span
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
    energy: Float  # (N, N) of the spline: ∫ ‖r''‖² + τ² ‖r'''‖² = Σ cᵀ energy c / h³
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
    share = h / SAMPLES
    for k in range(points.shape[0]):
        felt_m = _felt_m(points[k, 0], points[k, 1], points[k, 2], k, by)
        total += by.obstacle_weight * share * clearance_cost(felt_m, by.safe_m, by.hard_m)
        if by.tether_weight[k] > 0.0:
            total += by.tether_weight[k] * share * ((points[k] - by.tether_m[k]) ** 2).sum()
    return float(total)


@nb.njit(cache=True, inline="always")
def _felt_m(x: float, y: float, z: float, k: int, by: Merit) -> float:
    """Distance of sample k's point to what is mapped, lowered near movers at its instant.

    To be just clear of a mover is worth as much as to have the least distance from what is fixed.
    """
    felt = value_at(by.distance, by.origin_m, by.voxel_m, x, y, z)
    if by.movers.shape[0] > 0:
        clearance = clearance_after(by.movers, x, y, z, (k + 0.5) * by.h / SAMPLES)
        felt = min(felt, clearance + by.least_m)
    return float(felt)


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
def _frame_at(control: Float, k: int) -> Float:
    """Frame (3, 3) of the direction of motion at sample k."""
    m, u = k // SAMPLES, (k % SAMPLES + 0.5) / SAMPLES
    tangent, square = np.empty(3), 0.0
    for axis in range(3):
        d0 = control[m + 1, axis] - control[m, axis]
        d1 = control[m + 2, axis] - control[m + 1, axis]
        d2 = control[m + 3, axis] - control[m + 2, axis]
        tangent[axis] = 0.5 * (1 - u) * (1 - u) * d0 + (0.5 + u - u * u) * d1 + 0.5 * u * u * d2
        square += tangent[axis] ** 2
    frame: Float = _frame(control[control.shape[0] - 1] - control[0] if square < 1e-8 else tangent)
    return frame


@nb.njit(cache=True)
def quadratic_model(control: Float, by: Merit) -> tuple[Float, Float]:
    """Hessian (3n, 3n) and gradient (3n,) of the merit over the n = N - 6 free control points.

    Variable 3 j + axis moves control point 3 + j.
    """
    hessian, gradient = _energy_model(control, by)
    points = _samples(control, by.position)
    d, slope, bend = np.empty(7), np.empty(3), np.empty((3, 3))
    # no neighbour of a point farther away than this feels anything: an interpolated distance changes by
    # at most √3 m a metre
    felt_from_m = by.safe_m + 1.7320508075688772 * by.voxel_m
    for k in range(points.shape[0]):
        pull = by.tether_weight[k]
        x, y, z = points[k]
        d[0] = _felt_m(x, y, z, k, by)
        if d[0] >= felt_from_m and pull == 0.0:
            continue
        frame = _frame_at(control, k)
        for e in range(3):
            ex, ey, ez = by.voxel_m * frame[e, 0], by.voxel_m * frame[e, 1], by.voxel_m * frame[e, 2]
            d[1 + 2 * e] = _felt_m(x + ex, y + ey, z + ez, k, by)
            d[2 + 2 * e] = _felt_m(x - ex, y - ey, z - ez, k, by)
        cost_model(d, frame, by.voxel_m, by.obstacle_weight, by.safe_m, by.hard_m, slope, bend)
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
def limit_rows(control: Float, h: float, limits: Float, bounds: Float) -> Rows:
    """Rows of the QP: speed, acceleration and flight bounds.

    Each norm limit is replaced by half spaces that touch its ball: where the present vector
    points, and for accelerations also around that. They hold the ball, so a QP without
    solution means that the limits themselves cannot be kept; an acceleration that turns by up
    to 36° exceeds its limit by 2.3 % at most. Only vectors beyond 0.6 of their limit, the first
    accelerations, and control points within 0.5 m of a bound get rows.
    """
    count = control.shape[0]
    most = 10 * count + 60
    rows = Rows(np.empty((most, 9)), np.empty(most, np.int64), np.empty(most, np.int64), np.empty(most))
    size = 0
    for order in range(2):
        for i in range(2 - order, count - 3):
            size = _limit_rows(control, h, limits, order, i, rows, size)
    for i in range(3, count - 3):
        for axis in range(3):
            for side in range(2):
                sign = 2.0 * side - 1.0  # -1 at the lower bound, 1 at the upper
                room = sign * (bounds[side, axis] - control[i, axis])
                if room < NEAR_BOUND_M:
                    rows.entries[size, 0], rows.width[size] = sign, 1
                    rows.first[size], rows.upper[size] = 3 * (i - 3) + axis, room
                    size += 1
    return Rows(rows.entries[:size], rows.first[:size], rows.width[:size], rows.upper[:size])


@nb.njit(cache=True, inline="always")
def _limit_rows(control: Float, h: float, limits: Float, order: int, i: int, rows: Rows, size: int) -> int:
    """Add the rows of speed (order 0) or acceleration (1) from control point i on; their number then."""
    stencil = _STENCILS[order]
    vector = np.zeros(3)
    for j in range(2 + order):
        for axis in range(3):
            vector[axis] += stencil[j] * control[i + j, axis]
    limit, norm = limits[order] * h ** (1 + order), np.sqrt((vector * vector).sum())
    hard = order == 1 and i <= _HARD_STARTS
    if not hard and norm < NEAR_LIMIT * limit:
        return size
    frame = _frame(vector)
    first, last = max(i, 3), min(i + 1 + order, control.shape[0] - 4)  # of the free points that it moves with
    for turn in range(10 if hard else 1 + 2 * order):
        rows.first[size], rows.width[size] = 3 * (first - 3), 3 * (last + 1 - first)
        rows.upper[size] = limit
        for axis in range(3):
            normal = 0.0
            for e in range(3):
                normal += FAN[turn, e] * frame[e, axis]
            rows.upper[size] -= normal * vector[axis]
            for j in range(first, last + 1):
                rows.entries[size, 3 * (j - first) + axis] = stencil[j - i] * normal
        size += 1
    return size


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


@nb.njit(cache=True)
def advance(control: Float, by: Merit, bounds: Float) -> tuple[Float, float, bool]:
    """One step: the control points (N, 3) it leads to, the share of the merit it gains, and if there is one.

    Args:
        control: (N, 3).
        by: what a curve is judged by.
        bounds: (2, 3) of the flight.
    """
    hessian, gradient = quadratic_model(control, by)
    step, solved = solve_band_qp(hessian, gradient, limit_rows(control, by.h, by.limits, bounds), _BAND)
    if not solved:
        return control, 0.0, False
    better, gained = line_search(control, step.reshape(-1, 3), by)
    return better, gained, True
