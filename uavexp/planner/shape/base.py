"""Shaping: a found path in, a trajectory within the limits out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Protocol

from uavexp.planner.constraints import Constraints
from uavexp.planner.find.base import FoundPath
from uavexp.planner.movers.moving import MovingObstacles
from uavexp.trajectory import Trajectory
from uavexp.types import PlanRequest, PlanStatus


@dataclass(frozen=True, slots=True, kw_only=True)
class ShapedPath:
    """Answer of a shaper: what it cannot do is a status, not an exception."""

    status: PlanStatus
    reason: str = ""
    trajectory: Trajectory | None = None  # set exactly when status is OK
    iterations: int = 0  # of the solver

    def __post_init__(self) -> None:
        if (self.trajectory is not None) != (self.status is PlanStatus.OK):
            raise ValueError(f"a result with status {self.status} must have a trajectory iff ok")


class Shaper(Protocol):
    """Makes what any finder found a trajectory; keeps nothing between requests.

    It does not stop first where the start's speed defeats it: the planner does, and asks again.
    """

    sees_movers: ClassVar[bool]  # whether it keeps off them itself; else the planner judges its answer

    def shape(
        self, request: PlanRequest, found: FoundPath, constraints: Constraints, movers: MovingObstacles
    ) -> ShapedPath:
        """Return a trajectory that begins as requested and ends at the goal, or why there is none.

        Args:
            request: what was asked of the planner, with the map as it is.
            found: a path from the request's position to its goal, free at the least clearance; with
                its times, or as a ready motion, where the search has them.
            constraints: limits and clearances to be kept.
            movers: where they are predicted, and what is to be kept from them; may be none.
        """
