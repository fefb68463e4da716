"""Smoothing: a collision-free polyline in, a trajectory within the limits out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from uavexp.arrays import Float
from uavexp.trajectory import Trajectory
from uavexp.types import Limits, PlanRequest, PlanStatus


@dataclass(frozen=True, slots=True, kw_only=True)
class SmoothResult:
    """Answer of a smoother: what it cannot do is a status, not an exception."""

    status: PlanStatus
    trajectory: Trajectory | None = None  # set exactly when status is OK
    reason: str = ""
    iterations: int = 0  # of the solver

    def __post_init__(self) -> None:
        if (self.trajectory is not None) != (self.status is PlanStatus.OK):
            raise ValueError(f"a result with status {self.status} must have a trajectory iff ok")


class Smoother(Protocol):
    """Turns any planner's path into what can be flown; has no state."""

    def smooth(
        self,
        request: PlanRequest,
        path_m: Float,
        times_s: Float | None,
        limits: Limits,
        min_clearance_m: float,
        known_only: bool,
    ) -> SmoothResult:
        """Return a trajectory that begins as requested and ends at the path's end.

        Args:
            request: what was asked of the planner.
            path_m: (P, 3) from the request's position to its goal, free at `min_clearance_m`.
            times_s: (P,) seconds from the start at which a dynamic planner passes these points;
                None: the smoother times the path.
            limits: of the vehicle.
            min_clearance_m: least mapped distance of the body centre.
            known_only: whether unknown space is closed.
        """
        ...
