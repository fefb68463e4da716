"""Motion: what the vehicle flies between two ticks, while nobody senses, maps or decides."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from uavexp.controller.base import Controller
from uavexp.estimator.base import Believe
from uavexp.movers.base import Movers
from uavexp.pilot.base import Piloting
from uavexp.recorder import Recorder
from uavexp.types import Outcome, Reference, State
from uavexp.vehicle.base import Vehicle
from uavexp.vehicle.contact import ContactTracker


class Ending(NamedTuple):
    """How a flight has ended, and at which step: the last one recorded."""

    step: int
    outcome: Outcome


Judge = Callable[[int, int], Ending | None]  # of the recorded steps from the first to before the second


@dataclass(frozen=True, slots=True, kw_only=True)
class Craft:
    """What one trial's vehicle is flown with; all of it has begun."""

    pilot: Piloting
    controller: Controller
    vehicle: Vehicle
    believe: Believe
    movers: Movers
    contact: ContactTracker  # its scene has the movers where they are now
    recorder: Recorder
    step_s: float
    command_steps: int  # from one command to the next


class Motion(Protocol):
    """Where the vehicle is, and how it gets on."""

    state: State  # in truth
    estimate: State  # as it believes

    def fly(self, first: int, end: int, reference: Reference | None, judge: Judge) -> Ending | None:
        """Fly from one tick to the next.

        Args:
            first: number of the step at the tick.
            end: number of the step at the next one.
            reference: to follow in the first step, if the pilot was asked already.
            judge: asked of every step once it is recorded.

        Returns:
            How the flight has ended on the way; None: it goes on.
        """
