"""How well the vehicle followed its reference, and how well it knew where it was."""

from __future__ import annotations

import numpy as np

from uavexp.arrays import Float
from uavexp.log import TrialLog
from uavexp.metrics.metric import Metric, Metrics


def distances_m(position_m: Float, other_m: Float) -> Float:
    """Distance (T,) between two paths (T, 3) at equal times, m."""
    return np.asarray(np.linalg.norm(position_m - other_m, axis=1))


def tracking_m(log: TrialLog) -> Float:
    """Distance (T,) of the flown from the reference position, m."""
    return distances_m(log.steps.position_m, log.steps.reference_position_m)


def rmse_m(distance_m: Float) -> float:
    """Root of the mean of squares of distances (T,), m; NaN of an empty series.

    With the distances between flown (true) and reference position it is the tracking
    error TE of Chen et al. 2026.
    """
    return float(np.sqrt(np.mean(distance_m**2))) if distance_m.size else float("nan")


METRICS: Metrics = {
    Metric(
        column="tracking_error_m",
        title="Tracking error, TE",
        unit="m RMSE",
        digits=3,
        better=-1,
        needs_arrival=True,  # after a collision it is the distance from a reference that flies on alone
        missing="the flight never began",
    ): lambda flight: rmse_m(tracking_m(flight.log)),
    Metric(
        column="tracking_error_max_m",
        title="Largest tracking error",
        unit="m",
        better=-1,
        missing="the flight never began",
    ): lambda flight: float(tracking_m(flight.log).max()) if flight.log.steps.time_s.size else float("nan"),
    Metric(
        column="estimate_error_m",
        title="Error of the estimate",
        unit="m RMSE",
        digits=3,
        better=-1,
        missing="the flight never began",
    ): lambda flight: rmse_m(distances_m(flight.log.steps.position_m, flight.log.steps.estimated_position_m)),
}
