"""Every mean of the other tables, one number to a cell, for machines."""

from __future__ import annotations

from collections.abc import Sequence

from uavexp.metrics.metric import Metric
from uavexp.report.comparison import estimate
from uavexp.report.results import Results
from uavexp.report.tables.base import Table


def table(results: Results, *, name: str, metrics: Sequence[Metric]) -> Table:
    """A row per metric and arm."""
    panel, rows = results.panel, []
    for metric in metrics:
        for arm in panel.arms if panel.has(metric) else ():
            found = estimate(panel, metric, arm)
            numbers = (found.mean, found.sd, *found.interval)
            rows.append((metric.column, arm, str(found.n), *(f"{value:.10g}" for value in numbers)))
    return Table(
        name=name,
        title="Every mean, one number to a cell",
        columns=("metric", "arm", "n", "mean", "sd", "low", "high"),
        rows=tuple(rows),
    )
