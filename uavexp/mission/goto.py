"""Reach the target."""

from __future__ import annotations

from dataclasses import field
from typing import ClassVar, Literal

import numpy as np

from uavexp.arrays import Float
from uavexp.explorer.base import Explorer
from uavexp.log import Inspection
from uavexp.mission.base import Flown
from uavexp.parameters import NonNegative, Positive, option
from uavexp.scene import Scene
from uavexp.types import Limits, Observation, Outcome, World


@option
class Goto:
    """Reached = within `tolerance_m` of the target, in truth or as the vehicle believes."""

    nothing_left: ClassVar[Outcome] = Outcome.UNREACHABLE
    tolerance_m: Positive = 0.3  # m, the target counts as reached within this distance [ours]
    arrival: Literal["truth", "belief"] = "truth"  # of the vehicle's true or estimated position: a
    # vehicle that drifts knows only the latter
    time_base_s: Positive = 60.0  # s, time limit = this ... [ours]
    time_per_path_spm: NonNegative = 5.0  # s/m, ... plus this for each metre of the true shortest path [ours]
    _world: World | None = field(init=False, repr=False, default=None)

    def prepare(self, world: World, rng: np.random.Generator) -> World:
        """The world as it is."""
        return world

    def guide(self, explorer: Explorer) -> Explorer:
        """The explorer."""
        return explorer

    def findings(self) -> Inspection:
        """Nothing beyond what every flight records."""
        return Inspection()

    def reset(self, world: World, scene: Scene, limits: Limits) -> None:
        """Begin a trial in `world`."""
        self._world = world

    @property
    def target_m(self) -> Float | None:
        """The world's target, (3,)."""
        return self._task().target_m

    @property
    def time_limit_s(self) -> float:
        """Base time plus a time for each metre of the true shortest path."""
        return self.time_base_s + self.time_per_path_spm * self._task().difficulty.shortest_path_m

    def outcome(self, flown: Flown, observation: Observation) -> tuple[int, Outcome] | None:
        """REACHED at the first step within the tolerance of the target."""
        position_m = flown.position_m if self.arrival == "truth" else flown.estimated_position_m
        gap_m = position_m - self._task().target_m
        there = np.flatnonzero(np.sqrt((gap_m * gap_m).sum(axis=1)) <= self.tolerance_m)
        return (int(there[0]), Outcome.REACHED) if len(there) else None

    def _task(self) -> World:
        if self._world is None:
            raise RuntimeError("reset(world) first")
        return self._world
