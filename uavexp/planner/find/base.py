"""Finding a path through the mapped space, for any shaper."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from uavexp.arrays import Float
from uavexp.planner.constraints import Constraints
from uavexp.trajectory import Trajectory
from uavexp.types import PlanRequest, PlanStatus


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundPath:
    """Answer of a search: what it cannot do is a status, not an exception."""

    status: PlanStatus
    reason: str = ""  # why there is none, or what is to be said of it
    path_m: Float = field(default_factory=lambda: np.zeros((0, 3)))  # (P, 3) start to goal; empty unless OK
    times_s: Float | None = None  # (P,) from the start, where the search has them
    motion: Trajectory | None = None  # that leads along it, where the search has one
    cost: float = np.inf  # that the search minimised
    expansions: int = 0  # of cells, or edges tried
    checks: int = 0  # looks at the map
    history: Float = field(default_factory=lambda: np.zeros((0, 2)))  # (K, 2) iteration and best cost
    tree_m: Float = field(default_factory=lambda: np.zeros((0, 2, 3)))  # (E, 2, 3) edges
    wall_s: float | None = None  # of the search, where that is not the time of the call


class Finder(Protocol):
    """Finds paths on request; keeps nothing but memory between them."""

    def find(self, request: PlanRequest, constraints: Constraints, rng: np.random.Generator) -> FoundPath:
        """Return a path from the request's position to its goal, free on its map, or why there is none.

        Args:
            request: what was asked of the planner; movers are part of its map, where they count.
            constraints: what the path keeps.
            rng: all that is drawn comes from here; in the same state at every request of a trial.
        """
