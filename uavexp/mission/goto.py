"""Reach the target."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from uavexp.arrays import Float
from uavexp.errors import require_non_negative, require_positive
from uavexp.explorer.base import Explorer
from uavexp.log import Inspection
from uavexp.scene import Scene
from uavexp.types import Limits, Observation, Outcome, State, World


@dataclass(slots=True, kw_only=True)
class Goto:
    """Reached = within `tolerance_m` of the target, in truth."""

    tolerance_m: float = 0.3
    time_base_s: float = 60.0
    time_per_path_spm: float = 5.0
    _world: World | None = field(init=False, repr=False, default=None)

    def __post_init__(self) -> None:
        require_positive(tolerance_m=self.tolerance_m, time_base_s=self.time_base_s)
        require_non_negative(time_per_path_spm=self.time_per_path_spm)

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

    def outcome(self, true_state: State, observation: Observation) -> Outcome | None:
        """REACHED within the tolerance of the target."""
        distance_m = np.linalg.norm(true_state.position_m - self._task().target_m)
        return Outcome.REACHED if distance_m <= self.tolerance_m else None

    def _task(self) -> World:
        if self._world is None:
            raise RuntimeError("reset(world) first")
        return self._world
