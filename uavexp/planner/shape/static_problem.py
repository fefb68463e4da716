"""The static planner's cost (eq. 2) at a fixed duration: local model, rows, line search, QPs by daqp."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import daqp
import numpy as np

from uavexp.arrays import Float
from uavexp.field import DistanceField
from uavexp.planner.shape.static_cost import FAN, frames, obstacle_cost, obstacle_model
from uavexp.planner.spline.uniform import SAMPLES, Uniform
from uavexp.types import Limits

_QP_SHARE = 0.96  # of the limits inside the QP: room for its linearisation
_EXCESS_WEIGHT = 1000.0  # of relative excess over a limit in the merit: an exact penalty
_NEAR_LIMIT, _NEAR_BOUND_M = 0.6, 0.5  # what is farther from its limit gets no row
_HARD_ABOVE_VOXELS = 0.5  # the steep part of the obstacle cost begins this far above the limit
_SHARES = (1.0, 0.4, 0.16, 0.064)  # of a QP's step, tried in turn
_TOLERANCE = 0.01  # a smaller relative gain in cost ends the iteration


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Parameters of the static planner and limits of the vehicle."""

    order: int  # k; degree k - 1
    control_weight: float  # α_control, 1
    smooth_weight: float  # α_smooth, s²
    static_weight: float  # α_static, m²/s⁴
    min_clearance_m: float
    safe_clearance_m: float
    duration_margin: float
    control_spacing_m: float
    first_iterations: int
    final_iterations: int
    z_band_m: float
    known_only: bool
    limits: Limits


class Curve(NamedTuple):
    """A candidate."""

    control: Float  # (N, 3)
    h: float  # knot spacing, s


class Problem(NamedTuple):
    """What is minimised, but for the duration."""

    basis: Uniform
    settings: Settings
    field: DistanceField
    bounds: Float  # (2, 3)
    path: Float  # (P, 3) that the samples are tied to
    static_weight: float  # α_static
    tether: float  # pull to the path: acceleration² that a deviation of 1 m is worth

    @property
    def inner(self) -> slice:
        """The control points that are free."""
        degree = self.basis.degree
        return slice(degree, len(self.basis.velocity) + 1 - degree)

    @property
    def hard_m(self) -> float:
        """Distance at which the steep part of the obstacle cost begins."""
        return self.settings.min_clearance_m + _HARD_ABOVE_VOXELS * self.field.voxel_size_m


def minimise(problem: Problem, curve: Curve, rounds: int) -> tuple[Curve, bool, int]:
    """Solve up to `rounds` QPs.

    Returns:
        The last iterate, whether the last QP was feasible, and the number of QPs.
    """
    control, h = curve
    points = problem.basis.samples @ control
    apart = ((points[:, None, :] - problem.path[None, :, :]) ** 2).sum(axis=2)
    tied = np.asarray(problem.path[np.argmin(apart, axis=1)])
    solved = 0
    for _ in range(rounds):
        hessian, gradient = local_model(problem, control, h, tied)
        rows, sides = limit_rows(problem, control, h)
        none, open_ = np.zeros(len(sides), dtype=np.int32), np.full(len(sides), -1e30)
        step, _, flag, _ = daqp.solve(hessian, gradient, rows, sides, open_, none)
        solved += 1
        if flag < 1 or not np.isfinite(step).all():
            return Curve(control, h), False, solved
        control, gained = _line_search(problem, control, step.reshape(-1, 3), h, tied)
        if gained < _TOLERANCE:
            break
    return Curve(control, h), True, solved


def merit(problem: Problem, control: Float, h: float, tied: Float) -> float:
    """The cost of eq. 2, with what ties to the path and penalises excess over the limits.

    Args:
        problem: what is minimised.
        control: (N, 3), m.
        h: knot spacing, s.
        tied: (S, 3) where the tether pulls the samples to.
    """
    settings, basis, field = problem.settings, problem.basis, problem.field
    points = basis.samples @ control
    grid = (field.distance, field.origin_m, field.voxel_size_m)
    felt = problem.static_weight * obstacle_cost(points, *grid, settings.safe_clearance_m, problem.hard_m)
    pulled = problem.tether * ((points - tied) ** 2).sum()
    energy = (control * (_energy(problem, h) @ control)).sum()
    limits = settings.limits
    speeds = np.linalg.norm(basis.velocity @ control, axis=1) / (h * limits.max_speed_mps)
    strengths = np.linalg.norm(basis.acceleration @ control, axis=1) / (h * h * limits.max_acceleration_mps2)
    excess = np.maximum(np.concatenate([speeds, strengths]) / _QP_SHARE - 1.0, 0.0).sum()
    return float(energy + h / SAMPLES * (felt + pulled) + _EXCESS_WEIGHT * excess)


def local_model(problem: Problem, control: Float, h: float, tied: Float) -> tuple[Float, Float]:
    """Hessian (3n, 3n) and gradient (3n,) of the cost; variable 3 j + axis moves inner control point j."""
    settings, basis, field = problem.settings, problem.basis, problem.field
    energy, moves = 2.0 * _energy(problem, h), basis.samples[:, problem.inner]
    points = basis.samples @ control
    grid = (field.distance, field.origin_m, field.voxel_size_m)
    frame = frames(basis.tangents @ control)
    slope, bend = obstacle_model(points, frame, *grid, settings.safe_clearance_m, problem.hard_m)
    share = h / SAMPLES
    slope = share * (problem.static_weight * slope + 2.0 * problem.tether * (points - tied))
    bend = share * (problem.static_weight * bend + 2.0 * problem.tether * np.eye(3))
    n = moves.shape[1]
    hessian = np.zeros((n, 3, n, 3))
    for a in range(3):
        hessian[:, a, :, a] = energy[problem.inner, problem.inner]
        for b in range(3):
            hessian[:, a, :, b] += moves.T @ (bend[:, a, b, None] * moves)
    gradient = (energy @ control)[problem.inner] + moves.T @ slope
    return hessian.reshape(3 * n, 3 * n) + 1e-6 * np.eye(3 * n), gradient.reshape(-1)


def limit_rows(problem: Problem, control: Float, h: float) -> tuple[Float, Float]:
    """Rows (R, 3n) and right sides (R,) of the QP: speed, acceleration and flight bounds.

    Half spaces that touch the ball of a limit hold it, so a QP without solution means that
    the limits cannot be kept; five around each vector bound by how much it can exceed them.
    """
    limits, basis, inner = problem.settings.limits, problem.basis, problem.inner
    free = control[inner].reshape(-1)
    rows, sides = [], []
    for stencil, limit in (
        (basis.velocity, _QP_SHARE * limits.max_speed_mps * h),
        (basis.acceleration, _QP_SHARE * limits.max_acceleration_mps2 * h * h),
    ):
        vectors = stencil @ control
        movable = np.abs(stencil[:, inner]).max(axis=1) > 0.0
        near = np.flatnonzero(movable & (np.linalg.norm(vectors, axis=1) > _NEAR_LIMIT * limit))
        normals = np.einsum("fe,kea->kfa", FAN, frames(vectors[near]))
        row = stencil[near][:, None, inner, None] * normals[:, :, None, :]
        rows.append(row.reshape(len(near) * len(FAN), len(free)))
        sides.append((limit - np.einsum("kfa,ka->kf", normals, vectors[near])).reshape(-1))
    for sign, bound in ((-1.0, problem.bounds[0]), (1.0, problem.bounds[1])):
        room = sign * (np.tile(bound, len(free) // 3) - free)
        near = np.flatnonzero(room < _NEAR_BOUND_M)
        rows.append(sign * np.eye(len(free))[near])
        sides.append(room[near])
    return np.concatenate(rows), np.concatenate(sides)


def _energy(problem: Problem, h: float) -> Float:
    """Matrix (N, N) of α_control ∫ ‖r''‖² + α_smooth ∫ ‖r'''‖²."""
    settings, basis = problem.settings, problem.basis
    return np.asarray(
        settings.control_weight / h**3 * basis.effort + settings.smooth_weight / h**5 * basis.jerk
    )


def _line_search(problem: Problem, control: Float, step: Float, h: float, tied: Float) -> tuple[Float, float]:
    """Go the first of a few shares of a step (n, 3) that lowers the merit; by what share of it."""
    present = merit(problem, control, h, tied)
    for share in _SHARES:
        trial = control.copy()
        trial[problem.inner] += share * step
        value = merit(problem, trial, h, tied)
        if value < present:
            return trial, (present - value) / present
    return control, 0.0
