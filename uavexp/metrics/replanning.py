"""How often the plan was changed, why, and whether it was worth it.

A replan is a plan that took effect after the first one that did: an event executed, as
Chen et al. 2026 count RF ("the first plan not counted"). A request without a plan is a
failed plan, one for each goal tried; a plan that was to take effect after the flight's
end is neither.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from uavexp.log import Replan, TrialLog
from uavexp.types import PlanStatus

# counted by name; every other cause ("retry", "brake") is "other"
CAUSES = ("map", "goal", "clock", "distance", "collision", "covered", "expired", "arrival", "risk")


def executed(log: TrialLog) -> tuple[Replan, ...]:
    """Replans that took effect, in the order they did, the first plan left out."""
    end_s = float(log.steps.time_s[-1]) if log.steps.time_s.size else -math.inf
    flown = [replan for replan in log.replans if replan.effective_s <= end_s]
    return tuple(flown[1:])


def failed(log: TrialLog) -> tuple[Replan, ...]:
    """Requests that brought no plan, first plans included."""
    return tuple(replan for replan in log.replans if replan.status is not PlanStatus.OK)


def count_by_cause(replans: Sequence[Replan]) -> dict[str, int]:
    """Replans per cause, under its name or `other`."""
    counts = dict.fromkeys((*CAUSES, "other"), 0)
    for replan in replans:
        counts[replan.cause if replan.cause in CAUSES else "other"] += 1
    return counts


def count_useful(replans: Sequence[Replan], useful_change_m: float) -> int:
    """Replans whose path departs from the old one by more than this, m; the others were wasted."""
    return sum(replan.path_change_m > useful_change_m for replan in replans)


def share_near_change(replans: Sequence[Replan]) -> float:
    """Share of replans made while the map was changing near the vehicle or its path [ours].

    NaN without replans.
    """
    return sum(replan.near_change for replan in replans) / len(replans) if replans else float("nan")


def rate(count: int, extent: float) -> float:
    """Events per metre or second; NaN over no distance or time."""
    return count / extent if extent > 0.0 else float("nan")


@dataclass(frozen=True, slots=True)
class Blocked:
    """One episode in which the flown trajectory was blocked, and what became of it."""

    first_s: float  # the ESDF update that showed it
    until_s: float  # the first update without it, or the contact; inf: the flight ended before either
    answer_s: float  # time of the first planning request in between; NaN: none
    contact: bool  # whether it ended by contact

    def holds(self, time_s: float) -> bool:
        """Whether a request at this time falls into the episode."""
        return self.first_s <= time_s < self.until_s


class Delay(NamedTuple):
    """How long the flown trajectory had been blocked when a plan was asked for; NaN: it was not."""

    blocked_since_s: float  # the ESDF update that showed it first
    delay_s: float  # from there to the request


def blocked_episodes(log: TrialLog) -> tuple[Blocked, ...]:
    """Episodes in which what was left of the flown trajectory led through a mapped obstacle.

    A trajectory is blocked at an ESDF update when its least mapped distance from there on, the
    stop behind its end included, is below the radius of the body's circle. An episode is a
    maximal run of blocked updates, whatever plan is flown meanwhile. It is answered by the
    first planning request from its first update on and before its end, whatever the policy's
    cause was, and whether it brought a plan or, failing, stopped the vehicle. All policies
    are judged by the same map and threshold, none by its own.
    """
    blocked = np.concatenate([[False], log.ticks.remaining_clearance_m < log.limits.body_radius_m, [False]])
    edges = np.flatnonzero(blocked[1:] != blocked[:-1])
    update_s = np.append(log.ticks.tick_s, math.inf)
    return tuple(
        _episode(log, float(update_s[first]), float(update_s[end]))
        for first, end in zip(edges[::2], edges[1::2], strict=True)
    )


def _episode(log: TrialLog, first_s: float, clear_s: float) -> Blocked:
    contact_s = min((c.start_s for c in log.contacts if first_s <= c.start_s < clear_s), default=math.inf)
    episode = Blocked(first_s, min(clear_s, contact_s), math.nan, contact_s < clear_s)
    requests_s = [replan.time_s for replan in log.replans if episode.holds(replan.time_s)]
    return replace(episode, answer_s=min(requests_s, default=math.nan))


def request_delays(log: TrialLog) -> tuple[Delay, ...]:
    """The delay of every planning request of a log, in order; NaN where nothing was blocked or measured.

    The request that answers an episode is the first of those with its `blocked_since_s`; later
    ones ask again while the same trajectory, or the next, is blocked still.
    """
    episodes = blocked_episodes(log)
    return tuple(_delay(replan.time_s, episodes) for replan in log.replans)


def _delay(time_s: float, episodes: Sequence[Blocked]) -> Delay:
    since_s = next((item.first_s for item in episodes if item.holds(time_s)), math.nan)
    return Delay(since_s, time_s - since_s)


def blocked_delays(log: TrialLog) -> dict[str, int | float]:
    """How fast blocked trajectories were answered; all NaN for a log that did not measure it.

    Returns:
        `blocked_episodes`, their number; `blocked_delay_s`, mean time from the first update of
        an answered one to its answer (0: in the same update; NaN: none was answered);
        `blocked_unanswered`, those that a contact or the flight's end closed before any
        request; `blocked_cleared`, those that ended by themselves: the map changed back, the
        place was passed without contact, or the safety role stopped the vehicle.
        The delay leaves out unanswered episodes: read it beside their number.
    """
    if math.isnan(log.limits.body_radius_m):
        names = ("blocked_episodes", "blocked_delay_s", "blocked_unanswered", "blocked_cleared")
        return dict.fromkeys(names, math.nan)
    episodes = blocked_episodes(log)
    delays_s = [item.answer_s - item.first_s for item in episodes if not math.isnan(item.answer_s)]
    silent = [item for item in episodes if math.isnan(item.answer_s)]
    unanswered = sum(item.contact or math.isinf(item.until_s) for item in silent)
    return {
        "blocked_episodes": len(episodes),
        "blocked_delay_s": sum(delays_s) / len(delays_s) if delays_s else math.nan,
        "blocked_unanswered": unanswered,
        "blocked_cleared": len(silent) - unanswered,
    }
