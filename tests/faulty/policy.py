"""A trigger policy and a world that do something terrible when first asked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tests.jobs import DEEDS
from uavexp.field import DistanceField
from uavexp.trajectory import Trajectory
from uavexp.types import Decision, Limits, Observation, World


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


@dataclass(slots=True, kw_only=True)
class Terrible:
    """A world that does one deed of `tests.jobs` while it is made."""

    deed: str

    def generate(self, rng: np.random.Generator) -> World:
        """Misbehave."""
        DEEDS[self.deed](60.0)
        raise AssertionError
