"""Time-based replanning: every T_int seconds, whatever the map says (paper 1, baseline TBR)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from uavexp.errors import require_positive
from uavexp.field import DistanceField
from uavexp.trajectory import Trajectory
from uavexp.types import Decision, Limits, Observation


@dataclass(slots=True, kw_only=True)
class Tbr:
    """Replans on the first check at or after each multiple of `interval_s`."""

    interval_s: float = 5.0
    _ticks: int = field(init=False, repr=False, default=0)

    def __post_init__(self) -> None:
        require_positive(interval_s=self.interval_s)

    def reset(self, limits: Limits) -> None:
        """Begin a trial; the clock starts with it."""
        self._ticks = 0

    def planned(self, trajectory: Trajectory, field: DistanceField) -> None:
        """Take note of a new plan; the clock does not care."""

    def decide(self, observation: Observation) -> Decision:
        """Replan when another interval is over."""
        ticks = math.floor(observation.time_s / self.interval_s + 1e-9)
        if ticks <= self._ticks:
            return Decision(replan=False)
        self._ticks = ticks
        return Decision(replan=True, cause="clock", score=1.0)
