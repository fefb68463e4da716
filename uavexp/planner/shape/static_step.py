"""One step of paper 3's static planner (eq. 2): local model, QP data, merit, for any order.

Merit: α_control ∫ ‖r''‖² + α_smooth ∫ ‖r'''‖² + α_static ∫ c(r) dt + μ Σ ‖r - p‖² with the obstacle cost c
of `scp_step`, over samples that are tethered to path points p.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Float, Float32
from uavexp.field import DistanceField, interpolate
from uavexp.planner.shape.scp_step import (
    EXCESS_WEIGHT,
    FAN,
    NEAR_BOUND_M,
    NEAR_LIMIT,
    around,
    clearance_cost,
    cost_model,
)
from uavexp.planner.shape.successive import QP_SHARE
from uavexp.planner.spline.uniform import SAMPLES, Uniform

_SHARES = (1.0, 0.4, 0.16, 0.064)  # of a QP's step, tried in turn


def frames(vectors: Float) -> Float:
    """Unit vectors (K, 3, 3) along vectors (K, 3), level across them, and up from both.

    The world's own axes where a vector is zero or within 6° of the vertical.
    """
    norm = np.linalg.norm(vectors, axis=1)
    flat = np.hypot(vectors[:, 0], vectors[:, 1])
    steep = flat <= np.maximum(0.1 * norm, 1e-6)
    out = np.tile(np.eye(3), (len(vectors), 1, 1))
    kept = vectors[~steep]
    out[~steep, 0] = kept / norm[~steep, None]
    out[~steep, 1, :2] = np.stack([-kept[:, 1], kept[:, 0]], axis=1) / flat[~steep, None]
    out[~steep, 1, 2] = 0.0
    out[~steep, 2] = np.cross(out[~steep, 0], out[~steep, 1])
    return out


def touching(vectors: Float) -> Float:
    """Unit normals (K, 5, 3) of half spaces around vectors (K, 3): towards each, and 24° from it."""
    return np.asarray(np.einsum("fe,kea->kfa", FAN[:5], frames(vectors)))


class Cost(NamedTuple):
    """What is minimised, all but duration and control points."""

    basis: Uniform
    effort_weight: float  # α_control, 1
    jerk_weight: float  # α_smooth, s²
    obstacle_weight: float  # α_static, m²/s⁴
    tether: float  # pull to the path: acceleration² that a deviation of 1 m is worth
    field: DistanceField
    safe_m: float
    hard_m: float
    limits: tuple[float, float]  # of speed and acceleration
    bounds: Float  # (2, 3)

    @property
    def inner(self) -> slice:
        """The control points that are free."""
        degree = self.basis.degree
        return slice(degree, len(self.basis.velocity) + 1 - degree)

    @property
    def grid(self) -> tuple[Float32, Float, float, float, float]:
        """The map, and how its distances are felt."""
        field = self.field
        return field.distance, field.origin_m, field.voxel_size_m, self.safe_m, self.hard_m


def merit(cost: Cost, control: Float, h: float, tied: Float) -> float:
    """The cost of eq. 2, with what ties to the path and penalises excess over the limits.

    Args:
        cost: what is minimised.
        control: (N, 3), m.
        h: knot spacing, s.
        tied: (S, 3) where the tether pulls the samples to.
    """
    basis = cost.basis
    points = basis.samples @ control
    felt = cost.obstacle_weight * _obstacle_cost(points, *cost.grid)
    pulled = cost.tether * ((points - tied) ** 2).sum()
    energy = (control * (_energy(cost, h) @ control)).sum()
    speed, strength = cost.limits
    speeds = np.linalg.norm(basis.velocity @ control, axis=1) / (h * speed)
    strengths = np.linalg.norm(basis.acceleration @ control, axis=1) / (h * h * strength)
    excess = np.maximum(np.concatenate([speeds, strengths]) / QP_SHARE - 1.0, 0.0).sum()
    return float(energy + h / SAMPLES * (felt + pulled) + EXCESS_WEIGHT * excess)


def local_model(cost: Cost, control: Float, h: float, tied: Float) -> tuple[Float, Float]:
    """Hessian (3n, 3n) and gradient (3n,) of the cost; variable 3 j + axis moves inner control point j."""
    basis = cost.basis
    energy, moves = 2.0 * _energy(cost, h), basis.samples[:, cost.inner]
    points = basis.samples @ control
    slope, bend = _obstacle_model(points, frames(basis.tangents @ control), *cost.grid)
    share = h / SAMPLES
    slope = share * (cost.obstacle_weight * slope + 2.0 * cost.tether * (points - tied))
    bend = share * (cost.obstacle_weight * bend + 2.0 * cost.tether * np.eye(3))
    n = moves.shape[1]
    hessian = np.zeros((n, 3, n, 3))
    for a in range(3):
        hessian[:, a, :, a] = energy[cost.inner, cost.inner]
        for b in range(3):
            hessian[:, a, :, b] += moves.T @ (bend[:, a, b, None] * moves)
    gradient = (energy @ control)[cost.inner] + moves.T @ slope
    return hessian.reshape(3 * n, 3 * n) + 1e-6 * np.eye(3 * n), gradient.reshape(-1)


def limit_rows(cost: Cost, control: Float, h: float) -> tuple[Float, Float]:
    """Rows (R, 3n) and right sides (R,) of the QP: speed, acceleration and flight bounds.

    Half spaces that touch the ball of a limit hold it, so a QP without solution means that
    the limits cannot be kept; five around each vector bound by how much it can exceed them.
    """
    basis, inner = cost.basis, cost.inner
    speed, strength = cost.limits
    free = control[inner].reshape(-1)
    rows, sides = [], []
    for stencil, limit in (
        (basis.velocity, QP_SHARE * speed * h),
        (basis.acceleration, QP_SHARE * strength * h * h),
    ):
        vectors = stencil @ control
        movable = np.abs(stencil[:, inner]).max(axis=1) > 0.0
        near = np.flatnonzero(movable & (np.linalg.norm(vectors, axis=1) > NEAR_LIMIT * limit))
        normals = touching(vectors[near])
        row = stencil[near][:, None, inner, None] * normals[:, :, None, :]
        rows.append(row.reshape(-1, len(free)))
        sides.append((limit - np.einsum("kfa,ka->kf", normals, vectors[near])).reshape(-1))
    for sign, bound in ((-1.0, cost.bounds[0]), (1.0, cost.bounds[1])):
        room = sign * (np.tile(bound, len(free) // 3) - free)
        near = np.flatnonzero(room < NEAR_BOUND_M)
        rows.append(sign * np.eye(len(free))[near])
        sides.append(room[near])
    return np.concatenate(rows), np.concatenate(sides)


def _energy(cost: Cost, h: float) -> Float:
    """Matrix (N, N) of α_control ∫ ‖r''‖² + α_smooth ∫ ‖r'''‖²."""
    basis = cost.basis
    return np.asarray(cost.effort_weight / h**3 * basis.effort + cost.jerk_weight / h**5 * basis.jerk)


def line_search(cost: Cost, control: Float, step: Float, h: float, tied: Float) -> tuple[Float, float]:
    """Go the first of a few shares of a step (n, 3) that lowers the merit; by what share of it."""
    present = merit(cost, control, h, tied)
    for share in _SHARES:
        trial = control.copy()
        trial[cost.inner] += share * step
        value = merit(cost, trial, h, tied)
        if value < present:
            return trial, (present - value) / present
    return control, 0.0


@nb.njit(cache=True)
def _obstacle_cost(
    points: Float, distance: Float32, origin_m: Float, voxel_m: float, safe_m: float, hard_m: float
) -> float:
    """Sum over points (S, 3) of c(d) = (1 - d/safe)₊² + 10 ((hard - d)/safe)₊²."""
    d = interpolate(distance, origin_m, voxel_m, points)
    total = 0.0
    for k in range(len(points)):
        total += clearance_cost(d[k], safe_m, hard_m)
    return total


@nb.njit(cache=True)
def _obstacle_model(
    points: Float,
    frame: Float,
    distance: Float32,
    origin_m: Float,
    voxel_m: float,
    safe_m: float,
    hard_m: float,
) -> tuple[Float, Float]:
    """Slope (S, 3) and curvature (S, 3, 3) of c at points (S, 3), each in its frame (3, 3) (`cost_model`)."""
    slope, bend = np.empty((len(points), 3)), np.empty((len(points), 3, 3))
    d = interpolate(distance, origin_m, voxel_m, around(points, frame, voxel_m))
    for k in range(len(points)):
        cost_model(d[7 * k : 7 * k + 7], frame[k], voxel_m, 1.0, safe_m, hard_m, slope[k], bend[k])
    return slope, bend
