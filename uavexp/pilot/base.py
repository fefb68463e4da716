"""Pilot role: what is flown now, and what becomes of goals, of decisions and of plans that fail.

The package lies above the other roles: a pilot asks four of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from uavexp.arrays import Float
from uavexp.explorer.base import Explorer
from uavexp.log import Replan
from uavexp.planner.base import Planner
from uavexp.recorder import Stopwatch
from uavexp.safety.base import Guard
from uavexp.trajectory import Trajectory
from uavexp.trigger.base import TriggerPolicy
from uavexp.types import Goal, Limits, Observation, Outcome, PlanResult, Reference


def _not_noted(centre_m: Float, radius_m: float) -> None:
    """Where there is no map to note it in."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Crew:
    """Whom a pilot asks in one trial, which they have begun, and what bounds its flight."""

    explorer: Explorer
    trigger: TriggerPolicy
    planner: Planner
    guard: Guard
    limits: Limits
    latency_s: float  # from a request to its effect
    start_m: Float  # (3,)
    start_yaw_rad: float
    flight_bounds_m: Float  # (2, 3)
    watch: Stopwatch
    note_obstacle: Callable[[Float, float], None] = _not_noted  # a ball (3,) and radius that was felt


class Pilot(Protocol):
    """The rules by which a pilot flies; they stay as they are, what it begins is another object."""

    def begin(self, crew: Crew) -> Piloting:
        """Begin a trial."""


class Piloting(Protocol):
    """One trial's pilot at work."""

    @property
    def trajectory(self) -> Trajectory | None:
        """Being flown, with the times at which it is; None before the first plan."""

    @property
    def goal(self) -> Goal | None:
        """Of that trajectory."""

    best_goal: Goal | None  # the explorer's latest choice g*
    replans: list[Replan]  # every planning request
    dropped_triggers: int
    first_plan: PlanResult | None  # the first that was found
    failure: str  # reason of the last failed request, "" after a success

    @property
    def recovers(self) -> bool:
        """Whether it is lost and still tries something: nothing is over yet."""

    @property
    def given_up(self) -> Outcome | None:
        """How the flight ends because nothing is left to be tried; None: it goes on."""

    @property
    def ever_planned(self) -> bool:
        """Whether any plan was found."""

    def reference(self, time_s: float, step_s: float) -> Reference:
        """What to follow now; asked at every step."""

    def explore(self, observation: Observation) -> None:
        """Choose a goal anew; asked at the explorer's rate."""

    def decide(self, observation: Observation) -> float:
        """Ask safety and trigger after an ESDF update; returns the trigger's score."""
