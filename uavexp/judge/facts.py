"""What is told of a recorded flight: the columns of every flight's metrics that a recording has."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from uavexp.geometry import polyline_length_m
from uavexp.judge.flight import Judged
from uavexp.log import TrialLog
from uavexp.metrics.evaluate import evaluate, metric_of
from uavexp.metrics.smoothness import WINDOW_S, derivative, squared_integral
from uavexp.metrics.tracking import rmse_m, tracking_m

_PATH = ("path_length_m", "completion_time_s", "mean_speed_mps", "max_speed_mps")
_CLEARANCE = ("min_clearance_m", "safety_threshold_m", "time_below_safety_s")
_SMOOTHNESS = {"acceleration_integral_m2ps3": 1, "jerk_integral_m2ps5": 2}
_REPLANS = ("replans", "replans_per_m")
_FEWEST = 5.0  # samples that a cubic smooths


def values_of(found: Judged, *, has_building: bool, has_plans: bool) -> dict[str, float]:
    """Values by column, as stored; NaN: this recording cannot tell."""
    measured = evaluate(found.log, found.world)
    columns = (
        *_PATH,
        *(_CLEARANCE if has_building else ()),
        *(_REPLANS if has_plans else ()),
    )
    values = {column: float(measured[column]) for column in columns if column in measured}
    error_m = tracking_m(found.log)
    values["tracking_error_m"] = rmse_m(error_m[np.isfinite(error_m)])
    velocity, step_s = found.log.steps.velocity_mps, found.log.step_s
    for column, order in _SMOOTHNESS.items():
        values[column] = squared_integral(derivative(velocity, step_s, order, window_s(found.log)), step_s)
    return values


def window_s(log: TrialLog) -> float:
    """Length of the fit that smoothness is measured with: as everywhere, or what five samples take, s."""
    return max(WINDOW_S, (_FEWEST - 1.0) * log.step_s)


def lines_of(found: Judged, values: dict[str, float]) -> list[str]:
    """A line per value that exists, then how it was measured."""
    lines = []
    for column, value in values.items():
        if math.isfinite(value):
            metric = metric_of(column)
            digits = 0 if metric.is_count else metric.digits
            lines.append(f"  {metric.label:<36} {metric.scale * value:.{digits}f}")
    steps, window = found.log.steps, window_s(found.log)
    straight_m = polyline_length_m(steps.position_m[[0, -1]])
    lines.append(f"  {'From first to last position [m]':<36} {straight_m:.1f}")
    if window > WINDOW_S:
        lines.append(
            f"  smoothness over {window:.2g} s, for positions are {found.log.step_s:.2g} s apart; "
            f"flights here have {WINDOW_S:g} s"
        )
    return lines


def as_json(values: dict[str, float], notes: tuple[str, ...], source: str) -> dict[str, Any]:
    """The same for programs; null: this recording cannot tell."""
    numbers = {column: value if math.isfinite(value) else None for column, value in values.items()}
    return {"source": source, **numbers, "notes": list(notes)}
