"""Metrics of one's own: `metrics=my_package.turning` names a module whose `METRICS` join the columns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from uavexp.config.own_code import imported
from uavexp.config.trust import VARIABLE, is_trusted
from uavexp.errors import ConfigError
from uavexp.metrics.metric import Measure, Metric, Metrics
from uavexp.parameters import check_value


def modules_of(value: Any) -> tuple[str, ...]:
    """The modules that the key names: none, one or a list; each is loaded and looked at.

    Raises:
        ConfigError: as `own_metrics` does.
    """
    named = [] if value is None else value if isinstance(value, list) else [value]
    modules = tuple(check_value("metrics", name, str) for name in named)
    own_metrics(modules)
    return modules


def own_metrics(modules: Sequence[str]) -> Metrics:
    """What modules declare as `METRICS`, as the files of `uavexp.metrics` do.

    Raises:
        ConfigError: one is not trusted, cannot be imported, declares none, or a column is taken.
    """
    if not modules:
        return {}
    from uavexp.metrics.evaluate import METRICS

    found: dict[Metric, Measure] = {}
    for module in modules:
        for metric, measure in _declared(module).items():
            if metric.column in {other.column for other in (*METRICS, *found)}:
                raise ConfigError(f"metrics={module}: the column {metric.column} is taken")
            found[metric] = measure
    return found


def _declared(module: str) -> Metrics:
    if not is_trusted(f"{module}.METRICS"):
        raise ConfigError(f"metrics={module} is refused: add its package to the variable {VARIABLE}")
    try:
        metrics: Metrics = imported(module, f"metrics={module}").METRICS
    except AttributeError as error:
        raise ConfigError(f"metrics={module} declares no METRICS, {{Metric(...): measure}}") from error
    return metrics
