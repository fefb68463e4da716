"""Explorer role: chooses where to fly next."""

from __future__ import annotations

from typing import ClassVar, Protocol

from uavexp.arrays import Float
from uavexp.types import Goal, Limits, Observation


class Explorer(Protocol):
    """Chooses goals at `rate_hz`; built fresh for every trial."""

    explores: ClassVar[bool]  # whether it finds goals without a target to fly to
    rate_hz: float

    def reset(self, flight_height_m: float, limits: Limits) -> None:
        """Begin a trial at this flight height."""

    def select(self, observation: Observation, *, fresh: bool = False) -> Goal | None:
        """Return the best goal g* now, or None when no goal is reachable.

        With `fresh` a plan is about to be made: no preference for the goal kept so far.
        """

    def reject(self, position_m: Float, time_s: float) -> None:
        """Set a goal aside for a while: no plan leads there."""
