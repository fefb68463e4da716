"""By how much a trajectory is too fast for the limits, beyond what its start makes unavoidable."""

from __future__ import annotations

import math

import numpy as np

from uavexp.arrays import Float
from uavexp.trajectory import Trajectory, evaluate
from uavexp.types import Limits

_CHECK_S = 0.01
_CHECKED_SHARE = 0.999  # of the limits: room for what lies between two checked instants


def unavoidable(
    velocity_mps: Float, acceleration_mps2: Float, max_acceleration_mps2: float, turn_s: float
) -> tuple[float, float]:
    """Speed and acceleration that no curve with continuous acceleration can avoid after a start.

    Args:
        velocity_mps: (3,) at the start.
        acceleration_mps2: (3,) at the start.
        max_acceleration_mps2: with which the speed is taken back.
        turn_s: time that the acceleration has to turn against the motion.
    """
    fast, strong = float(np.linalg.norm(velocity_mps)), float(np.linalg.norm(acceleration_mps2))
    rising = max(float(velocity_mps @ acceleration_mps2) / fast, 0.0) if fast > 0.0 else 0.0
    return fast + rising**2 * turn_s / (2.0 * (rising + max_acceleration_mps2)), strong


def instants(trajectory: Trajectory) -> Float:
    """Times (T,) at which a trajectory is checked: evenly, at most `_CHECK_S` apart, and its breaks."""
    count = max(math.ceil(trajectory.duration_s / _CHECK_S), 1) + 1
    even = np.linspace(trajectory.start_s, trajectory.end_s, count)
    return np.union1d(even, trajectory.breaks_s)


def limit_excess(trajectory: Trajectory, limits: Limits, turn_s: float) -> float:
    """By what factor a trajectory is too fast for the limits; <= 1 when it keeps them.

    What no continuation of its start with continuous acceleration can avoid is allowed.

    Args:
        trajectory: from the requested start.
        limits: of the vehicle.
        turn_s: time that the acceleration has to turn against the motion.
    """
    _, velocity, acceleration = evaluate(trajectory, instants(trajectory))
    fast, strong = unavoidable(velocity[0], acceleration[0], limits.max_acceleration_mps2, turn_s)
    top = max(_CHECKED_SHARE * limits.max_speed_mps, fast * (1.0 + 1e-9))
    most = max(_CHECKED_SHARE * limits.max_acceleration_mps2, strong * (1.0 + 1e-9))
    too_fast = float(np.linalg.norm(velocity, axis=1).max()) / top
    too_strong = float(np.linalg.norm(acceleration, axis=1).max()) / most
    return max(too_fast, math.sqrt(too_strong))
