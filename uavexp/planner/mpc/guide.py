"""The static spline as a guide: planned from a request, kept between requests while it holds."""

from __future__ import annotations

import time
from copy import deepcopy
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from uavexp.arrays import Float
from uavexp.braking import REST_MPS, braking_trajectory
from uavexp.planner.constraints import Constraints
from uavexp.planner.find.base import Finder
from uavexp.planner.movers.moving import MovingObstacles
from uavexp.planner.shape.excess import instants
from uavexp.planner.shape.start import refusal, state_of
from uavexp.planner.shape.static_spline import StaticSpline
from uavexp.planner.shape.stop_first import stop_first
from uavexp.trajectory import Trajectory, evaluate
from uavexp.types import Goal, PlanRequest, PlanResult, PlanStatus, Tracks

_NO_MOVERS = MovingObstacles(tracks=Tracks.none(), body_radius_m=0.0, margin_m=0.0, horizon_s=0.0)
_MENDED_BY_BRAKING = (PlanStatus.NOT_CLEAR, PlanStatus.LIMITS, PlanStatus.SOLVER)
_PHASE_S = 0.02  # spacing at which the nearest point of the spline is looked for
_PHASE_WEIGHT_S2 = 0.01  # of the velocity there: it tells the two ways through a crossing apart


class Guide(NamedTuple):
    """What is kept between the requests of a trial."""

    goal: Goal
    spline: Trajectory
    path_m: Float  # (P, 3)
    flown: Trajectory | None  # the last plan made along it


@dataclass(frozen=True, slots=True, kw_only=True)
class StaticPlanner:
    """A* path, then the spline; from a moving start that defeats it, brakes first."""

    search: Finder
    shaper: StaticSpline
    constraints: Constraints
    rng: np.random.Generator

    def plan(self, request: PlanRequest) -> PlanResult:
        """Return a trajectory among static obstacles or the reason why there is none."""
        moving = float(np.linalg.norm(request.velocity_mps)) > REST_MPS
        if self.shaper.stop_at_ends and (moving or np.any(request.acceleration_mps2)):
            failed = PlanResult(status=PlanStatus.NOT_CLEAR, reason="cannot stop here")
            return self.after_stop(request, self.brake(request), failed)
        result = self._attempt(request)
        if result.status in _MENDED_BY_BRAKING and moving:
            return self.after_stop(request, self.brake(request), result)
        return result

    def after_stop(self, request: PlanRequest, stop: Trajectory, failed: PlanResult) -> PlanResult:
        """Come to rest that way, and fly from there; `failed` when that fails, too."""
        way = evaluate(stop, instants(stop))[0]
        if self.constraints.shortfall(request, way):
            return failed
        return stop_first(request, stop, way[-1], self._attempt, failed, "brakes first")

    def _attempt(self, request: PlanRequest) -> PlanResult:
        """Search and shape once."""
        began = time.perf_counter()
        reason = refusal(state_of(request), self.constraints.limits)
        if reason:
            return PlanResult(status=PlanStatus.LIMITS, reason=reason)
        found = self.search.find(request, self.constraints, deepcopy(self.rng))
        searched = time.perf_counter()
        if found.status is not PlanStatus.OK:
            return PlanResult(
                status=found.status,
                reason=found.reason,
                expansions=found.expansions,
                wall_search_s=searched - began,
            )
        shaped = self.shaper.shape(request, found, self.constraints, _NO_MOVERS)
        return PlanResult(
            status=shaped.status,
            trajectory=shaped.trajectory,
            path_m=found.path_m,
            reason=shaped.reason,
            iterations=shaped.iterations,
            expansions=found.expansions,
            wall_search_s=searched - began,
            wall_optimise_s=time.perf_counter() - searched,
        )

    def brake(self, request: PlanRequest) -> Trajectory:
        """The way to rest in a straight line."""
        state = (request.position_m, request.velocity_mps, request.acceleration_mps2)
        return braking_trajectory(request.time_s, *state, self.constraints.limits)


def phase_of(spline: Trajectory, state: Float, from_s: float = -np.inf) -> tuple[float, float]:
    """Time on the spline of the point nearest to a state (3, 3), and how far that is, m.

    Args:
        spline: to be looked along.
        state: position, velocity and acceleration.
        from_s: no earlier time is looked at.
    """
    begin = min(max(spline.start_s, from_s), spline.end_s)
    times = np.append(np.arange(begin, spline.end_s, _PHASE_S), spline.end_s)
    place, velocity, _ = evaluate(spline, times)
    apart2 = ((place - state[0]) ** 2).sum(axis=1)
    best = int(np.argmin(apart2 + _PHASE_WEIGHT_S2 * ((velocity - state[1]) ** 2).sum(axis=1)))
    return float(times[best]), float(np.sqrt(apart2[best]))


def still_holds(guide: Guide, request: PlanRequest, planner: StaticPlanner, within_m: float) -> bool:
    """Whether a guide leads to the request's goal, is near its start, and clear on its map."""
    wanted = request.goal
    if wanted.is_target != guide.goal.is_target or np.any(wanted.position_m != guide.goal.position_m):
        return False
    phase_s, apart_m = phase_of(guide.spline, state_of(request))
    if apart_m > within_m:
        return False
    times = instants(guide.spline)
    left = evaluate(guide.spline, np.append(phase_s, times[times > phase_s]))[0]
    return not planner.constraints.shortfall(request, left)
