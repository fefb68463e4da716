"""The B-spline QP: least energy in the corridor, within the limits.

    min Pᵀ Q P   s.t.   p, v, a at both ends;  every Bezier point of span m in region m;
                        ‖V_i‖ <= v_max, ‖A_i‖ <= a_max for the control points of r' and r''

A curve lies in the hull of its control points, so the curve keeps what they keep. The end conditions
fix three control points at each end and leave the problem: unknown are the inner ones.

The norms make it a second-order cone program. It is solved by its outer approximation (Kelley
1960): a QP, and for each control point whose norm is beyond its limit the half-space n V <= 0.99 limit
with n its direction, until none is. The loss is 1 %; a fixed inner polyhedron of 26 faces, with more
rows, loses up to 9 %, bounds per axis 42 %. QPs by daqp, an exact dual active-set method.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavexp.arrays import Float, Int
from uavexp.planner.shape.flight_corridor import Corridor
from uavexp.planner.shape.qp import INFEASIBLE, solve_qp
from uavexp.planner.spline.clamped import Basis, end_points

_CUT = 0.99  # share of the limit at which a cut is made: what is within the limit needs none
_TOLERANCE = 1e-7  # relative, of a limit
_NEAR_M = 0.6  # faces further from the path than this wait until they are violated
_SLACK_M = 1e-6  # of the corridor: daqp's own tolerance
_PINNED = 3  # control points fixed at each end


class Problem(NamedTuple):
    """One QP but for its duration."""

    basis: Basis
    corridor: Corridor
    guess: Float  # (N, 3) control points: unknown is what is added to them
    start: Float  # (3, 3) position, velocity, acceleration
    end: Float  # (3, 3)
    max_speed: float  # m/s
    max_acceleration: float  # m/s²


class Cuts(NamedTuple):
    """Half-spaces of the limits so far; they hold for any duration."""

    order: Int  # (K,) derivative: 1 or 2
    point: Int  # (K,) its control point
    direction: Float  # (K, 3) unit


NO_CUTS = Cuts(np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros((0, 3)))


class Solution(NamedTuple):
    """Answer of `solve`."""

    control: Float | None  # (N, 3); None when there is none
    cuts: Cuts
    solves: int  # QPs
    reason: str  # "corridor", "limits" or "solver"; empty with a control


def solve(problem: Problem, h: float, cuts: Cuts, rounds: int) -> Solution:
    """Solve for spans of `h` seconds, in at most `rounds` QPs, starting from known cuts."""
    basis = problem.basis
    guess = problem.guess.copy()
    pinned = end_points(basis, h, problem.start, problem.end)
    guess[:_PINNED], guess[-_PINNED:] = pinned[:_PINNED], pinned[_PINNED:]
    free = slice(_PINNED, len(guess) - _PINNED)
    hessian = np.asarray(np.kron(basis.energy[free, free], np.eye(3)), dtype=np.float64)
    gradient = np.asarray((basis.energy @ guess)[free].ravel(), dtype=np.float64)
    weight, normal, side = corridor_rows(basis, problem.corridor, guess)
    used = side < _NEAR_M
    matrices = (basis.velocity / h, basis.acceleration / h**2)
    limits = (problem.max_speed, problem.max_acceleration)
    for count in range(1, rounds + 1):
        rows, sides = [_expand(weight[used][:, free], normal[used])], [side[used]]
        for order in (1, 2):
            mine = cuts.order == order
            at, along = matrices[order - 1][cuts.point[mine]], cuts.direction[mine]
            rows.append(_expand(at[:, free], along))
            sides.append(_CUT * limits[order - 1] - np.einsum("ki,ki->k", at @ guess, along))
        step, flag = solve_qp(hessian, gradient, np.concatenate(rows), np.concatenate(sides))
        if flag != 1:
            if len(cuts.order):  # daqp may cycle (-2) on many cuts that hardly leave room
                return Solution(None, cuts, count, "limits")
            return Solution(None, cuts, count, "corridor" if flag in INFEASIBLE else "solver")
        control = guess.copy()
        control[free] += step.reshape(-1, 3)
        violated = ~used & (np.einsum("ri,ri->r", weight @ (control - guess), normal) > side + _SLACK_M)
        used |= violated
        new = _beyond(control, matrices, limits)
        if not violated.any() and not len(new.order):
            return Solution(control, cuts, count, "")
        cuts = Cuts(*(np.concatenate(pair) for pair in zip(cuts, new, strict=True)))
    return Solution(None, cuts, rounds, "limits")


def corridor_rows(basis: Basis, corridor: Corridor, guess: Float) -> tuple[Float, Float, Float]:
    """Weights (R, N), normals (R, 3) and what is left (R,) of faces for the Bezier points of their spans.

    Points that the end conditions fix have no row.
    """
    faces = np.diff(corridor.first)
    span = np.repeat(np.arange(len(faces)), faces)  # of each face
    points = basis.degree + 1
    weight = basis.bezier[span].reshape(-1, basis.bezier.shape[2])  # face-major, then Bezier point
    normal = np.repeat(corridor.normal, points, axis=0)
    offset = np.repeat(corridor.offset, points)
    side = offset - np.einsum("ri,ri->r", weight @ guess, normal)
    movable = np.abs(weight[:, _PINNED:-_PINNED]).max(axis=1) > 1e-12
    return weight[movable], normal[movable], side[movable]


def _expand(weight: Float, direction: Float) -> Float:
    """Rows (R, 3 n) over the flattened unknowns, of weights (R, n) and directions (R, 3)."""
    return (weight[:, :, None] * direction[:, None, :]).reshape(len(weight), 3 * weight.shape[1])


def _beyond(control: Float, matrices: tuple[Float, Float], limits: tuple[float, float]) -> Cuts:
    """A cut for every control point of a derivative that is beyond its limit and can be moved."""
    order, point, direction = [], [], []
    for k, (matrix, limit) in enumerate(zip(matrices, limits, strict=True), start=1):
        values = matrix @ control
        norms = np.linalg.norm(values, axis=1)
        fixed = _PINNED - k  # control points of the derivative that the end conditions fix
        norms[:fixed] = norms[len(norms) - fixed :] = 0.0
        beyond = np.flatnonzero(norms > limit * (1.0 + _TOLERANCE))
        order.append(np.full(len(beyond), k))
        point.append(beyond)
        direction.append(values[beyond] / norms[beyond, None])
    return Cuts(np.concatenate(order), np.concatenate(point), np.concatenate(direction))
