"""Safety role: may stop the vehicle outside the trigger's word."""

from __future__ import annotations

from typing import Protocol

from uavexp.types import Limits, Observation


class Safety(Protocol):
    """Asked after every ESDF update; built fresh for every trial."""

    def reset(self, limits: Limits) -> None:
        """Begin a trial."""

    def must_brake(self, observation: Observation) -> bool:
        """Whether to leave the trajectory and stop now."""
