"""How the flight ended."""

from __future__ import annotations

import math

import numpy as np

from uavexp.log import TrialLog
from uavexp.metrics.metric import SUCCESS, Flight, Metric, Metrics
from uavexp.types import Outcome

ARRIVED = (Outcome.REACHED, Outcome.EXPLORED, Outcome.INSPECTED)


def success(log: TrialLog) -> bool:
    """Whether the mission was done without contact."""
    return log.outcome in ARRIVED and not log.contacts


def _has_target(flight: Flight) -> bool:
    return math.isnan(flight.log.seen_share)  # which only flights without one measure


def believed_arrival(flight: Flight) -> float:
    """1.0 where the vehicle believed to be at the target before any contact, else 0.0; NaN without a target.

    It is `success` in the vehicle's own frame: an estimate that drifts ends up beside the truth.
    """
    if not _has_target(flight):
        return math.nan
    steps, contacts = flight.log.steps, flight.log.contacts
    untouched = steps.time_s < min((contact.start_s for contact in contacts), default=math.inf)
    gap_m = np.linalg.norm(steps.estimated_position_m[untouched] - flight.world.target_m, axis=1)
    return float(gap_m.min(initial=math.inf) <= flight.arrival_m)


def target_gap_m(flight: Flight) -> float:
    """True distance from the target at the end, m; NaN without a target or a flight."""
    position_m = flight.log.steps.position_m
    if not (_has_target(flight) and len(position_m)):
        return math.nan
    return float(np.linalg.norm(position_m[-1] - flight.world.target_m))


METRICS: Metrics = {
    Metric(column="outcome"): lambda flight: str(flight.log.outcome),
    Metric(column=SUCCESS, title="Success rate, SR", unit="%", digits=1, better=1, scale=100.0): (
        lambda flight: success(flight.log)
    ),
    Metric(
        column="believed_arrival",
        title="Arrived as believed",
        unit="%",
        digits=1,
        better=1,
        scale=100.0,
        missing="the flight had no target",
    ): believed_arrival,
    Metric(
        column="target_gap_m",
        title="True distance from the target at the end",
        unit="m",
        better=-1,
        missing="the flight had no target",
    ): target_gap_m,
    Metric(
        column="seen_share",
        title="Seen of the reachable volume",
        unit="%",
        digits=1,
        better=1,
        scale=100.0,
        missing="the flight had a target",
    ): lambda flight: float(flight.log.seen_share),
}
