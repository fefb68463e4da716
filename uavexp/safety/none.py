"""No braking outside the trigger's word: the paper's comparison."""

from __future__ import annotations

from uavexp.parameters import option
from uavexp.types import Limits, Observation


@option
class NoBrake:
    """Never brakes; or nobody would ever collide and triggers could not be compared."""

    def reset(self, limits: Limits) -> None:
        """Begin a trial."""

    def must_brake(self, observation: Observation) -> bool:
        """Return False."""
        return False
