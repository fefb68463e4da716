"""At which moments of a flight what is written: poses often, the map now and then, plans when they change."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavexp.arrays import Float, Int
from uavexp.causes import cause_named
from uavexp.log import Replan, TrialLog

POSE_HZ = 50.0
MOVER_HZ = 10.0
_MOST_MAPS = 24  # so many at most, also of a long flight
_LEAST_GAP_S = 0.5  # between two


def rows_at(log: TrialLog, rate_hz: float) -> Int:
    """Rows of the steps (N,) at a rate, the last one included."""
    last = log.steps.time_s.size - 1
    return np.unique(np.append(np.arange(0, last, max(1, round(1.0 / (rate_hz * log.step_s)))), last))


def map_times_s(log: TrialLog) -> Float:
    """When the map is written; of a log that does not tell its growth, once, at the start."""
    begin_s, end_s = float(log.steps.time_s[0]), float(log.steps.time_s[-1])
    if len(log.grid.occupied_s) != len(log.mapped_m):
        return np.array([begin_s])
    count = int(np.clip((end_s - begin_s) / _LEAST_GAP_S, 1, _MOST_MAPS))
    return np.linspace(begin_s, end_s, count + 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanChange:
    """A planning request in words, and the plan that came of it."""

    time_s: float  # of the trigger
    effective_s: float  # NaN without a plan
    position_m: Float  # (3,) of the vehicle at the trigger
    goal_m: Float  # (3,)
    trajectory_m: Float  # (P, 3); empty without a plan
    cause: str
    colour: str  # #RRGGBB
    words: str


def plan_changes(log: TrialLog) -> list[PlanChange]:
    """All requests of a flight in the order they were made."""
    return [_change(number, replan) for number, replan in enumerate(log.replans)]


def colour_rgb(colour: str) -> tuple[float, float, float]:
    """Shares of red, green and blue of #RRGGBB, 0 to 1."""
    red, green, blue = (int(colour[place : place + 2], 16) / 255.0 for place in (1, 3, 5))
    return red, green, blue


def _change(number: int, replan: Replan) -> PlanChange:
    cause = cause_named(replan.cause)
    came = f"path moved by {replan.path_change_m:.2f} m" if np.isfinite(replan.path_change_m) else ""
    if replan.status != "ok":
        came = f"no plan: {replan.reason or replan.status}"
    return PlanChange(
        time_s=replan.time_s,
        effective_s=replan.effective_s,
        position_m=replan.position_m,
        goal_m=replan.goal_m,
        trajectory_m=replan.trajectory_m.astype(np.float64),
        cause=cause.name,
        colour=cause.colour,
        words=f"plan {number}: {cause.name}, {cause.label}" + (f"; {came}" if came else ""),
    )
