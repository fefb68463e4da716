"""Safety role: may stop the vehicle outside the trigger's word."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from uavexp.types import Limits, Observation

MustBrake = Callable[[Observation], bool]  # whether to leave the trajectory and stop now


class Safety(Protocol):
    """The rule; what it begins is asked after every ESDF update of one trial."""

    def begin(self, limits: Limits) -> MustBrake:
        """Begin a trial."""
