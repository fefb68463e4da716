"""A trigger policy that does something terrible when first asked."""

from __future__ import annotations

from dataclasses import dataclass

from tests.jobs import DEEDS
from uavexp.field import DistanceField
from uavexp.trajectory import Trajectory
from uavexp.types import Decision, Limits, Observation


@dataclass(slots=True, kw_only=True)
class Faulty:
    """Does one deed of `tests.jobs`, then never replans."""

    deed: str

    def reset(self, limits: Limits) -> None:
        """Begin a trial."""

    def planned(self, trajectory: Trajectory, field: DistanceField) -> None:
        """Take note of a new plan."""

    def decide(self, observation: Observation) -> Decision:
        """Misbehave."""
        DEEDS[self.deed](60.0)
        return Decision(replan=False)
