"""How numbers stand in the cells of tables."""

from __future__ import annotations

import math

from uavexp.metrics.metric import Metric
from uavexp.report.comparison import ArmEstimate, Difference
from uavexp.report.statistics import Interval

NONE = "–"


def number(value: float, digits: int) -> str:
    """A number with so many decimals; a dash where there is none, never "-0.0"."""
    if not math.isfinite(value):
        return NONE
    text = f"{value:.{digits}f}"
    return text.lstrip("-") if float(text) == 0.0 else text


def signed(value: float, digits: int) -> str:
    """A difference with its sign."""
    text = number(value, digits)
    return text if text.startswith(("-", NONE)) or float(text) == 0.0 else f"+{text}"


def interval(ends: Interval, digits: int) -> str:
    """Ends in brackets; empty without an interval."""
    return f"[{number(ends.low, digits)}, {number(ends.high, digits)}]" if math.isfinite(ends.low) else ""


def mean_with_interval(found: ArmEstimate, metric: Metric, n: int) -> str:
    """Mean and interval, and the trials it exists for where they are fewer than all n."""
    return _join(number(found.mean, metric.digits), interval(found.interval, metric.digits), _few(found, n))


def mean_with_spread(found: ArmEstimate, metric: Metric, n: int) -> str:
    """Mean ± standard deviation, interval, and the trials it exists for where fewer than all n."""
    spread = f" ± {number(found.sd, metric.digits)}" if math.isfinite(found.sd) else ""
    mean = number(found.mean, metric.digits) + spread
    return _join(mean, interval(found.interval, metric.digits), _few(found, n))


def difference(found: Difference, metric: Metric) -> str:
    """Difference with its interval."""
    return _join(signed(found.mean, metric.digits), interval(found.interval, metric.digits))


def p_value(p: float) -> str:
    """Three decimals, or the bound below which it lies."""
    if not math.isfinite(p):
        return NONE
    return "<0.001" if p < 0.001 else f"{p:.3f}"


def _few(found: ArmEstimate, n: int) -> str:
    return f"(n = {found.n})" if 0 < found.n < n else ""


def _join(*parts: str) -> str:
    return " ".join(part for part in parts if part)
