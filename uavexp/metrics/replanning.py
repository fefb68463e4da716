"""How often the plan was changed, why, and whether it was worth it.

A replan is a plan that took effect after the first one that did: an event executed, as
Chen et al. 2026 count RF ("the first plan not counted"). A request without a plan is a
failed plan, one for each goal tried; a plan that was to take effect after the flight's
end is neither.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from uavexp.types import PlanStatus, Replan, TrialLog

CAUSES = ("map", "goal", "clock")  # counted by name; every other cause is "other"


def executed(log: TrialLog) -> tuple[Replan, ...]:
    """Replans that took effect, in the order they did, the first plan left out."""
    end_s = float(log.time_s[-1]) if log.time_s.size else -math.inf
    flown = [replan for replan in log.replans if replan.effective_s <= end_s]
    return tuple(flown[1:])


def failed(log: TrialLog) -> tuple[Replan, ...]:
    """Requests that brought no plan, first plans included."""
    return tuple(replan for replan in log.replans if replan.status is not PlanStatus.OK)


def count_by_cause(replans: Sequence[Replan]) -> dict[str, int]:
    """Replans per cause, under `map`, `goal`, `clock` and `other`."""
    counts = dict.fromkeys((*CAUSES, "other"), 0)
    for replan in replans:
        counts[replan.cause if replan.cause in CAUSES else "other"] += 1
    return counts


def count_useful(replans: Sequence[Replan], useful_change_m: float) -> int:
    """Replans whose path departs from the old one by more than this, m."""
    return sum(replan.path_change_m > useful_change_m for replan in replans)


def share_near_change(replans: Sequence[Replan]) -> float:
    """Share of replans made while the map was changing near the vehicle or its path [ours].

    NaN without replans.
    """
    return sum(replan.near_change for replan in replans) / len(replans) if replans else float("nan")


def rate(count: int, extent: float) -> float:
    """Events per metre or second; NaN over no distance or time."""
    return count / extent if extent > 0.0 else float("nan")
