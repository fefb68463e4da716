"""The metrics that reports show, by column: declared in `uavexp.metrics`, in `derived`, or clock times."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from uavexp.config.own_metrics import own_metrics
from uavexp.errors import ConfigError
from uavexp.metrics.evaluate import METRICS, metric_of
from uavexp.metrics.metric import SUCCESS, Metric
from uavexp.metrics.replanning import COUNTED, cause_metric
from uavexp.parameters import nearest
from uavexp.report import derived

ALL_CAUSES = "causes"  # stands for a metric per cause of replanning

RATE, PATH, CONTACTS = map(metric_of, (SUCCESS, "path_length_m", "collision_count"))
CLEARANCE, REPLANS, BLOCKED_DELAY = map(metric_of, ("min_clearance_m", "replans", "blocked_delay_s"))
TABLE_1 = (
    RATE,
    PATH,
    metric_of("completion_time_s"),
    CONTACTS,
    CLEARANCE,
    REPLANS,
    metric_of("tracking_error_m"),
)
CAUSE_METRICS = tuple(map(cause_metric, COUNTED))


def _clock(part: str, kind: str, title: str) -> Metric:
    return Metric(column=f"wall_{part}_{kind}_s", title=title, unit="ms", digits=1, better=-1, scale=1e3)


CLOCK = (
    _clock("search", "sum", "Search time"),
    _clock("optimise", "sum", "Smoothing time"),
    _clock("explore", "median", "Choice of view, median"),
    _clock("explore", "p99", "Choice of view, 99 %"),
    _clock("optimise", "median", "Optimisation, median"),
    _clock("optimise", "p99", "Optimisation, 99 %"),
)

_BY_COLUMN = {metric.column: metric for metric in (*METRICS, *derived.METRICS, *CLOCK)}


def with_own_causes(metrics: Sequence[Metric], columns: Iterable[str]) -> list[Metric]:
    """The metrics, with causes that are not shipped but have a column after all those that are."""
    asked = list(metrics)
    if set(CAUSE_METRICS) <= set(asked):
        prefix = cause_metric("").column
        others = [name for name in columns if name.startswith(prefix) and name not in _BY_COLUMN]
        place = max(asked.index(metric) for metric in CAUSE_METRICS) + 1
        asked[place:place] = [cause_metric(name.removeprefix(prefix)) for name in sorted(others)]
    return asked


def metrics_of(names: Iterable[str]) -> tuple[Metric, ...]:
    """The metrics of these names in their order; `causes` stands for a metric per cause.

    One's own are named with their module: `my_package.turning.turn_time_s`.

    Raises:
        ConfigError: one is unknown.
    """
    found: list[Metric] = []
    for name in names:
        found += CAUSE_METRICS if name == ALL_CAUSES else (_metric(name),)
    return tuple(found)


def _metric(name: str) -> Metric:
    if name in _BY_COLUMN:  # its name may have a point: prediction_error_0.3s_m
        return _BY_COLUMN[name]
    module, _, column = name.rpartition(".")
    known = {metric.column: metric for metric in own_metrics([module])} if module else _BY_COLUMN
    if column not in known:
        names = ", ".join(sorted((*known, *([] if module else [ALL_CAUSES]))))
        raise ConfigError(f"no such metric: {name}{nearest(column, known)}; there are {names}")
    return known[column]
