"""References along a trajectory, for as many steps as are asked for at once.

A row (14,) is what the controller is asked to follow in one step: position, velocity, acceleration, yaw,
yaw rate and jerk.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from uavexp.arrays import Float
from uavexp.geometry import wrap_angle
from uavexp.pace import evaluate_paced
from uavexp.pilot.heading import bearing_rad, free_glance_rad, glanced_rad, rate_to
from uavexp.trajectory import evaluate_pieces
from uavexp.types import Reference


@nb.njit(cache=True)
def follow(
    breaks_s: Float,
    coefficients: Float,
    pace: tuple[Float, Float, Float],
    times_s: Float,
    moves_s: float,
    lookahead_s: float,
    wanted_rad: float,
    yaw_rad: float,
    most_radps: float,
    step_s: float,
    glance_rad: float,
    most_glance_rad: float,
) -> Float:
    """Rows (N, 14) of the steps at times (N,), the yaw turning from step to step.

    Args:
        breaks_s: of the `Trajectory`.
        coefficients: of the same.
        pace: times, own times and rates of the `Pace` at which it is flown.
        times_s: (N,) a step apart, increasing.
        moves_s: before, the trajectory only turns: what lies ahead begins there.
        lookahead_s: how far ahead the yaw looks, in the trajectory's own time: where the flight goes,
            however slowly.
        wanted_rad: the yaw that the goal asks for; NaN: none.
        yaw_rad: before the first step.
        most_radps: fastest turn.
        step_s: of a step.
        glance_rad: bearing of whom to look at on the way; NaN: nobody.
        most_glance_rad: by which the yaw leaves the way for it at most, but where the flight is slow.
    """
    now_s, position, velocity, acceleration, jerk = evaluate_paced(breaks_s, coefficients, pace, times_s)
    ahead_s = np.minimum(np.maximum(now_s, moves_s) + lookahead_s, np.maximum(now_s, breaks_s[-1]))
    ahead = evaluate_pieces(breaks_s, coefficients, ahead_s)[0] - position
    rows = np.zeros((len(times_s), 14))
    rows[:, 0:3], rows[:, 3:6], rows[:, 6:9], rows[:, 11:14] = position, velocity, acceleration, jerk
    for n in range(len(times_s)):
        bearing = bearing_rad(wanted_rad, ahead[n])
        if math.isnan(wanted_rad) and not math.isnan(glance_rad):
            speed_mps = math.sqrt((velocity[n] ** 2).sum())
            bearing = glanced_rad(bearing, glance_rad, max(most_glance_rad, free_glance_rad(speed_mps)))
        if not math.isnan(bearing):
            rows[n, 10] = rate_to(bearing, yaw_rad, most_radps)
            yaw_rad = wrap_angle(yaw_rad + rows[n, 10] * step_s)
        rows[n, 9] = yaw_rad
    return rows


def row_of(reference: Reference) -> Float:
    """The row (14,) of a reference."""
    motion = (reference.position_m, reference.velocity_mps, reference.acceleration_mps2)
    turn = (reference.yaw_rad, reference.yaw_rate_radps)
    return np.concatenate([*motion, turn, reference.jerk_mps3])


def reference_of(row: Float) -> Reference:
    """The reference in a row (14,)."""
    return Reference(
        position_m=row[0:3],
        velocity_mps=row[3:6],
        acceleration_mps2=row[6:9],
        yaw_rad=float(row[9]),
        yaw_rate_radps=float(row[10]),
        jerk_mps3=row[11:14],
    )
