"""Several policies at once: replan when any of them wants to (paper 2 needs risk beside map changes)."""

from __future__ import annotations

from dataclasses import field
from typing import ClassVar

from uavexp.errors import require
from uavexp.field import DistanceField
from uavexp.parameters import option
from uavexp.trajectory import Trajectory
from uavexp.trigger.base import TriggerPolicy
from uavexp.types import Decision, Limits, Observation


@option
class AnyOf:
    """Asks every policy at every check; the first in order that fires names the cause."""

    defaults_list: ClassVar[tuple[str, ...]] = ("risk@policies.risk", "mcr@policies.mcr")  # Each policy
    # keeps its own parameters: trigger.policies.risk.margin_m=0.3
    policies: dict[str, TriggerPolicy] = field(default_factory=dict)  # name -> policy, filled by the
    # defaults above; the first in order that fires names the cause

    def __post_init__(self) -> None:
        require(len(self.policies) > 0, "policies must name one policy or more, got none")

    def reset(self, limits: Limits) -> None:
        """Begin a trial."""
        for policy in self.policies.values():
            policy.reset(limits)

    def planned(self, trajectory: Trajectory, field: DistanceField) -> None:
        """Tell all of them."""
        for policy in self.policies.values():
            policy.planned(trajectory, field)

    def decide(self, observation: Observation) -> Decision:
        """Return the first decision to replan; without one, no, with the largest score."""
        decisions = [policy.decide(observation) for policy in self.policies.values()]
        for decision in decisions:
            if decision.replan:
                return decision
        return Decision(replan=False, score=max(decision.score for decision in decisions))
