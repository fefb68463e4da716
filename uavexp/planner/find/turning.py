"""Improved A*: a price on turning and a rule for vertical steps (Liao et al., section 5).

The search is `voxels.directed`: the paper's form, with the penalty in f only, or the exact one
that minimises Σ (length + λ (1 - cos θ)). Its path is cut to key waypoints, freed of reversals
and joined by a quadratic spline, every part checked against the map (`voxels.waypoints`). After
a trigger the first step is weighed against the velocity flown.

The vertical rule can make a solvable query unsolvable, and the larger state can exhaust the
budget; plain A* answers then, and the plan says so in its reason.
"""

from __future__ import annotations

from enum import StrEnum
from functools import partial

import numpy as np

from uavexp.arrays import Float, Int
from uavexp.parameters import Count, NonNegative, option
from uavexp.planner.constraints import Constraints
from uavexp.planner.find.base import FoundPath
from uavexp.planner.find.voxels import directed
from uavexp.planner.find.voxels.canonical import BUDGET
from uavexp.planner.find.voxels.live import find_among_voxels
from uavexp.planner.find.voxels.voxel_grid import VoxelGrid, VoxelPath, Wish
from uavexp.types import PlanRequest

_SLOW_MPS = 0.1  # a slower start has no direction


class Form(StrEnum):
    """Where the turning penalty counts."""

    PAPER = "paper"
    EXACT = "exact"


class WeightUnit(StrEnum):
    """What λ is counted in; the paper does not say."""

    VOXELS = "voxels"
    METRES = "metres"


class VerticalRule(StrEnum):
    """How the conditions for vertical steps are joined."""

    NONE = "none"
    OR = "or"
    AND = "and"


class HorizontalCount(StrEnum):
    """What N_horizontal counts."""

    STEPS = "steps"
    NEIGHBOURS = "neighbours"


_RULES = {
    VerticalRule.NONE: directed.RULE_NONE,
    VerticalRule.OR: directed.RULE_OR,
    VerticalRule.AND: directed.RULE_AND,
}


@option
class Turning:
    """A* with directional continuity and suppressed vertical motion, smoothed."""

    max_expansions: Count = 300_000  # states that the search may expand; plain A* answers when they are
    # spent
    form: Form = Form.PAPER  # paper: penalty in f only (5-1); exact: direction in the state, the sum is
    # minimised [ours], up to 100 times slower
    turn_weight: NonNegative = 0.5  # lambda of P = lambda (1 - cos theta), paper 2; 45 degrees cost 0.15 of
    # a voxel
    weight_unit: WeightUnit = WeightUnit.VOXELS  # voxels or metres: what lambda counts in, not said in the
    # paper [ours]
    first_step_weight: NonNegative = 2.0  # the same for the first step against the velocity flown [ours,
    # the paper names it only]
    vertical_rule: VerticalRule = VerticalRule.OR  # or | and | none: how the conditions of (5-2) are
    # joined; with "and" no climb is solvable
    n_horizontal: HorizontalCount = HorizontalCount.STEPS  # steps since the last vertical one | open
    # neighbours in the plane: both readings of N_horizontal
    spline: bool = True  # whether the key waypoints are joined by a quadratic spline, every part checked
    # (paper 2, 5.3)

    def find(self, request: PlanRequest, constraints: Constraints, rng: np.random.Generator) -> FoundPath:
        """Return the path, or why there is none (`Finder.find`); draws nothing."""
        del rng
        wish = self.wish(request.field.voxel_size_m, request.velocity_mps)
        return find_among_voxels(request, constraints, partial(self.search, wish=wish), self.spline)

    def wish(self, voxel_size_m: float, velocity_mps: Float | None = None) -> Wish:
        """What a search in voxels of this size is asked for, at this velocity (3,)."""
        unit = 1.0 if self.weight_unit is WeightUnit.VOXELS else 1.0 / voxel_size_m
        velocity = np.zeros(3) if velocity_mps is None else velocity_mps
        speed = float(np.linalg.norm(velocity))
        x, y, z = velocity / speed if speed > _SLOW_MPS else np.zeros(3)
        return Wish(
            exact=self.form is Form.EXACT,
            turn_weight=unit * self.turn_weight,
            first_weight=unit * self.first_step_weight,
            first_direction=(float(x), float(y), float(z)),
            rule=_RULES[self.vertical_rule],
            reading=directed.COUNT_OPEN
            if self.n_horizontal is HorizontalCount.NEIGHBOURS
            else directed.COUNT_MADE,
        )

    def search(self, grid: VoxelGrid, start: Int, goal: Int, wish: Wish) -> tuple[VoxelPath, str]:
        """Path between two cells (3,), and what is to be said when plain A* had to answer."""
        answer = grid.turning(start, goal, wish, self.max_expansions)
        if answer.found:
            return answer, ""
        plain = grid.shortest(start, goal, self.max_expansions)
        plain = plain._replace(expansions=plain.expansions + answer.expansions)
        if answer.status == BUDGET:
            return plain, f"plain A*: not found in {self.max_expansions} expansions"
        return plain, "plain A*: the vertical rule leaves no path"
