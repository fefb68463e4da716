"""Safety role: what of a plan is flown, outside the trigger's word."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from uavexp.pace import AS_PLANNED, Pace
from uavexp.trajectory import Trajectory
from uavexp.types import Limits, Observation, Squeeze


@dataclass(frozen=True, slots=True)
class Flyable:
    """How a plan may be flown from some time on."""

    pace: Pace = AS_PLANNED
    refused: str = ""  # why it should not be begun at all; "" when it may


class Safety(Protocol):
    """The rule; what it begins is asked through one trial."""

    def begin(self, limits: Limits) -> Guard:
        """Begin a trial of a vehicle with these limits."""


class Guard(Protocol):
    """One trial's safety at work."""

    def must_brake(self, observation: Observation) -> bool:
        """Whether to leave the trajectory and stop now in a straight line; asked after every ESDF update."""

    def flyable(
        self,
        plan: Trajectory,
        start_s: float,
        rate: tuple[float, float],
        observation: Observation,
        *,
        stops: bool = False,
        squeeze: Squeeze | None = None,
    ) -> Flyable:
        """At which pace to fly a plan from a time on.

        Args:
            plan: to be flown, in trial time.
            start_s: from when on.
            rate: at which its own time runs then, and how that changes, 1/s.
            observation: the map, and the vehicle on its reference.
            stops: come to rest along it as soon as is comfortable: there is no plan beyond.
            squeeze: through which it was planned: a lesser clearance than usual is kept, more slowly.
        """


@dataclass(frozen=True, slots=True)
class Unguarded:
    """Flies every plan as it is; what brakes in a straight line does it in place of `must_brake`."""

    def must_brake(self, observation: Observation) -> bool:
        """Return False."""
        return False

    def flyable(
        self,
        plan: Trajectory,
        start_s: float,
        rate: tuple[float, float],
        observation: Observation,
        *,
        stops: bool = False,
        squeeze: Squeeze | None = None,
    ) -> Flyable:
        """Return: as planned."""
        return Flyable()
