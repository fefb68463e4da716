"""A row per metric, a column per arm: mean ± standard deviation [interval], the paper's number beside."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import product

from uavexp.metrics.metric import Metric
from uavexp.report import number_format
from uavexp.report.comparison import estimate
from uavexp.report.results import FAILED, INTERVALS, Results
from uavexp.report.tables.base import Table

_SPREAD = (
    "Mean ± standard deviation over trials; of the success rate over the scenes' rates. Trials that failed "
    "count with what they flew until then."
)


def table(
    results: Results, *, name: str, metrics: Sequence[Metric], title: str = "", notes: Sequence[str] = ()
) -> Table:
    """How each arm did, by metric."""
    panel = results.panel
    flown = ("Trials, n", *(str(panel.n(arm)) for arm in panel.arms))
    rows = [
        (metric.label, *(_cell(results, metric, arm) for arm in panel.arms))
        for metric in results.occurring(metrics)
    ]
    return Table(
        name=name,
        title=title or results.study.title or "How each arm did",
        columns=("", *panel.arms),
        rows=(flown, *rows),
        notes=(*results.notes, *notes, _SPREAD, INTERVALS, FAILED, *_printed_notes(results, metrics)),
        means=tuple(metrics),
    )


def _cell(results: Results, metric: Metric, arm: str) -> str:
    panel, printed = results.panel, results.printed.get((metric.column, arm))
    found = number_format.mean_with_spread(estimate(panel, metric, arm), metric, panel.n(arm))
    if printed is None:
        return found
    spread = f" ± {printed.sd:g}" if math.isfinite(printed.sd) else ""
    return f"{found} (paper: {printed.mean:g}{spread})"


def _printed_notes(results: Results, metrics: Sequence[Metric]) -> Iterator[str]:
    for metric, arm in product(metrics, results.panel.arms):
        printed = results.printed.get((metric.column, arm))
        if printed and len(printed.notes) > 1:
            yield f"Paper, {arm}, {metric.label}: {printed.notes}."
