"""Minimum-acceleration trajectories: A* path, then sequential convex programming.

    min over r(t) of ∫₀ᵀ ‖r''‖² + λ c(r) dt      (METHODS.md, paper 1)
    r, r', r'' at 0 as requested; r(T) = goal; ‖r'‖ <= v_max, ‖r''‖ <= a_max on [0, T]

r is a uniform cubic B-spline. The energy and the sampling of the curve are written in CasADi
(`spline`) and its matrices taken once. Each step builds the convex local model of the
obstacle cost in numba (`scp`) and solves a QP with daqp, an exact dense active-set method;
a line search on the true cost follows. Limits are rows of the QP, checked exactly after it.

Duration: the time-optimal traversal of the curve's own shape under the limits (`timing`),
times a margin; taken first from the smoothed path, then from the optimised curve. If the
spline cannot keep the limits in that time (it cannot jump in acceleration), it is stretched.

Clearance: hard, checked every half voxel on the result. When it fails, the next rung of a fixed
ladder makes obstacles dearer, the flight slower and ties the curve to the path.

Left out: yaw; the cost per metre (c is per second, as in the paper); moving obstacles.
All budgets are iterations; the answer depends on the request and nothing else.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import NamedTuple

import daqp
import numpy as np

from uavexp.errors import require, require_non_negative, require_positive
from uavexp.mapping.base import DistanceField
from uavexp.planner.scp import limit_rows, merit, quadratic_model
from uavexp.planner.search import FoundPath, PathSearch
from uavexp.planner.spline import (
    SAMPLES,
    peak_acceleration,
    peak_speed,
    pin_ends,
    sample_spline,
    spline_model,
    to_trajectory,
)
from uavexp.planner.timing import STEP_M, place_by_time, resample, smooth, time_profile
from uavexp.types import Float, Float32, Limits, PlanRequest, PlanResult, PlanStatus

_FEWEST, _MOST = 10, 30  # control points
_SMOOTHING_ROUNDS = 10  # of the A* path's steps of a voxel
_START_EXCESS = 1.1  # a start beyond a limit by more than this factor is refused
_QP_SHARE = 0.985  # of the limits, inside the QP: room for its linearisation
_STRETCHES = 6
_STRETCH = 1.06  # least factor by which a duration is stretched
_LINE_SEARCH = (1.0, 0.5, 0.25, 0.1)
_HARD_ABOVE_VOXELS = 0.5  # the steep part of the obstacle cost begins this far above the hard limit
_START_SLACK_M = 0.01


class _Rung(NamedTuple):
    """One try of the ladder."""

    weight: float  # factor on λ
    slower: float  # factor on the duration
    tether: float  # pull to the path, 1/s⁴ (a deviation of 1 m costs this as an acceleration²)


_LADDER = (_Rung(1.0, 1.0, 0.0), _Rung(4.0, 1.15, 0.0), _Rung(8.0, 1.35, 50.0), _Rung(16.0, 1.8, 400.0))


class _Problem(NamedTuple):
    """One request, prepared."""

    path: Float  # (P, 3) smoothed, STEP_M apart
    raw: Float  # (P', 3) as searched, resampled
    start: Float  # (3, 3) position, velocity, acceleration
    end: Float  # (3, 3)
    field: DistanceField
    bounds: Float  # (2, 3)
    max_speed: float  # what the result is held to, m/s
    max_acceleration: float


class _Curve(NamedTuple):
    """A candidate."""

    control: Float  # (N, 3)
    h: float  # knot spacing, s


@dataclass(slots=True, kw_only=True)
class MinAcc:
    """Minimum-acceleration B-spline through the mapped space, on an A* path."""

    min_clearance_m: float = 0.28
    safe_clearance_m: float = 0.75
    obstacle_weight: float = 20.0
    end_speed_mps: float = 1.5
    duration_margin: float = 1.1
    control_spacing_m: float = 0.5
    first_iterations: int = 3
    final_iterations: int = 5
    tolerance_m: float = 0.01
    path_clearance_weight: float = 2.0
    z_band_m: float = 0.3
    unknown: str = "optimistic"
    max_expansions: int = 300_000
    _limits: Limits | None = field(default=None, init=False, repr=False)
    _search: PathSearch | None = field(default=None, init=False, repr=False)
    _iterations: int = field(default=0, init=False, repr=False)

    def __post_init__(self) -> None:
        require_positive(
            min_clearance_m=self.min_clearance_m,
            safe_clearance_m=self.safe_clearance_m,
            obstacle_weight=self.obstacle_weight,
            control_spacing_m=self.control_spacing_m,
            tolerance_m=self.tolerance_m,
        )
        require_non_negative(
            end_speed_mps=self.end_speed_mps,
            path_clearance_weight=self.path_clearance_weight,
            z_band_m=self.z_band_m,
        )
        require(
            self.safe_clearance_m > self.min_clearance_m,
            f"safe_clearance_m must be > min_clearance_m = {self.min_clearance_m}, got {self.safe_clearance_m}",
        )
        require(
            1.0 <= self.duration_margin <= 10.0,
            f"duration_margin must be in [1, 10], got {self.duration_margin}",
        )
        for name in ("first_iterations", "final_iterations", "max_expansions"):
            value = getattr(self, name)
            require(
                isinstance(value, int) and not isinstance(value, bool) and value >= 1,
                f"{name} must be a whole number >= 1, got {value!r}",
            )
        require(
            self.unknown in ("optimistic", "conservative"),
            f"unknown must be optimistic or conservative, got {self.unknown!r}",
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
        if self._limits is None or self._search is None:
            raise RuntimeError("plan() needs reset() first")
        began = time.perf_counter()
        goal_m = request.goal.position_m
        found = self._search.find(request.field, request.position_m, goal_m, request.flight_bounds_m)
        searched = time.perf_counter()
        if found.status is not PlanStatus.OK:
            return _answer(found, found.status, found.reason, wall_search_s=searched - began)
        self._iterations = 0
        status, reason, curve = self._optimise(request, found.path_m)
        trajectory = None
        if curve is not None:
            trajectory = to_trajectory(curve.control, curve.h, request.time_s, request.goal.is_target)
        return PlanResult(
            status=status,
            trajectory=trajectory,
            path_m=found.path_m,
            reason=reason,
            iterations=self._iterations,
            expansions=found.expansions,
            wall_search_s=searched - began,
            wall_optimise_s=time.perf_counter() - searched,
        )

    def _optimise(self, request: PlanRequest, path_m: Float) -> tuple[PlanStatus, str, _Curve | None]:
        """Walk the ladder until a curve keeps limits and clearance."""
        problem = self._prepare(request, path_m)
        if problem is None:
            return PlanStatus.LIMITS, "the start itself is far beyond the limits", None
        worst = (PlanStatus.LIMITS, "no duration keeps the limits")
        for rung in _LADDER:
            curve = self._shape(problem, rung)
            if curve is None:
                continue
            if not np.isfinite(curve.control).all():
                worst = (PlanStatus.SOLVER, "the solver returned NaN")
                continue
            shortfall = self._shortfall(problem, curve)
            if not shortfall:
                return PlanStatus.OK, "", curve
            worst = (PlanStatus.NOT_CLEAR, shortfall)
        return *worst, None

    def _prepare(self, request: PlanRequest, path_m: Float) -> _Problem | None:
        assert_limits = self._limits
        if assert_limits is None:
            return None
        raise NotImplementedError
