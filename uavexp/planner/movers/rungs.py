"""How a plan keeps clear of predicted movers: tries in turn, each with the movers in the search's map or not.

A shaper that sees movers leads the trajectory past them in time, so its search has only to suggest where:
movers close what they cover, and where they close all, the map as it is will do. For a shaper that sees
none they are solid, met at one pace or another; what the search then finds is judged in time.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from uavexp.planner.constraints import Constraints
from uavexp.planner.movers.moving import MovingObstacles
from uavexp.types import PlanRequest

_RESERVE_VOXELS = 0.5  # of a search's own limit above the least clearance, and more
_CARE_M = 0.5  # beyond the least clearance, up to which a solid mover is felt


class Rung(NamedTuple):
    """One try."""

    pace: (
        float | None
    )  # share of the speed limit at which movers are met in the map; None: they are not in it
    margin: float = 1.0  # share of the margin that is kept from them
    reason: str = ""  # given with the plan


ALONE = (Rung(None),)
_SEEN = (Rung(1.0 / 1.1), Rung(1.0 / 1.1, 0.4, "passes movers closely"))
_UNSEEN = (Rung(0.9), Rung(0.5), Rung(None))


def rungs(sees_movers: bool) -> tuple[Rung, ...]:
    """What is tried among movers, with a shaper that sees them or not."""
    return _SEEN if sees_movers else _UNSEEN


def met(
    request: PlanRequest, constraints: Constraints, movers: MovingObstacles, pace: float, solid: bool
) -> PlanRequest:
    """The request with every mover in its map, where the vehicle would meet it at a pace."""
    least_m = constraints.min_clearance_m
    map_ = movers.stamped(
        request,
        speed_mps=pace * constraints.limits.max_speed_mps,
        acceleration_mps2=constraints.limits.max_acceleration_mps2,
        least_m=least_m if solid else least_m + _RESERVE_VOXELS * request.field.voxel_size_m,
        safe_m=least_m + _CARE_M if solid else constraints.safe_clearance_m,
        solid=solid,
    )
    return replace(request, field=map_)
