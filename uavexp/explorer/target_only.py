"""No exploration: the goal is always the mission's target, unknown space is flown into."""

from __future__ import annotations

from dataclasses import field
from typing import ClassVar

import numpy as np

from uavexp.arrays import Float
from uavexp.parameters import NonNegative, Positive, option
from uavexp.types import Goal, Limits, Observation


@option
class TargetOnly:
    """The target, until it is rejected; then again after `set_aside_s`."""

    explores: ClassVar[bool] = False
    rate_hz: Positive = 5.0  # Hz, goal rate
    set_aside_s: NonNegative = 1.0  # s, after a failed plan the target is not tried again for so long [ours]
    _until_s: float = field(init=False, repr=False, default=-1.0)

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
