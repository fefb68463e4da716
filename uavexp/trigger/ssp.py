"""Single-shot planning: the first plan is the only one (paper 1, baseline SSP)."""

from __future__ import annotations

from uavexp.field import DistanceField
from uavexp.parameters import option
from uavexp.trajectory import Trajectory
from uavexp.types import Decision, Limits, Observation


@option
class Ssp:
    """Never replans."""

    def reset(self, limits: Limits) -> None:
        """Begin a trial."""

    def planned(self, trajectory: Trajectory, field: DistanceField) -> None:
        """Take note of a new plan."""

    def decide(self, observation: Observation) -> Decision:
        """Return no."""
        return Decision(replan=False)
