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
ladder makes obstacles dearer, the flight slower and the spline finer. When a moving start
defeats that, the vehicle is braked first and the rest planned from where it stands, with rungs
that also tie the curve to the path; brake and flight are one trajectory.

Movers are obstacles at their predicted places, each at its own instant (`moving`): in the search
where the vehicle would meet them, in the optimisation at the samples' instants, hard on the
result. Without a plan that keeps `mover_margin_m`, one that passes closer is taken; without
that either, the vehicle first stops or steps aside, whichever stays farthest from all of them,
and goes on from there: merely stopping is no rescue from what does not look out.

Left out: yaw; the cost per metre (c is per second, as in the paper).
All budgets are iterations; the answer depends on the request and nothing else.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from uavexp.arrays import Float
from uavexp.braking import braking_trajectory
from uavexp.errors import require, require_non_negative, require_positive
from uavexp.field import DistanceField
from uavexp.planner.clearance import shortfall
from uavexp.planner.constraints import Constraints
from uavexp.planner.find.base import FoundPath
from uavexp.planner.find.grid import Finder, PathSearch
from uavexp.planner.movers.escape import safest_stop
from uavexp.planner.movers.moving import MovingObstacles
from uavexp.planner.shape.scp import Scp, load
from uavexp.planner.shape.start import REST_MPS
from uavexp.planner.shape.stop_first import stop_first, summed
from uavexp.trajectory import Trajectory, evaluate, sample_times
from uavexp.types import Limits, PlanRequest, PlanResult, PlanStatus, Tracks

_MENDED_BY_BRAKING = (PlanStatus.NOT_CLEAR, PlanStatus.LIMITS, PlanStatus.SOLVER)
_BRAKE_CHECK_S = 0.02
_CLOSER = 0.4  # share of the margin that a plan among movers may fall back on


@dataclass(slots=True, kw_only=True)
class MinAcc:
    """Minimum-acceleration B-spline through the mapped space, on an A* path."""

    min_clearance_m: float = 0.26
    safe_clearance_m: float = 0.75
    obstacle_weight: float = 60.0
    end_speed_mps: float = 1.5
    duration_margin: float = 1.1
    control_spacing_m: float = 0.6
    first_iterations: int = 3
    final_iterations: int = 4
    tolerance: float = 0.01
    path_clearance_weight: float = 2.0
    z_band_m: float = 0.3
    unknown: str = "optimistic"
    max_expansions: int = 300_000
    mover_margin_m: float = 0.5
    mover_horizon_s: float = 2.0
    _constraints: Constraints | None = field(default=None, init=False, repr=False)
    _shaper: Scp = field(default=Scp(), init=False, repr=False)
    _search: PathSearch | None = field(default=None, init=False, repr=False)

    def __post_init__(self) -> None:
        require_positive(
            min_clearance_m=self.min_clearance_m,
            safe_clearance_m=self.safe_clearance_m,
            obstacle_weight=self.obstacle_weight,
            control_spacing_m=self.control_spacing_m,
            tolerance=self.tolerance,
        )
        require_non_negative(
            end_speed_mps=self.end_speed_mps,
            path_clearance_weight=self.path_clearance_weight,
            z_band_m=self.z_band_m,
            mover_margin_m=self.mover_margin_m,
            mover_horizon_s=self.mover_horizon_s,
        )
        require(
            self.safe_clearance_m > self.min_clearance_m,
            f"safe_clearance_m must be > min_clearance_m {self.min_clearance_m}, got {self.safe_clearance_m}",
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
        load()
        self._constraints = Constraints(
            limits=limits,
            min_clearance_m=self.min_clearance_m,
            safe_clearance_m=self.safe_clearance_m,
            z_band_m=self.z_band_m,
            known_only=self.unknown == "conservative",
        )
        self._shaper = Scp(
            obstacle_weight=self.obstacle_weight,
            end_speed_mps=self.end_speed_mps,
            duration_margin=self.duration_margin,
            control_spacing_m=self.control_spacing_m,
            first_iterations=self.first_iterations,
            final_iterations=self.final_iterations,
            tolerance=self.tolerance,
        )
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
        if self._search is None:
            raise RuntimeError("plan() needs reset() first")
        return self.plan_along(request, self._search)

    def plan_along(self, request: PlanRequest, search: Finder) -> PlanResult:
        """`plan` with a path search of another planner in place of its own."""
        limits = self._kept().limits
        movers = self._movers(request, self.mover_margin_m)
        result = self._attempt(request, movers, search)
        if result.trajectory is None and len(movers):
            return self._among_movers(request, movers, search, result)
        speed = float(np.linalg.norm(request.velocity_mps))
        if result.status in _MENDED_BY_BRAKING and speed > REST_MPS:
            state = (request.position_m, request.velocity_mps, request.acceleration_mps2)
            brake = braking_trajectory(request.time_s, *state, limits)
            return self._stop_first(request, brake, movers, search, result, "brakes first")
        return result

    def _kept(self) -> Constraints:
        if self._constraints is None:
            raise RuntimeError("plan() needs reset() first")
        return self._constraints

    def _movers(self, request: PlanRequest, margin_m: float) -> MovingObstacles:
        """The believed movers with what is to be kept from them; none when they do not count at all."""
        return MovingObstacles(
            tracks=request.tracks if self.mover_horizon_s > 0.0 else Tracks.none(request.time_s),
            field=request.field,
            body_radius_m=self._kept().limits.body_radius_m,
            margin_m=margin_m,
            horizon_s=self.mover_horizon_s,
        )

    def _among_movers(
        self, request: PlanRequest, movers: MovingObstacles, search: Finder, failed: PlanResult
    ) -> PlanResult:
        """Pass closer; else stop or step aside, and go on from there."""
        closer = self._movers(request, _CLOSER * self.mover_margin_m)
        result = summed(failed, self._attempt(request, closer, search), "passes movers closely")
        if result.trajectory is not None:
            return result
        stop, aside = safest_stop(request, movers, partial(self._shortfall, request), self._kept().limits)
        reason = "steps aside first" if aside else "brakes first"
        return self._stop_first(request, stop, closer, search, result, reason)

    def _attempt(self, request: PlanRequest, movers: MovingObstacles, search: Finder) -> PlanResult:
        """Search and optimise once."""
        began = time.perf_counter()
        goal_m = request.goal.position_m
        ends = (request.position_m, goal_m, request.flight_bounds_m)
        found = search.find(self._field_with_movers(request, movers), *ends)
        if found.status is not PlanStatus.OK and len(request.tracks):
            found = search.find(request.field, *ends)  # in time there may be a way: the check decides
        searched = time.perf_counter()
        if found.status is not PlanStatus.OK:
            return PlanResult(
                status=found.status,
                reason=found.reason,
                expansions=found.expansions,
                wall_search_s=searched - began,
            )
        way = FoundPath(status=found.status, path_m=found.path_m)
        shaped = self._shaper.shape(request, way, self._kept(), movers)
        return PlanResult(
            status=shaped.status,
            trajectory=shaped.trajectory,
            path_m=found.path_m,
            reason=shaped.reason or found.reason,
            iterations=shaped.iterations,
            expansions=found.expansions,
            wall_search_s=searched - began,
            wall_optimise_s=time.perf_counter() - searched,
        )

    def _stop_first(
        self,
        request: PlanRequest,
        stop: Trajectory,
        movers: MovingObstacles,
        search: Finder,
        failed: PlanResult,
        reason: str,
    ) -> PlanResult:
        """Stop, then fly from there; the failure of the direct attempt when that fails, too."""
        way = evaluate(stop, sample_times(stop, stop.start_s, _BRAKE_CHECK_S))[0]
        if self._shortfall(request, way):
            return failed

        def onward(standing: PlanRequest) -> PlanResult:
            return self._attempt(standing, self._movers(standing, movers.margin_m), search)

        return stop_first(request, stop, way[-1], onward, failed, reason)

    def _shortfall(self, request: PlanRequest, points_m: Float) -> str:
        """Say where a curve through points (P, 3) is not clear of the map (`clearance.shortfall`)."""
        kept = self._kept()
        strongest = kept.limits.max_acceleration_mps2
        return shortfall(request, points_m, kept.min_clearance_m, strongest, kept.known_only)

    def _field_with_movers(self, request: PlanRequest, movers: MovingObstacles) -> DistanceField:
        """The request's map, with the movers where the vehicle would meet them if there are any."""
        if not len(movers):
            return request.field
        limits = self._kept().limits
        return movers.stamped(
            request,
            speed_mps=limits.max_speed_mps / self.duration_margin,
            acceleration_mps2=limits.max_acceleration_mps2,
            least_m=self.min_clearance_m + 0.5 * request.field.voxel_size_m,
            safe_m=self.safe_clearance_m,
        )
