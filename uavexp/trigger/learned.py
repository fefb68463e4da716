"""Replanning when a small network says so, learned in `uavexp.env` by `python -m benchmarks.learn_policy`.

33 numbers (`uavexp.policy.FEATURES`), 16 units, and a replan where what comes out is positive. It first
imitates MCR and goes on by evolution strategies (Salimans et al. 2017) on what flights are worth, on seeds
from 1,000,000 on; the better of the two is kept. A baseline: what a plain learner makes of the decision.
"""

from __future__ import annotations

from dataclasses import field
from pathlib import Path

from uavexp.field import DistanceField
from uavexp.network import Network, load_network
from uavexp.parameters import option
from uavexp.policy import FEATURES, PolicyTrigger
from uavexp.trajectory import Trajectory
from uavexp.types import Decision, Limits, Observation

SHIPPED = Path(__file__).with_suffix(".npz")


@option
class Learned:
    """Asks a network; every number of it lies in a file."""

    weights: str = ""  # npz file of the network, as `benchmarks.learn_policy` writes it; "": the shipped one
    _trigger: PolicyTrigger = field(init=False, repr=False)

    def __post_init__(self) -> None:
        network: Network = load_network(Path(self.weights) if self.weights else SHIPPED, len(FEATURES))
        self._trigger = PolicyTrigger(lambda seen: bool(network.value(seen) > 0.0))

    def reset(self, limits: Limits) -> None:
        """Begin a trial."""
        self._trigger.reset(limits)

    def planned(self, trajectory: Trajectory, field: DistanceField) -> None:
        """Keep the clearance of the new plan."""
        self._trigger.planned(trajectory, field)

    def decide(self, observation: Observation) -> Decision:
        """Replan where the network says so."""
        return self._trigger.decide(observation)
