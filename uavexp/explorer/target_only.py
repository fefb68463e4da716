"""No exploration: the goal is always the mission's target, unknown space is flown into."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from uavexp.arrays import Float
from uavexp.errors import require_non_negative, require_positive
from uavexp.types import Goal, Limits, Observation


@dataclass(slots=True, kw_only=True)
class TargetOnly:
    """The target, until it is rejected; then again after `set_aside_s`."""

    rate_hz: float = 5.0
    set_aside_s: float = 1.0
    _until_s: float = field(init=False, repr=False, default=-1.0)

    def __post_init__(self) -> None:
        require_positive(rate_hz=self.rate_hz)
        require_non_negative(set_aside_s=self.set_aside_s)

    def reset(self, flight_height_m: float, limits: Limits) -> None:
        """Begin a trial."""
        self._until_s = -1.0

    def reject(self, position_m: Float, time_s: float) -> None:
        """Set the target aside for `set_aside_s`."""
        self._until_s = time_s + self.set_aside_s

    def select(self, observation: Observation, *, fresh: bool = False) -> Goal | None:
        """Return the target; None while it is set aside or when the mission has none."""
        target_m = observation.target_m
        if target_m is None or observation.time_s < self._until_s:
            return None
        distance_m = float(np.linalg.norm(target_m - observation.state.position_m))
        return Goal(position_m=target_m, is_target=True, score=-distance_m)
