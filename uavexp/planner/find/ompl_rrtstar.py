"""RRT* of OMPL (Karaman and Frazzoli 2011), an independent peer of `tree`."""

from __future__ import annotations

from typing import Annotated, ClassVar

from uavexp.parameters import Count, Positive, between, option
from uavexp.planner.find.ompl import Ompl


@option
class OmplRrtstar(Ompl):
    """OMPL's RRTstar on the project's free space."""

    algorithm: ClassVar[str] = "RRTstar"

    max_edge_m: Positive = 2.0  # m, longest edge; the paper's 0.5 finds a way through a building late and
    # improves it little
    goal_bias: Annotated[float, between(0.001, 1)] = 0.05  # 1, share of the samples that are the goal, which
    # no other sample hits (OMPL's default)
    max_iterations: Count = 6_000  # samples; the paper names 3000

    def settings(self) -> dict[str, float]:
        """OMPL's setters and what they are given."""
        return {
            "setRange": self.max_edge_m,
            "setGoalBias": self.goal_bias,
            "setRewireFactor": self.rewire_factor,
        }
