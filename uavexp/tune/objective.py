"""What tuning is for: the means of some metrics over the flights of a setting."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from uavexp.errors import ConfigError
from uavexp.metrics.metric import SUCCESS, Metric
from uavexp.report.labels import metrics_of
from uavexp.store.table import Row


def objectives(names: str) -> tuple[Metric, ...]:
    """The metrics named, separated by commas.

    Raises:
        ConfigError: one is unknown, or neither more nor less of it is better.
    """
    found = metrics_of([name for name in names.split(",") if name])
    if not found:
        raise ConfigError("objective= needs at least one metric, e.g. objective=success,replans")
    for metric in found:
        if not metric.better:
            raise ConfigError(f"objective={metric.column}: neither more nor less of it is better")
    return found


def means(metrics: Sequence[Metric], rows: Sequence[Row]) -> tuple[float, ...] | None:
    """Mean of each metric, in the unit shown; None where no flight has one of them.

    Args:
        metrics: the objectives.
        rows: of `trials.parquet`, of one setting. A trial that did not run to its end is a failure in the
            success rate and has no other metric.
    """
    found = []
    for metric in metrics:
        values = np.array([_number(row.get(metric.column)) for row in rows])
        if metric.column == SUCCESS:
            values = np.nan_to_num(values)
        there = values[np.isfinite(values)]
        if not there.size:
            return None
        found.append(metric.scale * float(there.mean()))
    return tuple(found)


def _number(value: object) -> float:
    return float(value) if isinstance(value, bool | int | float) else math.nan


def told(metrics: Sequence[Metric], values: Sequence[float]) -> str:
    """The means in words."""
    return ", ".join(
        f"{metric.column} {value:.{metric.digits}f}{f' {metric.unit}' if metric.unit else ''}"
        for metric, value in zip(metrics, values, strict=True)
    )


def front(metrics: Sequence[Metric], values: Sequence[Sequence[float]]) -> list[int]:
    """The settings that no other beats: none is as good in every objective and better in one.

    Returns:
        Their places, the best in the first objective first.
    """
    signed = np.array([[m.better * v for m, v in zip(metrics, row, strict=True)] for row in values])
    signed = signed.reshape(len(values), len(metrics))
    kept = [
        index
        for index, row in enumerate(signed)
        if not any((other >= row).all() and (other > row).any() for other in signed)
    ]
    return sorted(kept, key=lambda index: tuple(-signed[index]))
