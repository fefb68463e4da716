"""The state that a curve begins with: what of it is along a path, and what it makes unavoidable."""

from __future__ import annotations

import math

import numpy as np

from uavexp.arrays import Float
from uavexp.planner.shape.timing import STEP_M
from uavexp.types import Limits, PlanRequest

REST_MPS = 0.05  # a slower start counts as standing
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
    length = float(np.linalg.norm(ahead))
    along = float(velocity_mps @ ahead) / length if length > 1e-9 else 0.0
    across = math.sqrt(max(float(velocity_mps @ velocity_mps) - along**2, 0.0))
    # a vehicle moving away needs v/a to stop and sqrt(2) v/a to come back
    lost = across + (1.0 + math.sqrt(2.0)) * max(-along, 0.0)
    return max(along, 0.0), lost / max_acceleration_mps2
