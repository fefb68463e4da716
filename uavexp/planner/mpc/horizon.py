"""Dynamic planner: model predictive control over a short horizon (Jin, Xu et al., eqs. 3a to 3f).

    min Σ ‖x_k - x_ref,k‖² + λ_u Σ ‖u_k‖² + ρ Σ (s_k + 10 s_k²)                                 (3a)
    x_0 = x(t_0), x_k = f(x_{k-1}, u_{k-1}, u_k)                                               (3b, 3c)
    |u_k| <= u_max per axis and ‖u_k‖ <= a_max; ‖v_k‖ <= v_max [ours, the paper has no bound]   (3d)
    |u_k - u_{k-1}| <= j_max dt per axis [ours: what asks for more is not followed, but overshot]
    n · p_k >= b - s_k for the half spaces of `regions`, s_k >= 0, for all k                    (3e, 3f)

x = [p, v], u = a. The input is held to first order, not zeroth: it runs linearly from u_{k-1} to
u_k, with u_0 the present acceleration. So acceleration is continuous where one plan follows on
another, which the controller's feed-forward needs, and a plan is one cubic per step.

Dynamics and cost of one axis are written in CasADi; its matrices are taken once. States are linear in
the inputs and leave the problem. What is not convex (regions, norms) is renewed around the last
iterate a fixed number of times; each QP goes to daqp. A step that cannot keep out of its regions
uses its slack s_k, at a price that is exact: where it can, s_k is zero.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import casadi as ca
import numba as nb
import numpy as np

from uavexp.arrays import Float, Int
from uavexp.braking import jerk_mps3
from uavexp.field import DistanceField
from uavexp.planner.mpc.regions import mover_planes, static_planes
from uavexp.planner.shape.qp import solve_qp
from uavexp.planner.shape.scp_step import NEAR_BOUND_M, NEAR_LIMIT
from uavexp.planner.shape.static_step import touching
from uavexp.trajectory import Trajectory
from uavexp.types import Limits

_SLACK_PRICE, _SLACK_BEND = 200.0, 2000.0  # ρ per m and per m²
_QP_SHARE = 0.97  # of the limits inside the QP: room for its linearisation and between steps


class HorizonModel(NamedTuple):
    """Matrices of one axis, inputs u_1 .. u_N; `start` is [p_0, v_0, u_0]."""

    steps: int
    step_s: float
    hessian: Float  # (N, N) of the cost
    gradient: Float  # (N, 3 + 2N) of the cost at u = 0, times [start, p_ref, v_ref]
    place: Float  # (N, N) p_1 .. p_N = place @ u + place_start @ start
    place_start: Float  # (N, 3)
    speed: Float  # (N, N) v_1 .. v_N = speed @ u + speed_start @ start
    speed_start: Float  # (N, 3)
    change: Float  # (3N, 4N) u_k - u_{k-1} of every axis, of inputs and slacks


class Rollout(NamedTuple):
    """Places, velocities and accelerations at the steps 1 .. N, each (N, 3)."""

    place: Float
    velocity: Float
    acceleration: Float


class Surroundings(NamedTuple):
    """What the motion must keep out of."""

    field: DistanceField
    clearance_m: float  # from mapped obstacles
    movers: Float  # (B, COLUMNS) `moving.MovingObstacles.table`
    bounds_m: Float  # (2, 3)


class Tracked(NamedTuple):
    """Answer of the horizon."""

    motion: Rollout | None  # None: the solver failed
    slack_m: float  # largest depth in a region, as the last QP sees it
    iterations: int  # QPs solved


@cache
def horizon_model(
    steps: int, step_s: float, velocity_weight: float, terminal_weight: float, input_weight: float
) -> HorizonModel:
    """Write the horizon of one axis in CasADi and take its matrices; built once per parameters.

    Args:
        steps: N.
        step_s: dt.
        velocity_weight: of the velocity's part of ‖x - x_ref‖², s².
        terminal_weight: factor on the last step's deviation.
        input_weight: λ_u, s⁴.
    """
    inputs, start, wanted = ca.SX.sym("u", steps), ca.SX.sym("x", 3), ca.SX.sym("r", 2 * steps)
    p, v, a = start[0], start[1], start[2]
    places, speeds, cost = [], [], ca.SX(0)
    for k in range(steps):
        u = inputs[k]
        p, v, a = p + step_s * v + step_s**2 * (2 * a + u) / 6, v + step_s * (a + u) / 2, u
        places.append(p)
        speeds.append(v)
        off = (p - wanted[k]) ** 2 + velocity_weight * (v - wanted[steps + k]) ** 2
        cost += (terminal_weight if k == steps - 1 else 1.0) * off + input_weight * u**2
    hessian, slope = ca.hessian(cost, inputs)
    given = ca.vertcat(start, wanted)
    place, speed = ca.vertcat(*places), ca.vertcat(*speeds)
    parts = [
        hessian,
        ca.jacobian(slope, given),
        ca.jacobian(place, inputs),
        ca.jacobian(place, start),
        ca.jacobian(speed, inputs),
        ca.jacobian(speed, start),
    ]
    matrices = ca.Function("matrices", [], parts)()
    taken = [np.ascontiguousarray(matrices[f"o{n}"].full()) for n in range(len(parts))]
    change = np.kron(np.eye(steps) - np.eye(steps, k=-1), np.eye(3))
    taken.append(np.pad(change, ((0, 0), (0, steps))))
    return HorizonModel(steps, step_s, *taken)


def track(
    model: HorizonModel,
    start: Float,
    wanted: Rollout,
    guess: Rollout,
    around: Surroundings,
    limits: Limits,
    rounds: int,
) -> Tracked:
    """Solve the horizon's problem, linearised `rounds` times.

    Args:
        model: of the horizon.
        start: (3, 3) position, velocity and acceleration now.
        wanted: the reference x_ref.
        guess: motion to linearise around first.
        around: regions, relative to the time of `start`.
        limits: of the vehicle.
        rounds: QPs to be solved.
    """
    n = model.steps
    hessian = np.zeros((4 * n, 4 * n))
    for axis in range(3):
        hessian[axis : 3 * n : 3, axis : 3 * n : 3] = model.hessian
    hessian[3 * n :, 3 * n :] = _SLACK_BEND * np.eye(n)
    given = np.concatenate([start, wanted.place, wanted.velocity])
    gradient = np.concatenate([(model.gradient @ given).reshape(-1), np.full(n, _SLACK_PRICE)])
    most = max(limits.max_acceleration_mps2, float(np.linalg.norm(start[2])))
    # at most so much change of an input per step, the first from the present acceleration on
    change = model.step_s * jerk_mps3(limits)
    present = np.concatenate([start[2], np.zeros(3 * (n - 1))])
    upper = np.concatenate([np.full(3 * n, most), np.full(n, 1e30), present + change])
    lower = np.concatenate([np.full(3 * n, -most), np.zeros(n), present - change])
    motion, slack = guess, np.zeros(n)
    for done in range(rounds):
        rows, least = _rows(model, start, motion, around, limits)
        solution, flag = solve_qp(
            hessian,
            gradient,
            np.concatenate([model.change, rows]),
            np.concatenate([upper, np.full(len(least), 1e30)]),
            np.concatenate([lower, least]),
        )
        if flag < 1:
            return Tracked(None, np.inf, done + 1)
        inputs, slack = solution[: 3 * n].reshape(n, 3), solution[3 * n :]
        motion = roll_out(model, start, inputs)
    return Tracked(motion, float(slack.max()), rounds)


def roll_out(model: HorizonModel, start: Float, inputs: Float) -> Rollout:
    """The motion that inputs (N, 3) make from a start (3, 3)."""
    place = model.place @ inputs + model.place_start @ start
    return Rollout(place, model.speed @ inputs + model.speed_start @ start, inputs)


def to_trajectory(
    model: HorizonModel, start: Float, motion: Rollout, steps: int, start_s: float
) -> Trajectory:
    """The first `steps` >= 1 steps of a motion as a trajectory, a cubic each."""
    knots = [np.concatenate([start[row][None], part[:steps]]) for row, part in enumerate(motion)]
    jerk = np.diff(knots[2], axis=0) / model.step_s
    terms = [knots[0][:-1], knots[1][:-1], knots[2][:-1] / 2.0, jerk / 6.0]
    breaks: Float = start_s + model.step_s * np.arange(steps + 1.0)
    return Trajectory(breaks_s=breaks, coefficients=np.stack(terms, axis=1), at_rest=False)


def _rows(
    model: HorizonModel, start: Float, motion: Rollout, around: Surroundings, limits: Limits
) -> tuple[Float, Float]:
    """Rows (R, 4N) and least values (R,) of the QP around a motion."""
    field = around.field
    ahead_s = model.step_s * np.arange(1.0, model.steps + 1.0)
    grid = (field.distance, field.origin_m, field.voxel_size_m)
    planes = [
        static_planes(motion.place, *grid, around.clearance_m),
        mover_planes(motion.place, motion.velocity, ahead_s, around.movers),
        _bound_planes(motion.place, around.bounds_m),
    ]
    step, normal, bound = (np.concatenate(part) for part in zip(*planes, strict=True))
    free = model.place_start @ start
    keep_out = _assemble(step, normal, bound, model.place, free, True)
    # a start beyond the limit, or driven there by its acceleration, must not make the QP infeasible
    strength = float(np.linalg.norm(start[2]))
    rise = 0.5 * strength * max(model.step_s, strength / jerk_mps3(limits))
    top = max(_QP_SHARE * limits.max_speed_mps, float(np.linalg.norm(start[1])) + rise)
    step, normal, bound = _ball_planes(motion.velocity, top)
    slower = _assemble(step, normal, bound, model.speed, model.speed_start @ start, False)
    step, normal, bound = _ball_planes(motion.acceleration, _QP_SHARE * limits.max_acceleration_mps2)
    weaker = _assemble(step, normal, bound, np.eye(model.steps), np.zeros((model.steps, 3)), False)
    parts = (keep_out, slower, weaker)
    return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])


def _ball_planes(vectors: Float, limit: float) -> tuple[Int, Float, Float]:
    """Half spaces that hold the ball of a norm limit, around vectors (N, 3) that come near it."""
    step = np.flatnonzero(np.linalg.norm(vectors, axis=1) > NEAR_LIMIT * limit)
    normal = -touching(vectors[step])
    return np.repeat(step, normal.shape[1]), normal.reshape(-1, 3), np.full(normal.size // 3, -limit)


def _bound_planes(points: Float, bounds_m: Float) -> tuple[Int, Float, Float]:
    """Half spaces of the flight bounds (2, 3) that places (N, 3) come near."""
    signs = np.array([1.0, -1.0])
    room = signs[:, None] * (points[:, None] - bounds_m)  # (N, 2, 3)
    step, side, axis = np.nonzero(room < NEAR_BOUND_M)
    normal = signs[side, None] * np.eye(3)[axis]
    return step, normal, signs[side] * bounds_m[side, axis]


@nb.njit(cache=True)
def _assemble(
    step: Int, normal: Float, bound: Float, by_input: Float, free: Float, slackened: bool
) -> tuple[Float, Float]:
    """Rows (R, 4N) and least values (R,) of n · (by_input u + free) + s >= b at the half spaces' steps."""
    count, n = len(step), len(by_input)
    rows, least = np.zeros((count, 4 * n)), np.empty(count)
    for m in range(count):
        k = step[m]
        least[m] = bound[m]
        for axis in range(3):
            least[m] -= normal[m, axis] * free[k, axis]
            for j in range(k + 1):
                rows[m, 3 * j + axis] = normal[m, axis] * by_input[k, j]
        if slackened:
            rows[m, 3 * n + k] = 1.0
    return rows, least
