"""All the numbers of one flight, from its log alone: the union of what the files of this folder declare."""

from __future__ import annotations

from uavexp.log import TrialLog
from uavexp.metrics import (
    barn,
    clearance,
    coverage,
    ending,
    exploration,
    path,
    plan,
    replanning,
    smoothness,
    tracking,
    tracking_movers,
)
from uavexp.metrics.metric import Flight, Metric, Metrics, Values, measured
from uavexp.types import World

METRICS: Metrics = {
    **ending.METRICS,
    **path.METRICS,
    **clearance.METRICS,
    **replanning.METRICS,
    **tracking.METRICS,
    **smoothness.METRICS,
    **plan.METRICS,
    **tracking_movers.METRICS,
    **coverage.METRICS,
    **exploration.METRICS,
    **barn.METRICS,
}
_BY_COLUMN = {metric.column: metric for metric in METRICS}


def evaluate(log: TrialLog, world: World, own: Metrics | None = None, **limits: float) -> Values:
    """Return every metric of a flight; recomputable from a stored log without flying.

    Args:
        log: what the flight left behind; may be empty (an error before the first step).
        world: the truth it was flown in.
        own: a user's metrics besides the shipped ones.
        limits: of `Flight`, where they are not the default.

    Returns:
        One plain value per column. NaN says that a figure does not exist, never that it is zero.
    """
    flight = Flight(log=log, world=world, **limits)
    return measured({**METRICS, **(own or {})}, flight) | replanning.own_causes(log)


def metric_of(column: str) -> Metric:
    """The metric of a column; one that is not shipped is called by its column."""
    return _BY_COLUMN.get(column) or Metric(column=column)
