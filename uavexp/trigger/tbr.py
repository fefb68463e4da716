"""Time-based replanning: every T_int seconds, whatever the map says (paper 1, baseline TBR)."""

from __future__ import annotations

import math
from dataclasses import field

from uavexp import causes
from uavexp.errors import require
from uavexp.field import DistanceField
from uavexp.parameters import Positive, option
from uavexp.trajectory import Trajectory
from uavexp.types import Decision, Limits, Observation


@option
class Tbr:
    """Replans on the first check at or after each multiple of `interval_s`."""

    interval_s: Positive = 5.0  # s, T_int; not given in the paper: 72.3 s / 14.6 replans is about 5 s
    _ticks: int = field(init=False, repr=False, default=0)

    def requires(self, *, stuck_s: float, **_: object) -> None:
        """Refuse a clock that first strikes when the flight has ended for standing still."""
        interval_s = self.interval_s
        require(interval_s < stuck_s, f"interval_s must be < stuck_s = {stuck_s}, got {interval_s}")

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
        return Decision(replan=True, cause=causes.CLOCK.name, score=1.0)
