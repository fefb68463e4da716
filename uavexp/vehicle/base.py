"""Vehicle role: the dynamics of the body in free space; contact is `vehicle.contact`."""

from __future__ import annotations

from typing import Protocol

from uavexp.types import Command, Limits, State


class Vehicle(Protocol):
    """Integrates its own motion; built fresh for every trial."""

    mass_kg: float

    @property
    def limits(self) -> Limits:
        """What may be asked of it."""

    def reset(self, state: State) -> None:
        """Begin a trial hovering in `state`."""

    def step(self, command: Command, step_s: float) -> State:
        """Advance by `step_s` under a constant command and return the new state."""

    def place(self, state: State) -> None:
        """Overwrite position, velocity, attitude and rate (after a contact)."""
