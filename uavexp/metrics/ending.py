"""How the flight ended."""

from __future__ import annotations

from uavexp.log import TrialLog
from uavexp.metrics.metric import SUCCESS, Metric, Metrics
from uavexp.types import Outcome

ARRIVED = (Outcome.REACHED, Outcome.EXPLORED, Outcome.INSPECTED)


def success(log: TrialLog) -> bool:
    """Whether the mission was done without contact."""
    return log.outcome in ARRIVED and not log.contacts


METRICS: Metrics = {
    Metric(column="outcome"): lambda flight: str(flight.log.outcome),
    Metric(column=SUCCESS, title="Success rate, SR", unit="%", digits=1, better=1, scale=100.0): (
        lambda flight: success(flight.log)
    ),
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
