"""Stopping in a straight line with bounded acceleration and jerk.

The acceleration runs linearly from the present one to a constant deceleration against the
motion, stays there, and runs linearly to zero: three cubic pieces, continuous in position,
velocity and acceleration. The jerk is what turning the thrust vector at the vehicle's
body-rate limit gives, g * rate (small tilt).
"""

from __future__ import annotations

import math

import numpy as np

from uavexp.arrays import Float
from uavexp.geometry import GRAVITY_MPS2
from uavexp.trajectory import Trajectory, evaluate, join
from uavexp.types import Limits

REST_MPS = 0.05  # slower is standing
_SHORTEST_PIECE_S = 1e-6
_HOLD_S = 0.1  # length of the trajectory of a vehicle that already stands


def stopping_distance_m(speed_mps: float, limits: Limits) -> float:
    """Distance in which `braking_trajectory` stops from this speed in unaccelerated flight.

    v²/(2a) + v a/(2j), or v sqrt(v/j) when the speed is too low to reach the full deceleration.
    """
    jerk = jerk_mps3(limits)
    acceleration = limits.max_acceleration_mps2
    if speed_mps * jerk < acceleration**2:
        return speed_mps * math.sqrt(speed_mps / jerk)
    return 0.5 * speed_mps * (speed_mps / acceleration + acceleration / jerk)


def braking_trajectory(
    time_s: float, position_m: Float, velocity_mps: Float, acceleration_mps2: Float, limits: Limits
) -> Trajectory:
    """Trajectory from this state to rest, as short as acceleration and jerk limits allow.

    The path is straight when the acceleration is along the velocity, nearly so otherwise.
    The acceleration never exceeds the limit (or the present one, if that is larger already);
    the speed never exceeds the present one by more than |acceleration|² / (2 jerk).

    Args:
        time_s: absolute time of the state.
        position_m: (3,).
        velocity_mps: (3,).
        acceleration_mps2: (3,).
        limits: of the vehicle.

    Returns:
        A trajectory of at most three cubic pieces, at rest at its end.
    """
    strongest = limits.max_acceleration_mps2
    jerk = jerk_mps3(limits)
    if _surplus(strongest, velocity_mps, acceleration_mps2, jerk) <= 0.0:
        deceleration = strongest
    else:  # full deceleration would be too much: bisect for the one without a constant phase
        low, deceleration = 0.0, strongest
        for _ in range(60):
            middle = 0.5 * (low + deceleration)
            if _surplus(middle, velocity_mps, acceleration_mps2, jerk) > 0.0:
                deceleration = middle
            else:
                low = middle
    rise_s, momentum = _rise(deceleration, velocity_mps, acceleration_mps2, jerk)
    fall_s = deceleration / jerk
    speed = float(np.linalg.norm(momentum))
    if speed <= 1e-9:  # the ramp to zero acceleration alone stops the vehicle, or it stands
        durations, wanted = [rise_s, 0.0, 0.0], np.zeros(3)
    else:
        constant_s = max(speed / deceleration - 0.5 * (rise_s + fall_s), 0.0)
        # recomputed from the durations so that the end velocity is zero to rounding
        wanted = -momentum / (0.5 * rise_s + constant_s + 0.5 * fall_s)
        durations = [rise_s, constant_s, fall_s]
    if max(durations) < _SHORTEST_PIECE_S:  # it all but stands, and could stop at once
        acceleration_mps2, velocity_mps, wanted = np.zeros(3), np.zeros(3), np.zeros(3)
        durations = [_HOLD_S, 0.0, 0.0]
    return _pieces(time_s, position_m, velocity_mps, (acceleration_mps2, wanted), durations)


def jerk_mps3(limits: Limits) -> float:
    """Jerk at which the thrust vector turns at the body rate limit."""
    return GRAVITY_MPS2 * limits.max_body_rate_radps


def _rise(deceleration: float, velocity: Float, acceleration: Float, jerk: float) -> tuple[float, Float]:
    """Duration of the first ramp, and the velocity (3,) that the later phases must take away."""
    rise_s = (float(np.linalg.norm(acceleration)) + deceleration) / jerk
    momentum = velocity + 0.5 * rise_s * acceleration
    for _ in range(10):  # the ramp's length depends on the direction it turns to
        speed = float(np.linalg.norm(momentum))
        target = -deceleration * momentum / speed if speed > 1e-12 else np.zeros(3)
        rise_s = float(np.linalg.norm(target - acceleration)) / jerk
        momentum = velocity + 0.5 * rise_s * acceleration
    return rise_s, momentum


def _surplus(deceleration: float, velocity: Float, acceleration: Float, jerk: float) -> float:
    """Velocity that both ramps take away beyond what there is; > 0: weaken the deceleration."""
    rise_s, momentum = _rise(deceleration, velocity, acceleration, jerk)
    return 0.5 * deceleration * (rise_s + deceleration / jerk) - float(np.linalg.norm(momentum))


def _pieces(
    time_s: float, position: Float, velocity: Float, knots: tuple[Float, Float], durations: list[float]
) -> Trajectory:
    """Trajectory whose acceleration is linear between present, wanted, wanted and zero."""
    start, wanted = knots
    breaks, coefficients = [time_s], []
    accelerations = [start, wanted, wanted, np.zeros(3)]
    position, velocity = position.astype(np.float64), velocity.astype(np.float64)
    for k, duration in enumerate(durations):
        if duration < _SHORTEST_PIECE_S:
            continue
        jerk = (accelerations[k + 1] - accelerations[k]) / duration
        coefficients.append(np.stack([position, velocity, 0.5 * accelerations[k], jerk / 6.0]))
        position = position + duration * (
            velocity + duration * (0.5 * accelerations[k] + duration * jerk / 6.0)
        )
        velocity = velocity + duration * (accelerations[k] + 0.5 * duration * jerk)
        breaks.append(breaks[-1] + duration)
    return Trajectory(breaks_s=np.array(breaks), coefficients=np.stack(coefficients), at_rest=True)


def with_stop(trajectory: Trajectory, limits: Limits) -> Trajectory:
    """The trajectory, with a stop after its end when it does not end at rest.

    What is flown when no further plan arrives, so triggers and the brake watch it too.
    """
    if trajectory.at_rest:
        return trajectory
    end_s = trajectory.end_s
    position, velocity, acceleration = evaluate(trajectory, np.array([end_s]))
    stop = braking_trajectory(end_s, position[0], velocity[0], acceleration[0], limits)
    return join(trajectory, stop)
