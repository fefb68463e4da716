"""How far and how fast the vehicle really flew."""

from __future__ import annotations

import math

import numpy as np

from uavexp.arrays import Float
from uavexp.geometry import polyline_length_m
from uavexp.log import TrialLog
from uavexp.metrics.ending import success
from uavexp.metrics.metric import Flight, Metric, Metrics


def path_length_m(log: TrialLog) -> float:
    """Flown length, Σ_k ‖x_k − x_{k−1}‖ over the true positions, m (Chen et al. 2026, APL)."""
    return polyline_length_m(log.steps.position_m)


def completion_time_s(log: TrialLog) -> float:
    """Flight time T·Δt, T the number of steps flown, s (Chen et al. 2026, CT)."""
    return float(max(log.steps.time_s.shape[0] - 1, 0) * log.step_s)


def speed_mps(log: TrialLog) -> Float:
    """True speed ‖v_k‖ in every row (T,), m/s."""
    return np.asarray(np.linalg.norm(log.steps.velocity_mps, axis=1))


def mean_speed_mps(log: TrialLog) -> float:
    """Flown length over flight time, m/s; 0 without any."""
    time_s = completion_time_s(log)
    return path_length_m(log) / time_s if time_s > 0.0 else 0.0


def detour(length_m: float, shortest_m: float) -> float:
    """Flown over true shortest length; 1 is perfect, NaN when there is no shortest path."""
    return length_m / shortest_m if shortest_m > 0.0 else float("nan")


def success_by_path_length(flight: Flight) -> float | None:
    """Success x shortest / flown length, SPL, in [0, 1]; a contact is a failure (Anderson et al. 2018).

    None for a mission without a target, NaN where no shortest path is known.
    """
    log, shortest_m = flight.log, float(flight.world.difficulty.shortest_path_m)
    if math.isfinite(log.seen_share) or log.inspection.cell_m.size:
        return None
    if not success(log):
        return 0.0
    longer_m = max(path_length_m(log), shortest_m)
    return shortest_m / longer_m if longer_m > 0.0 else float("nan")


METRICS: Metrics = {
    Metric(
        column="path_length_m", title="Path length, APL", unit="m", digits=1, better=-1, needs_arrival=True
    ): lambda flight: path_length_m(flight.log),
    Metric(
        column="shortest_path_m", title="Shortest path", unit="m", digits=1, missing="none is known"
    ): lambda flight: float(flight.world.difficulty.shortest_path_m),
    Metric(
        column="detour",
        title="Path / shortest path",
        better=-1,
        needs_arrival=True,
        missing="no shortest path is known",
    ): lambda flight: detour(path_length_m(flight.log), float(flight.world.difficulty.shortest_path_m)),
    Metric(
        column="spl",
        title="Success by path length, SPL",
        digits=3,
        better=1,
        missing="no shortest path is known",
    ): success_by_path_length,
    Metric(
        column="completion_time_s",
        title="Completion time, CT",
        unit="s",
        digits=1,
        better=-1,
        needs_arrival=True,
    ): lambda flight: completion_time_s(flight.log),
    Metric(column="mean_speed_mps", title="Mean speed", unit="m/s"): lambda flight: mean_speed_mps(
        flight.log
    ),
    Metric(column="max_speed_mps", title="Largest speed", unit="m/s"): (
        lambda flight: float(speed_mps(flight.log).max(initial=0.0))
    ),
}
