"""Improved A*: a price on turning, a rule for vertical steps, a smoothed path (Liao et al., section 5).

The search is `voxel.directed`: the paper's form, with the penalty in f only, or the exact one
that minimises Σ (length + λ (1 - cos θ)). Its path is cut to key waypoints, freed of reversals
and joined by a quadratic spline, every part checked against the map (`voxel.smoothing`). After
a trigger the first step is weighed against the velocity flown.

The vertical rule can make a solvable query unsolvable, and the larger state can exhaust the
budget; plain A* answers then, and the plan says so in its reason.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from functools import partial

import numpy as np

from uavexp.arrays import Float, Int
from uavexp.errors import require_non_negative, require_option, require_positive
from uavexp.field import DistanceField
from uavexp.planner.find.grid import FoundPath
from uavexp.planner.find.voxel import directed, live
from uavexp.planner.find.voxel.canonical import BUDGET
from uavexp.planner.find.voxel.grid import Turning, VoxelGrid, VoxelPath
from uavexp.planner.min_acc import MinAcc
from uavexp.types import Limits, PlanRequest, PlanResult

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


@dataclass(slots=True, kw_only=True)
class ImprovedAstar:
    """A* with directional continuity and suppressed vertical motion, smoothed, flown as `min_acc` does."""

    min_clearance_m: float = 0.26
    z_band_m: float = 0.3
    unknown: str = "optimistic"
    max_expansions: int = 300_000
    form: Form = Form.PAPER
    turn_weight: float = 0.5
    weight_unit: WeightUnit = WeightUnit.VOXELS
    first_step_weight: float = 2.0
    vertical_rule: VerticalRule = VerticalRule.OR
    n_horizontal: HorizontalCount = HorizontalCount.STEPS
    spline: bool = True
    mover_margin_m: float = 0.5
    mover_horizon_s: float = 2.0
    _flight: MinAcc | None = field(default=None, init=False, repr=False)
    _velocity_mps: Float = field(default_factory=lambda: np.zeros(3), init=False, repr=False)

    def __post_init__(self) -> None:
        require_positive(min_clearance_m=self.min_clearance_m)
        require_non_negative(
            z_band_m=self.z_band_m, turn_weight=self.turn_weight, first_step_weight=self.first_step_weight
        )
        self.form = require_option("form", self.form, Form)
        self.weight_unit = require_option("weight_unit", self.weight_unit, WeightUnit)
        self.vertical_rule = require_option("vertical_rule", self.vertical_rule, VerticalRule)
        self.n_horizontal = require_option("n_horizontal", self.n_horizontal, HorizontalCount)
        self._shaped()  # checks what it is given

    def _shaped(self) -> MinAcc:
        return MinAcc(
            min_clearance_m=self.min_clearance_m,
            z_band_m=self.z_band_m,
            unknown=self.unknown,
            max_expansions=self.max_expansions,
            mover_margin_m=self.mover_margin_m,
            mover_horizon_s=self.mover_horizon_s,
        )

    def reset(self, limits: Limits, rng: np.random.Generator) -> None:
        """Begin a trial of a vehicle with these limits; draws nothing."""
        self._flight = self._shaped()
        self._flight.reset(limits, rng)

    def plan(self, request: PlanRequest) -> PlanResult:
        """Return a trajectory or the reason why there is none (`Planner.plan`)."""
        if self._flight is None:
            raise RuntimeError("plan() needs reset() first")
        self._velocity_mps = request.velocity_mps
        return self._flight.plan_along(request, self)

    def wish(self, voxel_size_m: float, velocity_mps: Float | None = None) -> Turning:
        """What a search in voxels of this size is asked for, at this velocity (3,)."""
        unit = 1.0 if self.weight_unit is WeightUnit.VOXELS else 1.0 / voxel_size_m
        velocity = np.zeros(3) if velocity_mps is None else velocity_mps
        speed = float(np.linalg.norm(velocity))
        x, y, z = velocity / speed if speed > _SLOW_MPS else np.zeros(3)
        return Turning(
            exact=self.form is Form.EXACT,
            turn_weight=unit * self.turn_weight,
            first_weight=unit * self.first_step_weight,
            first_direction=(float(x), float(y), float(z)),
            rule=_RULES[self.vertical_rule],
            reading=directed.COUNT_OPEN
            if self.n_horizontal is HorizontalCount.NEIGHBOURS
            else directed.COUNT_MADE,
        )

    def search(self, grid: VoxelGrid, start: Int, goal: Int, wish: Turning) -> tuple[VoxelPath, str]:
        """Path between two cells (3,), and what is to be said when plain A* had to answer."""
        answer = grid.turning(start, goal, wish, self.max_expansions)
        if answer.found:
            return answer, ""
        plain = grid.shortest(start, goal, self.max_expansions)
        plain = plain._replace(expansions=plain.expansions + answer.expansions)
        if answer.status == BUDGET:
            return plain, f"plain A*: not found in {self.max_expansions} expansions"
        return plain, "plain A*: the vertical rule leaves no path"

    def find(self, field_: DistanceField, start_m: Float, goal_m: Float, bounds_m: Float) -> FoundPath:
        """Return the path on the map (`search.Finder.find`)."""
        wish = self.wish(field_.voxel_size_m, self._velocity_mps)
        return live.find(
            field_, start_m, goal_m, bounds_m, partial(self.search, wish=wish),
            min_clearance_m=self.min_clearance_m, z_band_m=self.z_band_m,
            known_only=self.unknown == "conservative", spline=self.spline,
        )  # fmt: skip
