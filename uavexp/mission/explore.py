"""See all of the reachable space."""

from __future__ import annotations

from dataclasses import field
from typing import ClassVar

import numpy as np

from uavexp.arrays import Float
from uavexp.errors import require
from uavexp.explorer.base import Explorer
from uavexp.log import Inspection
from uavexp.mission.base import Flown
from uavexp.parameters import NonNegative, Positive, option
from uavexp.scene import Scene
from uavexp.types import Limits, Observation, Outcome, World


@option
class Explore:
    """Explored = the explorer has had no goal for `patience_s`."""

    nothing_left: ClassVar[Outcome] = Outcome.EXPLORED
    patience_s: Positive = 2.0  # s, explored when no frontier was reachable for so long [ours]
    time_base_s: Positive = 120.0  # s, time limit = this ... [ours]
    time_per_area_spm2: NonNegative = 1.0  # s/m², ... plus this for each square metre of floor [ours]
    _time_limit_s: float = field(init=False, repr=False, default=0.0)
    _last_goal_s: float = field(init=False, repr=False, default=0.0)

    def requires(self, *, explorer: Explorer, **_: object) -> None:
        """Refuse an explorer that only flies to a target, of which there is none."""
        require(explorer.explores, "explore has no target: it needs an explorer that explores (frontier)")

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
        extent_m = world.flight_bounds_m[1] - world.flight_bounds_m[0]
        self._time_limit_s = self.time_base_s + self.time_per_area_spm2 * float(extent_m[0] * extent_m[1])
        self._last_goal_s = 0.0

    @property
    def target_m(self) -> Float | None:
        """None: there is no target."""
        return None

    @property
    def time_limit_s(self) -> float:
        """Base time plus a time for each square metre of floor."""
        return self._time_limit_s

    def outcome(self, flown: Flown, observation: Observation) -> tuple[int, Outcome] | None:
        """EXPLORED when no frontier has been reachable for `patience_s`."""
        if observation.best_goal is not None:
            self._last_goal_s = float(flown.time_s[-1])
        over = np.flatnonzero(flown.time_s - self._last_goal_s >= self.patience_s)
        return (int(over[0]), Outcome.EXPLORED) if len(over) else None
