"""How people make way: the social force of Moussaïd et al. 2009, after Helbing and Molnár 1995 (numba).

    dv/dt = (v_desired - v) / τ + Σ f_other + f_wall
    f_other = -A exp(-d/B) [exp(-(n' B θ)²) t + K exp(-(n B θ)²) n]
    D = λ (v_i - v_j) + e,  t = D / |D|,  B = γ |D|

with e the level direction to the other one, d how far it is, θ the angle from D to e (with the small
bias ε B, so that nobody stops dead on), K its sign, and n the normal of t to the left. It slows one that is
met ahead and turns it aside; the other is every other body and the vehicle. f_wall = a exp(-d_wall / b) away
from the nearest surface. Bodies that overlap are pushed apart by k / m times the overlap (Moussaïd et al.
2011). The parameters are those fitted to people in a corridor, and nothing was tuned.

Moussaïd, Helbing, Garnier, Johansson, Combe, Theraulaz, Proc. R. Soc. B 276 (2009), eqs. 2.1 to 3.5;
Moussaïd, Helbing, Theraulaz, PNAS 108 (2011), eq. 3.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from uavexp.arrays import Float, UInt8
from uavexp.movers.motion import ACCELERATED, CIRCULAR, is_blocked
from uavexp.movers.timeline import ROW_S
from uavexp.triangle_grid import TriangleGrid

RELAX_S = 0.54  # τ
_STRENGTH_MPS2, _RANGE_S = 4.5, 0.35  # A, γ
_OF_VELOCITY_S = 2.0  # λ
_TURNS, _SLOWS = 2.0, 3.0  # n, n'
_BIAS = 0.005  # ε
_WALL_MPS2, _WALL_M = 3.0, 0.1  # a, b
_PUSH_PER_S2 = 62.5  # k / m of 5000 kg/s² and 80 kg
_PERSON_M = 0.2  # radius of the people it was fitted to; wider bodies count as so much nearer
_PASSES_M = 0.3  # bodies that are so far above or below each other do not matter


@nb.njit(cache=True)
def force_of(apart: Float, relative: Float, near_m: float) -> Float:
    """Acceleration (2,) by another body, m/s².

    Args:
        apart: (2,) from this body to the other.
        relative: (2,) velocity of this body, seen from the other.
        near_m: by how much both are wider than two people.
    """
    force = np.zeros(2)
    away = math.hypot(apart[0], apart[1])
    if away < 1e-6:
        return force
    ex, ey = apart[0] / away, apart[1] / away
    dx, dy = _OF_VELOCITY_S * relative[0] + ex, _OF_VELOCITY_S * relative[1] + ey
    length = math.hypot(dx, dy)
    if length < 1e-6:
        return force
    tx, ty = dx / length, dy / length
    reach = _RANGE_S * length
    theta = math.atan2(tx * ey - ty * ex, tx * ex + ty * ey) + _BIAS * reach
    strength = _STRENGTH_MPS2 * math.exp(-max(away - near_m, 0.0) / reach)
    slows = strength * math.exp(-((_SLOWS * reach * theta) ** 2))
    turns = strength * math.exp(-((_TURNS * reach * theta) ** 2)) * (1.0 if theta >= 0.0 else -1.0)
    # the left normal of t is (-ty, tx): one that is to the left is passed on the right
    pushes = _PUSH_PER_S2 * max(near_m + 2.0 * _PERSON_M - away, 0.0)
    force[0] = -slows * tx + turns * ty - pushes * ex
    force[1] = -slows * ty - turns * tx - pushes * ey
    return force


@nb.njit(cache=True)
def wall_force(apart: Float, half_m: float) -> Float:
    """Acceleration (2,) by the nearest surface, which lies `apart` (2,) from the body's centre, m/s²."""
    away = math.hypot(apart[0], apart[1])
    if away < 1e-6:
        return np.zeros(2)
    return -_WALL_MPS2 * math.exp(-max(away - half_m, 0.0) / _WALL_M) / away * apart


@nb.njit(cache=True)
def desired_mps(mode: int, state: Float, time_s: float) -> Float:
    """Velocity (3,) that a body would have if nobody were in its way, from its state (10,) of `motion`."""
    wanted = state[3:6].copy()
    if mode == ACCELERATED:
        wanted *= state[6] + state[7] * math.sin(state[8] * time_s + state[9])
    if mode == CIRCULAR:
        x, y = state[0] - state[6], state[1] - state[7]
        away = max(math.hypot(x, y), 1e-6)
        speed = state[8] * state[9]
        back = (state[8] - away) / RELAX_S / away
        wanted[0], wanted[1], wanted[2] = back * x - speed * y / away, back * y + speed * x / away, 0.0
    return wanted


@nb.njit(cache=True)
def _pushed(
    b: int, state: Float, motion: Float, half: Float, wanted: Float, wall: Float, vehicle: Float
) -> Float:
    """Acceleration (2,) of a body."""
    own_m = max(half[b, 0], half[b, 1])
    total = (wanted[:2] - motion[b, :2]) / RELAX_S
    if np.isfinite(wall[b, 0]):
        total += wall_force(wall[b, :2] - state[b, :2], own_m)
    for other in range(state.shape[0]):
        passes = abs(state[other, 2] - state[b, 2]) > half[other, 2] + half[b, 2] + _PASSES_M
        if other != b and not passes:
            near_m = own_m + max(half[other, 0], half[other, 1]) - 2.0 * _PERSON_M
            total += force_of(state[other, :2] - state[b, :2], motion[b, :2] - motion[other, :2], near_m)
    if abs(vehicle[2] - state[b, 2]) <= half[b, 2] + _PASSES_M:  # NaN: there is none
        near_m = own_m + vehicle[6] - 2.0 * _PERSON_M
        total += force_of(vehicle[:2] - state[b, :2], motion[b, :2] - vehicle[3:5], near_m)
    return total


@nb.njit(cache=True)
def advance_among(
    grid: TriangleGrid, low: Float, high: Float, mode: UInt8, half: Float, most_mps: float, state: Float,
    motion: Float, wall: Float, vehicle: Float, first: int, position: Float, velocity: Float,
) -> None:  # fmt: skip
    """Write rows first, first + 1, ... of positions and velocities (K, B, 3) and move everything on.

    Args:
        grid: the fixed surfaces.
        low: (B, 3) least centres.
        high: (B, 3) greatest centres.
        mode: (B,) values of `motion.Mode`.
        half: (B, 3) half sizes.
        most_mps: fastest level speed.
        state: (B, 10) of `motion`, changed in place.
        motion: (B, 3) velocities, changed in place.
        wall: (B, 3) nearest fixed point to each body; inf: none.
        vehicle: (7,) position, velocity and radius at the first row; NaN: there is none.
        first: number of the first row to write.
        position: (K, B, 3) to write.
        velocity: (K, B, 3) to write.
    """
    push = np.zeros((state.shape[0], 2))
    seen = vehicle.copy()
    for row in range(position.shape[0]):
        time_s = (first + row) * ROW_S
        position[row], velocity[row] = state[:, :3], motion
        for b in range(state.shape[0]):
            wanted = desired_mps(mode[b], state[b], time_s)
            push[b] = _pushed(b, state, motion, half, wanted, wall, seen)
            motion[b, 2] = wanted[2]
        seen[:3] += ROW_S * vehicle[3:6]
        for b in range(state.shape[0]):
            motion[b, :2] += ROW_S * push[b]
            speed = math.hypot(motion[b, 0], motion[b, 1])
            if speed > most_mps:
                motion[b, :2] *= most_mps / speed
            velocity[row, b] = motion[b]
            _go(grid, low[b], high[b], half[b], state[b], motion[b])


@nb.njit(cache=True)
def _go(grid: TriangleGrid, low: Float, high: Float, half: Float, state: Float, motion: Float) -> None:
    """Move a body by a row, axis by axis; what is blocked stops it, and turns its way around."""
    for axis in range(3):
        way = motion[axis] * ROW_S
        if way == 0.0:
            continue
        before = state[axis]
        state[axis] += way
        if is_blocked(grid, low, high, half, state[:3]):
            state[axis] = before
            motion[axis] = 0.0
            if state[3 + axis] * way > 0.0:
                state[3 + axis] *= -1.0
