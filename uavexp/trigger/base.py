"""Trigger role: decides when to replan. The subject of paper 1."""

from __future__ import annotations

from typing import Protocol

from uavexp.field import DistanceField
from uavexp.trajectory import Trajectory
from uavexp.types import Decision, Limits, Observation


class TriggerPolicy(Protocol):
    """Asked after every ESDF update; built fresh for every trial."""

    def reset(self, limits: Limits) -> None:
        """Begin a trial."""

    def planned(self, trajectory: Trajectory, field: DistanceField) -> None:
        """Take note of a new plan and of the live map it was made on (copy what is kept).

        The safety may have it flown later than planned: `Observation.trajectory` has the times of now.
        """

    def decide(self, observation: Observation) -> Decision:
        """Whether to replan now, and why."""
