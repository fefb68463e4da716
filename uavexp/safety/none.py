"""No braking outside the trigger's word: the paper's comparison."""

from __future__ import annotations

from uavexp.parameters import option
from uavexp.safety.base import Guard, Unguarded
from uavexp.types import Limits


@option(frozen=True)
class NoBrake:
    """Never brakes; or nobody would ever collide and triggers could not be compared."""

    def begin(self, limits: Limits) -> Guard:
        """Begin a trial."""
        return Unguarded()
