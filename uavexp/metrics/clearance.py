"""How near the vehicle came to what is there, and how often it touched it."""

from __future__ import annotations

import numpy as np

from uavexp.arrays import Float
from uavexp.log import TrialLog
from uavexp.metrics.metric import Metric, Metrics


def smallest_m(clearance_m: Float) -> float:
    """Smallest of a series of clearances (T,), m; NaN of an empty one (Chen et al. 2026, MC)."""
    return float(clearance_m.min()) if clearance_m.size else float("nan")


def time_below_s(log: TrialLog, safety_threshold_m: float) -> float:
    """Flight time with the true clearance of the body centre below a threshold, s.

    The number of steps that ended below it times Δt (the start is no step). Chen et al.
    2026 draw such a threshold in figure 8 and never state it.
    """
    return float(np.count_nonzero(log.steps.clearance_m[1:] < safety_threshold_m)) * log.step_s


def contact_time_s(log: TrialLog) -> float:
    """Time in contact with true geometry, Σ (end − start), s.

    A contact that the flight did not outlast ends with the last row.
    """
    if not log.contacts:
        return 0.0
    last_s = float(log.steps.time_s[-1])
    return sum(float(np.fmin(contact.end_s, last_s)) - contact.start_s for contact in log.contacts)


METRICS: Metrics = {
    Metric(column="collision_count", title="Collisions, CC", better=-1, is_count=True): (
        lambda flight: len(flight.log.contacts)
    ),
    Metric(column="contact_time_s", title="Time in contact", unit="s", better=-1): (
        lambda flight: contact_time_s(flight.log)
    ),
    Metric(
        column="min_clearance_m",
        title="Min. clearance, MC",
        unit="m",
        digits=3,
        better=1,
        missing="the flight never began",
    ): lambda flight: smallest_m(flight.log.steps.clearance_m),
    Metric(
        column="min_clearance_esdf_m",
        title="Min. clearance in the map (ESDF)",
        unit="m",
        digits=3,
        better=1,
        missing="the flight never began",
    ): lambda flight: smallest_m(flight.log.ticks.esdf_clearance_m),
    Metric(column="safety_threshold_m", title="Safe clearance", unit="m"): (
        lambda flight: flight.safety_threshold_m
    ),
    Metric(column="time_below_safety_s", title="Time below safe clearance", unit="s", better=-1): (
        lambda flight: time_below_s(flight.log, flight.safety_threshold_m)
    ),
}
