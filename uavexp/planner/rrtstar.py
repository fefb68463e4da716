"""RRT* of OMPL (Karaman and Frazzoli 2011), an independent peer of `df_bitstar`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from uavexp.errors import require, require_non_negative, require_positive
from uavexp.planner.find.ompl_planner import OmplPlanner


@dataclass(slots=True, kw_only=True)
class Rrtstar(OmplPlanner):
    """OMPL's RRTstar on the project's free space, smoothed."""

    algorithm: ClassVar[str] = "RRTstar"
    option: ClassVar[str] = "rrtstar"

    max_edge_m: float = 2.0
    goal_bias: float = 0.05
    max_iterations: int = 6_000

    def __post_init__(self) -> None:
        OmplPlanner.__post_init__(self)
        require_positive(max_edge_m=self.max_edge_m)
        require_non_negative(goal_bias=self.goal_bias)
        require(self.goal_bias <= 1.0, f"goal_bias must be in [0, 1], got {self.goal_bias}")

    def settings(self) -> dict[str, float]:
        """OMPL's setters and what they are given."""
        return {
            "setRange": self.max_edge_m,
            "setGoalBias": self.goal_bias,
            "setRewireFactor": self.rewire_factor,
        }
