"""Mission role: what counts as done, and when time is up."""

from __future__ import annotations

from typing import Protocol

from uavexp.types import Float, Observation, Outcome, World


class Mission(Protocol):
    """Judges progress; built fresh for every trial."""

    def reset(self, world: World) -> None:
        """Begin a trial in `world`."""
        ...

    @property
    def target_m(self) -> Float | None:
        """Where the flight is to end, (3,); None when exploring."""
        ...

    @property
    def time_limit_s(self) -> float:
        """Flight time after which the mission has timed out."""
        ...

    def outcome(self, true_position_m: Float, observation: Observation) -> Outcome | None:
        """How the flight ended, or None while it goes on."""
        ...
