"""Motion of the shipped vehicle in as few calls as can be: compiled wherever no surface is near.

The same numbers as `stepwise`, bit for bit: the same kernels are called in the same order.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from uavexp.arrays import Float
from uavexp.controller.flatness import Flatness
from uavexp.controller.position_velocity import Gains, PositionVelocity
from uavexp.estimator.perfect import truth
from uavexp.motion.base import Craft, Ending, Judge
from uavexp.motion.kernel import fly_free
from uavexp.pilot.following import row_of
from uavexp.pilot.holding_pilot import HoldingPilot
from uavexp.recorder import times_s
from uavexp.types import Reference, State
from uavexp.vehicle.quadrotor import Quadrotor, state_of


def compiled_motion(craft: Craft, state: State) -> Compiled | None:
    """The motion of a craft that can fly so, else None: no subclass, and no movers."""
    pilot, controller, vehicle = craft.pilot, craft.controller, craft.vehicle
    alone = len(craft.contact.scene.bodies) == 0 and craft.believe is truth
    if (
        type(pilot) is HoldingPilot
        and isinstance(controller, PositionVelocity)
        and type(controller) in (PositionVelocity, Flatness)
        and type(vehicle) is Quadrotor
        and alone
    ):
        return Compiled(
            craft=craft, pilot=pilot, gains=controller.gains, feeds=type(controller) is Flatness,
            vehicle=vehicle, state=state, estimate=state,
        )  # fmt: skip
    return None


@dataclass(slots=True, kw_only=True)
class Compiled:
    """Asks the pilot for all references of a stretch, and geometry only where a surface may be near."""

    craft: Craft
    pilot: HoldingPilot
    gains: Gains
    feeds: bool  # the body rate forward
    vehicle: Quadrotor
    state: State
    estimate: State
    _before: Float = field(init=False, default_factory=lambda: np.empty(17))
    _command: Float = field(init=False, default_factory=lambda: np.empty(8))
    _work: Float = field(init=False, default_factory=lambda: np.empty((6, 17)))

    def fly(self, first: int, end: int, reference: Reference | None, judge: Judge) -> Ending | None:
        """Fly from one tick to the next (see `Motion`)."""
        references = self._references(first, end, reference)
        while first < end:
            flown, is_near = self._fly_free(first, references)
            ending = judge(first, first + flown)
            if ending is not None:
                return ending
            first, references = first + flown, references[flown:]
            self._arrive(first, is_near)
        return None

    def _references(self, first: int, end: int, reference: Reference | None) -> Float:
        """Rows of `pilot.following` for the steps of the stretch."""
        step_s = self.craft.step_s
        if reference is None:
            return self.pilot.references(times_s(first, end, step_s), step_s)
        row = row_of(reference)[None]
        if end == first + 1:
            return row
        return np.concatenate([row, self.pilot.references(times_s(first + 1, end, step_s), step_s)])

    def _fly_free(self, first: int, references: Float) -> tuple[int, bool]:
        craft, vehicle = self.craft, self.vehicle
        flown, is_near = fly_free(
            vehicle.x, self._before, self._command, self._work, references,
            craft.recorder.rows[first : first + len(references)], first, craft.command_steps, craft.step_s,
            vehicle.substeps, self.gains, self.feeds, vehicle.plant, vehicle.loop, *craft.contact.free_ball,
        )  # fmt: skip
        return flown, is_near

    def _arrive(self, step: int, is_near: bool) -> None:
        """Let geometry resolve the step before this one, if it may have met any."""
        self.state = state_of(self.vehicle.x)
        if is_near:
            time_s = (step - 1) * self.craft.step_s + self.craft.step_s
            self.state, touched = self.craft.contact.advance(state_of(self._before), self.state, time_s)
            if touched:
                self.vehicle.place(self.state)
        self.estimate = self.state
