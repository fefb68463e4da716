"""What a pilot has under way: the plan that is flown, the one in flight, and what can be told of them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from uavexp.log import Replan
from uavexp.pilot.base import Crew
from uavexp.pilot.flown import Flown
from uavexp.pilot.recovering import Recovering, ending
from uavexp.pilot.rules import Rules
from uavexp.pilot.steering import Steering
from uavexp.trajectory import Trajectory
from uavexp.types import Goal, Outcome, PlanResult, PlanStatus

_IDLES = 2.0  # times `recover_after_s`: who looks around at a goal takes a while


@dataclass(slots=True, kw_only=True)
class Underway:
    """What is flown, what waits to be, and every planning request made on the way."""

    rules: Rules
    crew: Crew
    steering: Steering
    recovery: Recovering
    flown: Flown | None = None
    best_goal: Goal | None = None
    replans: list[Replan] = field(default_factory=list)
    dropped_triggers: int = 0
    first_plan: PlanResult | None = None
    failure: str = ""
    _pending: Flown | None = None  # a plan waiting for its latency to pass

    @property
    def trajectory(self) -> Trajectory | None:
        """Being flown; None before the first plan."""
        return None if self.flown is None else self.flown.trajectory

    @property
    def goal(self) -> Goal | None:
        """Of that trajectory."""
        return None if self.flown is None else self.flown.goal

    @property
    def recovers(self) -> bool:
        """Whether it is lost and still tries something."""
        return self.recovery.lasts

    @property
    def given_up(self) -> Outcome | None:
        """How the flight ends when nothing is left to be tried."""
        ended = self.recovery.ladder.ended
        return ending(self.replans, has_goal=self.best_goal is not None) if ended else None

    @property
    def ever_planned(self) -> bool:
        """Whether any plan was found."""
        return any(replan.status is PlanStatus.OK for replan in self.replans)

    def _moving(self, time_s: float) -> bool:
        return self.flown is not None and time_s < self.flown.ends_s

    def _waits_s(self, time_s: float) -> float:
        """How long the safety has held the vehicle on a plan, s; not positive: it does not."""
        return time_s - self.flown.waits_since_s if self.flown and self._flies_a_plan else -math.inf

    def _idles(self, time_s: float) -> bool:
        """Whether it stands at the end of its plan, and nothing has asked for a way to the goal there is."""
        if self.flown is None or not self._flies_a_plan or self.best_goal is None:
            return False
        ended_s = max(self.flown.ends_s, self.flown.moves_s)
        return time_s >= ended_s + _IDLES * self.rules.recover_after_s

    @property
    def _flies_a_plan(self) -> bool:
        return self._pending is None and not self.failure
