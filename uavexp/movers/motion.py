"""How the movers of `mixed` move, step by step (numba).

linear: constant velocity; at a fixed surface or the border each component of the velocity that
    would lead into it is reversed and damped (times `restitution`).
circular: constant speed on a level circle, which is clear all along by its placing.
accelerated: along a straight line with the speed s(t) = mean + swing sin(2 pi t / period);
    at a surface or the border the component is reversed undamped.

A body is blocked where the upright box around it would meet a fixed surface: exact for boxes,
early by up to the box's corners for the round ones. No step into a blocked place is ever
taken, so no body enters a wall. Movers pass through each other.
"""

from __future__ import annotations

import math
from enum import IntEnum

import numba as nb
import numpy as np

from uavexp.arrays import Float, UInt8
from uavexp.movers.timeline import ROW_S
from uavexp.triangle_grid import TriangleGrid, box_meets_mesh


class Mode(IntEnum):
    """How a mover moves."""

    LINEAR = 0
    CIRCULAR = 1
    ACCELERATED = 2


CIRCULAR, ACCELERATED = int(Mode.CIRCULAR), int(Mode.ACCELERATED)  # for kernels
# columns of the state (B, 10): position, direction or velocity, then by mode
# circular: centre x, y, radius, angular rate; accelerated: mean, swing, angular frequency, phase
POSITION, WAY, REST = slice(0, 3), slice(3, 6), slice(6, 10)


@nb.njit(cache=True)
def is_blocked(grid: TriangleGrid, low: Float, high: Float, half: Float, centre: Float) -> bool:
    """Whether a body does not fit in: its centre leaves [low, high], or its box meets a surface."""
    for axis in range(3):
        if centre[axis] < low[axis] or centre[axis] > high[axis]:
            return True
    return bool(box_meets_mesh(grid, centre, np.eye(3), half))


@nb.njit(cache=True)
def _step(
    grid: TriangleGrid, low: Float, high: Float, half: Float, state: Float, speed: float, kept: float
) -> None:
    """Move one body by a row along its way, axis by axis; what is blocked is reversed and damped."""
    for axis in range(3):
        way = speed * state[3 + axis] * ROW_S
        if way == 0.0:
            continue
        before = state[axis]
        state[axis] += way
        if is_blocked(grid, low, high, half, state[:3]):
            state[axis] = before
            state[3 + axis] *= -kept


@nb.njit(cache=True)
def advance(
    grid: TriangleGrid, low: Float, high: Float, mode: UInt8, half: Float, restitution: float,
    state: Float, first: int, position: Float, velocity: Float,
) -> None:  # fmt: skip
    """Write rows first, first + 1, ... of positions and velocities (K, B, 3) and move `state` on.

    Args:
        grid: the fixed surfaces.
        low: (B, 3) least centres.
        high: (B, 3) greatest centres.
        mode: (B,) values of `Mode`.
        half: (B, 3) half sizes.
        restitution: share of the speed kept at a rebound of a linear mover.
        state: (B, 10) at the first row, changed in place; see the module's columns.
        first: number of the first row to write.
        position: (K, B, 3) to write.
        velocity: (K, B, 3) to write.
    """
    for row in range(position.shape[0]):
        time_s = (first + row) * ROW_S
        for b in range(mode.shape[0]):
            if mode[b] == CIRCULAR:
                x, y, radius, rate = state[b, 6], state[b, 7], state[b, 8], state[b, 9]
                angle = math.atan2(state[b, 1] - y, state[b, 0] - x)
                position[row, b] = state[b, :3]
                velocity[row, b, 0] = -radius * rate * math.sin(angle)
                velocity[row, b, 1] = radius * rate * math.cos(angle)
                velocity[row, b, 2] = 0.0
                state[b, 0] = x + radius * math.cos(angle + rate * ROW_S)
                state[b, 1] = y + radius * math.sin(angle + rate * ROW_S)
                continue
            speed, kept = 1.0, restitution
            if mode[b] == ACCELERATED:
                speed = state[b, 6] + state[b, 7] * math.sin(state[b, 8] * time_s + state[b, 9])
                kept = 1.0
            position[row, b] = state[b, :3]
            velocity[row, b] = speed * state[b, 3:6]
            _step(grid, low[b], high[b], half[b], state[b], speed, kept)
