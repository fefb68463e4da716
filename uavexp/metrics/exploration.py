"""How fast a flight without a target has seen the reachable volume, and what it did meanwhile."""

from __future__ import annotations

import math

import numpy as np

from uavexp.arrays import Bool, Float
from uavexp.geometry import polyline_length_m
from uavexp.log import TrialLog
from uavexp.metrics.metric import Measure, Metric, Metrics
from uavexp.metrics.path import speed_mps

SHARES = (0.90, 0.95, 0.99)
_STANDING_MPS = 0.2  # slower is standing: hovering in noise, a vehicle drifts by less
_TURNING_RADPS = 0.2


def over_time(log: TrialLog, times_s: Float) -> Float:
    """Share of the reachable volume seen by each time (T,) -> (T,); NaN without any."""
    seen = log.ticks.seen_so_far
    if not len(seen):
        return np.full(times_s.shape, np.nan)
    at = np.searchsorted(log.ticks.tick_s, times_s, side="right") - 1
    return np.where(at < 0, 0.0, seen[np.maximum(at, 0)])


def time_to_s(log: TrialLog, share: float) -> float:
    """When so much of the reachable volume had been seen first, s; NaN: never."""
    enough = log.ticks.seen_so_far >= share
    return float(log.ticks.tick_s[np.argmax(enough)]) if enough.any() else math.nan


def path_to_m(log: TrialLog, share: float) -> float:
    """Length flown until then, m; NaN: never."""
    time_s = time_to_s(log, share)
    return (
        math.nan
        if math.isnan(time_s)
        else polyline_length_m(log.steps.position_m[log.steps.time_s <= time_s + 1e-9])
    )


def standing(log: TrialLog) -> tuple[Bool, Bool]:
    """In which rows (T,) the vehicle stood, and in which of these it turned."""
    w, x, y, z = log.steps.quaternion_wxyz.T
    yaw_rad = np.unwrap(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
    rate_radps = np.abs(np.gradient(yaw_rad, log.step_s)) if len(yaw_rad) > 1 else np.zeros(len(yaw_rad))
    stands = speed_mps(log) < _STANDING_MPS
    return stands, stands & (rate_radps > _TURNING_RADPS)


def turning_share(log: TrialLog) -> float:
    """Share of the flight spent turning on the spot."""
    return float(standing(log)[1].mean())


def waiting_share(log: TrialLog) -> float:
    """Share of the flight spent standing without turning."""
    stands, turns = standing(log)
    return float((stands & ~turns).mean())


def _of_explorations(figure: Measure) -> Measure:
    return lambda flight: figure(flight) if len(flight.log.ticks.seen_so_far) else None


def _time_to(share: float) -> tuple[Metric, Measure]:
    metric = Metric(
        column=f"time_to_{100 * share:.0f}_s", title=f"Time to {100 * share:.0f} % of the reachable volume",
        unit="s", digits=1, better=-1, missing="so much was not seen",
    )  # fmt: skip
    return metric, _of_explorations(lambda flight: time_to_s(flight.log, share))


def _path_to(share: float) -> tuple[Metric, Measure]:
    metric = Metric(
        column=f"path_to_{100 * share:.0f}_m", title=f"Path to {100 * share:.0f} % of the reachable volume",
        unit="m", digits=1, better=-1, missing="so much was not seen",
    )  # fmt: skip
    return metric, _of_explorations(lambda flight: path_to_m(flight.log, share))


def _share(column: str, title: str) -> Metric:
    return Metric(column=column, title=title, unit="%", digits=1, better=-1, scale=100.0)


METRICS: Metrics = {
    **dict(_time_to(share) for share in SHARES),
    **dict(_path_to(share) for share in SHARES),
    _share("turning_share", "Turning on the spot"): _of_explorations(
        lambda flight: turning_share(flight.log)
    ),
    _share("waiting_share", "Standing without turning"): _of_explorations(
        lambda flight: waiting_share(flight.log)
    ),
}
