"""The state that a curve begins with: what of it is along a path, and what it makes unavoidable."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from uavexp.arrays import Float
from uavexp.braking import stopping_distance_m
from uavexp.planner.shape.timing import STEP_M
from uavexp.types import Limits, PlanRequest

TANGENT_M = 1.0  # length over which the first and last direction of a path is taken
SHORTEST_S = 0.2  # of a curve to where the vehicle is: h² of a shorter one drowns in rounding
_EXCESS = 1.1  # a start beyond a limit by more than this factor is refused


def state_of(request: PlanRequest) -> Float:
    """Position, velocity and acceleration (3, 3) asked for."""
    return np.stack([request.position_m, request.velocity_mps, request.acceleration_mps2])


def refusal(start: Float, limits: Limits) -> str:
    """Why no curve can begin in a state (3, 3); "" when one may."""
    speed, strength = float(np.linalg.norm(start[1])), float(np.linalg.norm(start[2]))
    if speed <= _EXCESS * limits.max_speed_mps and strength <= _EXCESS * limits.max_acceleration_mps2:
        return ""
    return f"the start has {speed:.2f} m/s and {strength:.2f} m/s²"


def on_path(path_m: Float, velocity_mps: Float, max_acceleration_mps2: float) -> tuple[float, float]:
    """Speed along a path (P, 3), `STEP_M` apart, m/s, and the time lost to what of it is not, s."""
    ahead = path_m[min(round(TANGENT_M / STEP_M), len(path_m) - 1)] - path_m[0]
    length = math.sqrt(float(ahead @ ahead))
    along = float(velocity_mps @ ahead) / length if length > 1e-9 else 0.0
    across = math.sqrt(max(float(velocity_mps @ velocity_mps) - along**2, 0.0))
    # a vehicle moving away needs v/a to stop and sqrt(2) v/a to come back
    lost = across + (1.0 + math.sqrt(2.0)) * max(-along, 0.0)
    return max(along, 0.0), lost / max_acceleration_mps2


def end_velocity(
    along_m: Float,
    travel_m: float,
    start_mps: Float,
    limits: Limits,
    end_speed_mps: float,
    clear: Callable[[float], bool],
) -> Float:
    """Velocity (3,) along a path's end that can be reached, and stopped from on clear ground, else zero.

    Args:
        along_m: (3,) in the path's last direction.
        travel_m: length of the path.
        start_mps: (3,) velocity at its start.
        limits: of the vehicle.
        end_speed_mps: wanted.
        clear: whether the ground is, for so many metres beyond the end.
    """
    length = float(np.linalg.norm(along_m))
    if length < 1e-6:
        return np.zeros(3)
    start = float(np.linalg.norm(start_mps))
    reachable = math.sqrt(start**2 + limits.max_acceleration_mps2 * travel_m)
    speed = min(end_speed_mps, 0.9 * limits.max_speed_mps, reachable)
    for share in (1.0, 0.7, 0.4):
        if clear(stopping_distance_m(share * speed, limits)):
            return np.asarray(share * speed / length * along_m)
    return np.zeros(3)
