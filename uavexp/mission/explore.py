"""See all of the reachable space."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from uavexp.arrays import Float
from uavexp.errors import require
from uavexp.explorer.base import Explorer
from uavexp.log import Inspection
from uavexp.mission.base import Flown
from uavexp.parameters import NonNegative, Positive, option
from uavexp.scene import Scene
from uavexp.types import Goal, Limits, Observation, Outcome, World


@option
class Explore:
    """Explored = the explorer has had no goal for `patience_s`, and the vehicle is back if it is to be."""

    nothing_left: ClassVar[Outcome] = Outcome.EXPLORED
    patience_s: Positive = 2.0  # s, explored when no frontier was reachable for so long [ours]
    time_base_s: Positive = 120.0  # s, time limit = this ... [ours]
    time_per_area_spm2: NonNegative = 1.0  # s/m², ... plus this for each square metre of floor [ours]
    return_home: bool = False  # whether the vehicle flies back to the start when nothing is left to see
    tolerance_m: Positive = 0.3  # m, within which of the start, in truth, it is back [ours]
    _home_m: Float = field(init=False, repr=False, default_factory=lambda: np.zeros(3))
    _homeward: bool = field(init=False, repr=False, default=False)
    _time_limit_s: float = field(init=False, repr=False, default=0.0)
    _last_goal_s: float = field(init=False, repr=False, default=0.0)

    def requires(self, *, explorer: Explorer, **_: object) -> None:
        """Refuse an explorer that only flies to a target, of which there is none."""
        require(explorer.explores, "explore has no target: it needs an explorer that explores (frontier)")

    def prepare(self, world: World, rng: np.random.Generator) -> World:
        """The world as it is."""
        return world

    def guide(self, explorer: Explorer) -> Explorer:
        """The explorer, which is told of the start as a target on the way back."""
        return (
            Homing(inner=explorer, mission=self, rate_hz=explorer.rate_hz) if self.return_home else explorer
        )

    def findings(self) -> Inspection:
        """Nothing beyond what every flight records."""
        return Inspection()

    def reset(self, world: World, scene: Scene, limits: Limits) -> None:
        """Begin a trial in `world`."""
        extent_m = world.flight_bounds_m[1] - world.flight_bounds_m[0]
        self._time_limit_s = self.time_base_s + self.time_per_area_spm2 * float(extent_m[0] * extent_m[1])
        self._last_goal_s = 0.0
        self._home_m, self._homeward = world.start_m, False

    @property
    def home_m(self) -> Float | None:
        """(3,) on the way back; None before."""
        return self._home_m if self._homeward else None

    @property
    def target_m(self) -> Float | None:
        """None: there is no target."""
        return None

    @property
    def time_limit_s(self) -> float:
        """Base time plus a time for each square metre of floor."""
        return self._time_limit_s

    def outcome(self, flown: Flown, observation: Observation) -> tuple[int, Outcome] | None:
        """EXPLORED when no goal has been reachable for `patience_s`, on the way back: or it is there."""
        if observation.best_goal is not None:
            self._last_goal_s = float(flown.time_s[-1])
        over = flown.time_s - self._last_goal_s >= self.patience_s
        if self._homeward:
            gap_m = np.linalg.norm(flown.position_m - self._home_m, axis=1)
            over = over | (gap_m <= self.tolerance_m)
        elif self.return_home and over.any():
            self._homeward, self._last_goal_s = True, float(flown.time_s[-1])
            return None
        return (int(np.argmax(over)), Outcome.EXPLORED) if over.any() else None


@dataclass(slots=True, kw_only=True)
class Homing:
    """An explorer that is told of the start as a target when the mission is over but for the way back."""

    explores: ClassVar[bool] = True
    inner: Explorer
    mission: Explore
    rate_hz: float

    def reset(self, flight_height_m: float, limits: Limits) -> None:
        """Begin a trial."""
        self.inner.reset(flight_height_m, limits)

    def select(self, observation: Observation, *, fresh: bool = False) -> Goal | None:
        """The explorer's goal, or what it would fly to with the start as its target."""
        if self.mission.home_m is not None:
            observation = replace(observation, target_m=self.mission.home_m)
        return self.inner.select(observation, fresh=fresh)

    def reject(self, position_m: Float, time_s: float) -> None:
        """Set a goal aside."""
        self.inner.reject(position_m, time_s)
