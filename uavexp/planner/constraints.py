"""What a planner's paths and curves keep, whatever finds and shapes them."""

from __future__ import annotations

from dataclasses import dataclass

from uavexp.types import Limits


@dataclass(frozen=True, slots=True, kw_only=True)
class Constraints:
    """Fixed for a trial; predicted movers are told apart (`movers.moving`)."""

    limits: Limits
    min_clearance_m: float  # hard limit on the mapped distance of the body centre
    safe_clearance_m: float  # beyond it nothing is gained
    z_band_m: float  # the heights between start and goal may be left by this much
    known_only: bool  # unknown space is closed
