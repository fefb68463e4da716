"""The rules of a pilot that flies plans as they come, and without one brakes, holds and gets on by itself."""

from __future__ import annotations

from uavexp.parameters import option
from uavexp.pilot.base import Crew
from uavexp.pilot.holding_pilot import HoldingPilot
from uavexp.pilot.recovering import Recovering
from uavexp.pilot.rules import Rules
from uavexp.pilot.steering import Steering

_YAW_SHARE = 0.9  # of the body-rate limit: roll and pitch need theirs


@option(frozen=True)
class Holding(Rules):
    """The rules; `HoldingPilot` flies by them."""

    def begin(self, crew: Crew) -> HoldingPilot:
        """Begin a trial."""
        most_radps = _YAW_SHARE * crew.limits.max_body_rate_radps
        return HoldingPilot(
            rules=self,
            crew=crew,
            steering=Steering(rules=self, yaw_rad=crew.start_yaw_rad, most_radps=most_radps),
            recovery=Recovering(rules=self, limits=crew.limits),
        )
