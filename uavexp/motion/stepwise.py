"""Motion step by step, in Python: any pilot, controller, vehicle, estimator and movers."""

from __future__ import annotations

from dataclasses import dataclass, field

from uavexp.answers import ask
from uavexp.motion.base import Craft, Ending, Judge
from uavexp.movers.base import Reacting
from uavexp.types import Command, Reference, State


@dataclass(slots=True, kw_only=True)
class Stepwise:
    """Asks every part at every step."""

    craft: Craft
    state: State
    estimate: State
    _command: Command = field(init=False)
    _looked_at: Reacting | None = field(init=False)

    def __post_init__(self) -> None:
        self._looked_at = self.craft.movers if isinstance(self.craft.movers, Reacting) else None

    def fly(self, first: int, end: int, reference: Reference | None, judge: Judge) -> Ending | None:
        """Fly from one tick to the next (see `Motion`)."""
        craft, scene = self.craft, self.craft.contact.scene
        for step in range(first, end):
            time_s = step * craft.step_s
            if reference is None or step > first:
                reference = craft.pilot.reference(time_s, craft.step_s)
            if step % craft.command_steps == 0:
                self._command = ask(Command, craft.controller.command, self.estimate, reference)
            craft.recorder.step(step, self.state, self.estimate, reference, scene.bodies)
            ending = judge(step, step + 1)
            if ending is not None:
                return ending
            self._advance(time_s + craft.step_s)
        return None

    def _advance(self, time_s: float) -> None:
        """Fly the step that ends at a time."""
        craft = self.craft
        moved = ask(State, craft.vehicle.step, self._command, craft.step_s)
        if self._looked_at is not None:
            self._looked_at.notice(moved.position_m, moved.velocity_mps)
        craft.contact.scene.place(craft.movers.at(time_s))
        self.state, touched = craft.contact.advance(self.state, moved, time_s)
        if touched:
            craft.vehicle.place(self.state)
        self.estimate = craft.believe(self.state, craft.step_s)
