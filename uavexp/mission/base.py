"""Mission role: what counts as done, and when time is up."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from uavexp.arrays import Float
from uavexp.explorer.base import Explorer
from uavexp.log import Inspection
from uavexp.scene import Scene
from uavexp.types import Limits, Observation, Outcome, World


class Flown(NamedTuple):
    """Steps of a flight, in truth, and where the vehicle believed to be."""

    time_s: Float  # (N,)
    position_m: Float  # (N, 3)
    quaternion_wxyz: Float  # (N, 4)
    estimated_position_m: Float  # (N, 3)


class Mission(Protocol):
    """Sets the task and judges progress; built fresh for every trial."""

    def prepare(self, world: World, rng: np.random.Generator) -> World:
        """Return the world as it really is at the start: this one, unless the mission changes it."""

    def reset(self, world: World, scene: Scene, limits: Limits) -> None:
        """Begin a trial in `world`."""

    def guide(self, explorer: Explorer) -> Explorer:
        """Return who chooses the goals: the explorer, unless the mission knows better."""

    @property
    def target_m(self) -> Float | None:
        """Where the flight is to end, (3,); None when exploring."""

    @property
    def time_limit_s(self) -> float:
        """Flight time after which the mission has timed out."""

    def outcome(self, flown: Flown, observation: Observation) -> tuple[int, Outcome] | None:
        """At which of these steps the flight has ended, and how; None: it goes on.

        Every step is shown once, in order; none after the end counts. The observation is the latest.
        """

    def findings(self) -> Inspection:
        """What only this mission knows of the flight; nothing for most."""
