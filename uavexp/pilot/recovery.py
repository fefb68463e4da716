"""The ladder of recovery: what a vehicle that gets no further tries, in which order, and when it gives up.

    other goals, looking around, backing up, a lesser clearance, noting an obstacle, the end

A vehicle that stands without a plan that leads on is lost. It climbs a rung when the one it is on has had
its time; a rung that is not possible is passed over. Once it has left the place it is no longer lost, but
the ladder remembers: lost at the same place again, it goes on from the rung it was on; at another one it
begins below, `Patience.climbs` times at most. A gain wipes that out: space newly seen, or the target nearer.

No rung repeats for ever: between two gains at most `climbs` ladders are climbed, each rung of them once, and
there are no more gains than the world has space and the way has metres.

After Nav2's recovery behaviours and PX4's failsafes, which have such a ladder each; this one ends.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum

from uavexp import causes

Place = tuple[float, float, float]

_SAME_PLACE_M = 1.0
_LEFT_M = 0.5  # so far from where it was lost the vehicle has got on
_SEEN_M3 = 1.0  # newly seen, or ...
_NEARER_M = 1.0  # ... so much nearer the target: the ladder begins anew


class Rung(StrEnum):
    """What is tried; the names are causes in the log."""

    GOALS = "goals"  # those that are left, and again those that were set aside
    LOOK = causes.LOOK_AROUND.name
    BACK = causes.BACK_UP.name
    LESSER = causes.LESSER_CLEARANCE.name
    NOTE = causes.NOTED.name
    END = "end"


LADDER = tuple(Rung)


@dataclass(frozen=True, slots=True, kw_only=True)
class Patience:
    """How long a rung is given, and how often the ladder is climbed."""

    wait_s: float
    turn_s: float  # for looking around once
    climbs: int  # since anything was learned

    def of(self, rung: Rung) -> float:
        """Time of a rung, s."""
        return self.turn_s if rung is Rung.LOOK else self.wait_s


@dataclass(frozen=True, slots=True, kw_only=True)
class Situation:
    """What the ladder is told."""

    time_s: float
    here_m: Place
    lost: bool  # stands, and no plan leads on
    busy: bool  # turns or flies along a plan, or is backing up
    seen_m3: float  # of space, so far
    away_m: float  # of the target; inf without one


@dataclass(frozen=True, slots=True, kw_only=True)
class Ladder:
    """Where on it a vehicle is, and what it remembers."""

    rung: Rung = Rung.GOALS
    since_s: float = math.inf  # on this rung; inf: it is not lost
    place_m: Place | None = None  # where it was lost last
    first_s: float = math.inf  # when it was first lost there
    climbs: int = 0  # since anything was learned
    seen_m3: float = 0.0  # then
    away_m: float = math.inf  # of the target, then

    @property
    def climbing(self) -> bool:
        """Whether the vehicle is lost."""
        return self.since_s < math.inf

    @property
    def ended(self) -> bool:
        """Whether nothing is left to be tried."""
        return self.rung is Rung.END


def climbed(ladder: Ladder, now: Situation, patience: Patience, possible: Callable[[Rung], bool]) -> Ladder:
    """The ladder a moment later; `possible` is asked for rungs whose turn it is, the end included."""
    if ladder.ended:
        return ladder
    if not ladder.climbing:
        return _begun(ladder, now, patience) if now.lost else ladder
    if not now.lost and (not now.busy or _apart_m(now.here_m, ladder.place_m) > _LEFT_M):
        return replace(ladder, since_s=math.inf)
    if now.busy or now.time_s < ladder.since_s + patience.of(ladder.rung):
        return ladder
    climbs = ladder.climbs + (ladder.rung is Rung.GOALS)
    left = LADDER[LADDER.index(ladder.rung) + 1 :] if climbs <= patience.climbs else (Rung.END,)
    rung = next((rung for rung in left if possible(rung)), None)
    return ladder if rung is None else replace(ladder, rung=rung, since_s=now.time_s, climbs=climbs)


def _begun(ladder: Ladder, now: Situation, patience: Patience) -> Ladder:
    """Lost: from below, or from where it was at this place."""
    learned = now.seen_m3 >= ladder.seen_m3 + _SEEN_M3 or now.away_m < ladder.away_m - _NEARER_M
    if learned or ladder.place_m is None:
        return Ladder(
            since_s=now.time_s,
            place_m=now.here_m,
            first_s=now.time_s,
            seen_m3=now.seen_m3,
            away_m=min(now.away_m, ladder.away_m),
        )
    if _apart_m(now.here_m, ladder.place_m) > _SAME_PLACE_M:
        return replace(ladder, rung=Rung.GOALS, since_s=now.time_s, place_m=now.here_m, first_s=now.time_s)
    if ladder.rung is Rung.GOALS:  # one after the other it would try them all from here
        return replace(ladder, since_s=ladder.first_s)
    return replace(ladder, since_s=now.time_s + patience.wait_s - patience.of(ladder.rung))


def _apart_m(here_m: Place, there_m: Place | None) -> float:
    return math.inf if there_m is None else math.dist(here_m, there_m)
