"""A* path, then B-spline smoothing in a corridor of convex free regions (paper 4's second half).

The search is `min_acc`'s (`search`), the smoothing `smoothing.bspline_qp`.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field

import numpy as np

from uavexp.errors import require, require_non_negative, require_option, require_positive
from uavexp.planner.find.grid import PathSearch
from uavexp.planner.movers.among import plan_among
from uavexp.planner.shape.corridor_qp import BsplineSmoother, Derivative
from uavexp.types import Limits, PlanRequest, PlanResult, PlanStatus


@dataclass(slots=True, kw_only=True)
class BsplineQp:
    """Least acceleration, jerk or snap in a corridor around an A* path."""

    min_clearance_m: float = 0.26
    safe_clearance_m: float = 0.75
    path_clearance_weight: float = 2.0
    z_band_m: float = 0.3
    unknown: str = "optimistic"
    max_expansions: int = 300_000
    mover_margin_m: float = 0.5
    mover_horizon_s: float = 2.0
    derivative: Derivative = Derivative.ACCELERATION
    span_s: float = 0.3
    duration_margin: float = 1.05
    end_speed_mps: float = 1.5
    _limits: Limits | None = field(default=None, init=False, repr=False)
    _search: PathSearch | None = field(default=None, init=False, repr=False)
    _smoother: BsplineSmoother | None = field(default=None, init=False, repr=False)

    def __post_init__(self) -> None:
        require_positive(min_clearance_m=self.min_clearance_m, safe_clearance_m=self.safe_clearance_m)
        require_non_negative(
            mover_margin_m=self.mover_margin_m,
            mover_horizon_s=self.mover_horizon_s,
            path_clearance_weight=self.path_clearance_weight,
            z_band_m=self.z_band_m,
        )
        require(
            self.safe_clearance_m > self.min_clearance_m,
            f"safe_clearance_m must be > min_clearance_m {self.min_clearance_m}, got {self.safe_clearance_m}",
        )
        require(
            isinstance(self.max_expansions, int) and self.max_expansions >= 1,
            f"max_expansions must be a whole number >= 1, got {self.max_expansions!r}",
        )
        require(
            self.unknown in ("optimistic", "conservative"),
            f"unknown must be optimistic or conservative, got {self.unknown!r}",
        )
        self.derivative = require_option("derivative", self.derivative, Derivative)
        self._smoother = BsplineSmoother(
            derivative=self.derivative,
            span_s=self.span_s,
            duration_margin=self.duration_margin,
            end_speed_mps=self.end_speed_mps,
        )

    def reset(self, limits: Limits, rng: np.random.Generator) -> None:
        """Begin a trial of a vehicle with these limits; draws nothing."""
        del rng
        self._limits = limits
        self._search = PathSearch(
            min_clearance_m=self.min_clearance_m,
            safe_clearance_m=self.safe_clearance_m,
            clearance_weight=self.path_clearance_weight,
            z_band_m=self.z_band_m,
            known_only=self.unknown == "conservative",
            max_expansions=self.max_expansions,
        )

    def plan(self, request: PlanRequest) -> PlanResult:
        """Return a trajectory or the reason why there is none (`Planner.plan`)."""
        if self._limits is None:
            raise RuntimeError("plan() needs reset() first")
        return plan_among(
            request,
            self._plan,
            self._limits,
            margin_m=self.mover_margin_m,
            horizon_s=self.mover_horizon_s,
            min_clearance_m=self.min_clearance_m,
            known_only=self.unknown == "conservative",
        )

    def _plan(self, request: PlanRequest) -> PlanResult:
        """Plan in the map as it is."""
        assert self._limits is not None
        assert self._search is not None
        assert self._smoother is not None
        began = time.perf_counter()
        goal_m = request.goal.position_m
        found = self._search.find(request.field, request.position_m, goal_m, request.flight_bounds_m)
        searched = time.perf_counter()
        if found.status is not PlanStatus.OK:
            return PlanResult(
                status=found.status,
                reason=found.reason,
                expansions=found.expansions,
                wall_search_s=searched - began,
            )
        known_only = self.unknown == "conservative"
        smoothed = self._smoother.smooth(
            request, found.path_m, None, self._limits, self.min_clearance_m, known_only
        )
        return PlanResult(
            status=smoothed.status,
            trajectory=smoothed.trajectory,
            path_m=found.path_m,
            reason=smoothed.reason,
            iterations=smoothed.iterations,
            expansions=found.expansions,
            wall_search_s=searched - began,
            wall_optimise_s=time.perf_counter() - searched,
        )
