"""What OMPL's planners have in common here: peers of `tree` on the same free space."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from uavexp.parameters import Count, Positive
from uavexp.planner.constraints import Constraints
from uavexp.planner.find.base import FoundPath
from uavexp.planner.find.ends import refusal
from uavexp.planner.find.free_space import space_of
from uavexp.planner.find.ompl_search import Query
from uavexp.planner.find.ompl_server import search_with_ompl
from uavexp.types import PlanRequest, PlanStatus


@dataclass(slots=True, kw_only=True)
class Ompl(ABC):
    """A planner of OMPL in a process of its own; what it is, its subclass says."""

    algorithm: ClassVar[str]  # OMPL's class

    rewire_factor: Positive = 1.1  # 1, on the radius of the random geometric graph (OMPL's default)
    max_iterations: Count = 20_000  # steps of its queues, as OMPL counts them

    @abstractmethod
    def settings(self) -> dict[str, float]:
        """OMPL's setters and what they are given."""

    def find(self, request: PlanRequest, constraints: Constraints, rng: np.random.Generator) -> FoundPath:
        """Return the path, or why there is none (`Finder.find`).

        Raises:
            ConfigError: when OMPL is not installed.
        """
        refused = refusal(request, constraints)
        if refused is not None:
            return refused
        space, seed = space_of(request, constraints), int(rng.integers(1, 2**31))
        answer = search_with_ompl(Query(self.algorithm, self.settings(), space, seed, self.max_iterations))
        return FoundPath(
            status=PlanStatus.OK if len(answer.path) else PlanStatus.NO_PATH,
            reason="" if len(answer.path) else f"not found in {answer.iterations} iterations",
            path_m=answer.path,
            cost=float(answer.history[-1, 1]) if len(answer.history) else np.inf,
            expansions=answer.iterations,
            checks=answer.checks,
            history=answer.history[:, :2],
            wall_s=answer.cpu_s,  # of the search alone: its process may have had to start
        )
