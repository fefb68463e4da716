"""How often the plan was changed, why, and whether it was worth it.

A replan is a plan that took effect after the first one that did: an event executed, as
Chen et al. 2026 count RF ("the first plan not counted"). A request without a plan is a
failed plan, one for each goal tried; a plan that was to take effect after the flight's
end is neither.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from uavexp import causes
from uavexp.log import Replan, TrialLog
from uavexp.metrics import path
from uavexp.metrics.metric import Measure, Metric, Metrics
from uavexp.types import PlanStatus

_COUNT = "replans_"  # and the cause
_NOT_MEASURED = "the log does not tell"


COUNTED = (*(cause.name for cause in causes.POLICY), causes.OTHER.name)


def executed(log: TrialLog) -> tuple[Replan, ...]:
    """Replans that took effect, in the order they did, the first plan left out."""
    end_s = float(log.steps.time_s[-1]) if log.steps.time_s.size else -math.inf
    flown = [replan for replan in log.replans if replan.effective_s <= end_s]
    return tuple(flown[1:])


def failed(log: TrialLog) -> tuple[Replan, ...]:
    """Requests that brought no plan, first plans included."""
    return tuple(replan for replan in log.replans if replan.status is not PlanStatus.OK)


def count_by_cause(replans: Sequence[Replan]) -> dict[str, int]:
    """Replans per cause: every shipped policy's, also where none occurred, and whatever else did.

    The pilot's own count together, as `other`.
    """
    pilots = {cause.name for cause in causes.PILOT}
    counted = Counter(causes.OTHER.name if replan.cause in pilots else replan.cause for replan in replans)
    return {name: counted[name] for name in (*COUNTED, *(set(counted) - set(COUNTED)))}


def recoveries(log: TrialLog) -> dict[str, int]:
    """How often each rung of the pilot's ladder was taken (`uavexp.pilot.recovery`), whatever came of it.

    The requests of one moment are one: a rung tries several goals.
    """
    taken = Counter(cause for cause, _ in {(replan.cause, replan.time_s) for replan in log.replans})
    return {cause.name: taken[cause.name] for cause in causes.RECOVERY}


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


@dataclass(frozen=True, slots=True)
class Answers:
    """How fast blocked trajectories were answered.

    The delay leaves out unanswered episodes: read it beside their number.
    """

    episodes: int
    delay_s: float  # mean from the first update of an answered one to its answer; NaN: none was answered
    unanswered: int  # closed by a contact or the flight's end before any request
    # ended by themselves: the map changed back, the place was passed without contact, or the
    # safety role stopped the vehicle
    cleared: int


def answers(log: TrialLog) -> Answers:
    """What became of the blocked episodes of a flight."""
    episodes = blocked_episodes(log)
    delays_s = [item.answer_s - item.first_s for item in episodes if not math.isnan(item.answer_s)]
    silent = [item for item in episodes if math.isnan(item.answer_s)]
    unanswered = sum(item.contact or math.isinf(item.until_s) for item in silent)
    return Answers(
        episodes=len(episodes),
        delay_s=sum(delays_s) / len(delays_s) if delays_s else math.nan,
        unanswered=unanswered,
        cleared=len(silent) - unanswered,
    )


def _of_replans(figure: Callable[[Sequence[Replan]], int | float]) -> Measure:
    return lambda flight: figure(executed(flight.log))


def _count_of(cause: str) -> Measure:
    return _of_replans(lambda replans: count_by_cause(replans)[cause])


def cause_metric(cause: str) -> Metric:
    """The column of the replans of one cause."""
    return Metric(column=f"{_COUNT}{cause}", title=f"Replans, cause {cause}", digits=1, is_count=True)


def cause_of(metric: Metric) -> str | None:
    """The cause whose replans a metric counts; None for another metric."""
    cause = metric.column.removeprefix(_COUNT)
    return cause if metric == cause_metric(cause) else None


def _of_blocked(figure: Callable[[Answers], int | float]) -> Measure:
    """A figure of the blocked episodes; NaN for a log that did not measure them."""
    return lambda flight: (
        math.nan if math.isnan(flight.log.limits.body_radius_m) else figure(answers(flight.log))
    )


def own_causes(log: TrialLog) -> dict[str, int]:
    """Counts of the causes that occurred and that no shipped policy gives, by column."""
    counts = count_by_cause(executed(log))
    return {cause_metric(cause).column: count for cause, count in counts.items() if cause not in COUNTED}


def _recoveries_of(cause: str) -> Measure:
    return lambda flight: recoveries(flight.log)[cause]


METRICS: Metrics = {
    Metric(column="replans", title="Replans, RF", digits=1, better=-1, is_count=True): _of_replans(len),
    **{cause_metric(cause): _count_of(cause) for cause in COUNTED},
    **{
        Metric(
            column=f"recoveries_{cause.name}", title=f"Times that {cause.label}", better=-1, is_count=True
        ): _recoveries_of(cause.name)
        for cause in causes.RECOVERY
    },
    Metric(column="useful_replans", title="Useful replans", digits=1, better=1, is_count=True): (
        lambda flight: count_useful(executed(flight.log), flight.useful_change_m)
    ),
    Metric(column="failed_plans", title="Requests without a plan", better=-1, is_count=True): (
        lambda flight: len(failed(flight.log))
    ),
    Metric(column="dropped_triggers", title="Triggers dropped while planning", is_count=True): (
        lambda flight: flight.log.dropped_triggers
    ),
    Metric(column="replans_per_m", title="Replans per metre", unit="1/m", missing="nothing was flown"): (
        lambda flight: rate(len(executed(flight.log)), path.path_length_m(flight.log))
    ),
    Metric(column="replans_per_s", title="Replans per second", unit="1/s", missing="nothing was flown"): (
        lambda flight: rate(len(executed(flight.log)), path.completion_time_s(flight.log))
    ),
    Metric(
        column="replans_near_change_share",
        title="Replans near a map change",
        unit="%",
        digits=0,
        better=1,
        scale=100.0,
        missing="there was no replan",
    ): _of_replans(share_near_change),
    Metric(
        column="blocked_episodes",
        title="Times the path was blocked",
        is_count=True,
        missing=_NOT_MEASURED,
    ): _of_blocked(lambda found: found.episodes),
    Metric(
        column="blocked_delay_s",
        title="Delay from blocked path to request",
        unit="s",
        digits=3,
        better=-1,
        missing=f"none was answered, or {_NOT_MEASURED}",
    ): _of_blocked(lambda found: found.delay_s),
    Metric(
        column="blocked_unanswered",
        title="Blocked paths without an answer",
        better=-1,
        is_count=True,
        missing=_NOT_MEASURED,
    ): _of_blocked(lambda found: found.unanswered),
    Metric(
        column="blocked_cleared",
        title="Blocked paths that cleared by themselves",
        is_count=True,
        missing=_NOT_MEASURED,
    ): _of_blocked(lambda found: found.cleared),
}
