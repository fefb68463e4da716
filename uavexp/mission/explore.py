"""See all of the reachable space."""

from __future__ import annotations

from dataclasses import dataclass, field

from uavexp.errors import require_non_negative, require_positive
from uavexp.types import Float, Observation, Outcome, World


@dataclass(slots=True, kw_only=True)
class Explore:
    """Explored = the explorer has had no goal for `patience_s`."""

    patience_s: float = 2.0
    time_base_s: float = 120.0
    time_per_area_spm2: float = 1.0
    _time_limit_s: float = field(init=False, repr=False, default=0.0)
    _last_goal_s: float = field(init=False, repr=False, default=0.0)

    def __post_init__(self) -> None:
        require_positive(patience_s=self.patience_s, time_base_s=self.time_base_s)
        require_non_negative(time_per_area_spm2=self.time_per_area_spm2)

    def reset(self, world: World) -> None:
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

    def outcome(self, true_position_m: Float, observation: Observation) -> Outcome | None:
        """EXPLORED when no frontier has been reachable for `patience_s`."""
        if observation.best_goal is not None:
            self._last_goal_s = observation.time_s
        return Outcome.EXPLORED if observation.time_s - self._last_goal_s >= self.patience_s else None
