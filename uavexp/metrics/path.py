"""How far and how fast the vehicle really flew."""

from __future__ import annotations

import numpy as np

from uavexp.arrays import Float
from uavexp.geometry import polyline_length_m
from uavexp.log import TrialLog


def path_length_m(log: TrialLog) -> float:
    """Flown length, Σ_k ‖x_k − x_{k−1}‖ over the true positions, m (Chen et al. 2026, APL)."""
    return polyline_length_m(log.steps.position_m)


def completion_time_s(log: TrialLog) -> float:
    """Flight time T·Δt, T the number of steps flown, s (Chen et al. 2026, CT)."""
    return float(max(log.steps.time_s.shape[0] - 1, 0) * log.step_s)


def speed_mps(log: TrialLog) -> Float:
    """True speed ‖v_k‖ in every row (T,), m/s."""
    return np.asarray(np.linalg.norm(log.steps.velocity_mps, axis=1))


def detour(length_m: float, shortest_m: float) -> float:
    """Flown over true shortest length; 1 is perfect, NaN when there is no shortest path."""
    return length_m / shortest_m if shortest_m > 0.0 else float("nan")
