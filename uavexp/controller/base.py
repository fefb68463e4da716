"""Controller role: reference in, attitude and thrust out."""

from __future__ import annotations

from typing import Protocol

from uavexp.types import Command, Limits, Reference, State


class Controller(Protocol):
    """Runs at `rate_hz`; built fresh for every trial."""

    rate_hz: float

    def reset(self, limits: Limits, mass_kg: float) -> None:
        """Begin a trial."""

    def command(self, estimated_state: State, reference: Reference) -> Command:
        """Return thrust and attitude that lead the state to the reference."""
