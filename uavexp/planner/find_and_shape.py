"""A planner of two halves: a search for a path (`find`), and its shaping into a trajectory (`shape`).

Movers are obstacles at their predicted places, each at its own instant. The search, which knows no time,
sees them in its map where the vehicle would meet them (`moving.stamped`); the trajectory is judged at the
true instants, by the shaper itself where it sees movers. What does not pass is tried again on the rungs
of a ladder (`movers.rungs`). When all of them fail, the vehicle first stops or steps aside, whichever
stays farthest from all movers, and goes on from there: merely stopping is no rescue from what does not
look out. Without movers it brakes first when its speed defeats the shaper. Stop and flight are one
trajectory.

The answer depends on the request, and on what the planner was reset with, alone.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import partial
from typing import Any

import numpy as np

from uavexp.braking import REST_MPS, braking_trajectory
from uavexp.errors import require
from uavexp.parameters import NarrowClearance, NarrowSpeed, NonNegative, Positive, Unknown
from uavexp.planner.constraints import Constraints
from uavexp.planner.find.base import Finder, FoundPath
from uavexp.planner.movers.escape import safest_stop
from uavexp.planner.movers.moving import MovingObstacles
from uavexp.planner.movers.rungs import ALONE, Rung, met, rungs
from uavexp.planner.shape.base import ShapedPath, Shaper
from uavexp.planner.shape.stop_first import stop_first, summed
from uavexp.trajectory import evaluate, sample_times
from uavexp.types import Limits, PlanRequest, PlanResult, PlanStatus, Tracks

_MENDED_BY_BRAKING = (PlanStatus.NOT_CLEAR, PlanStatus.LIMITS, PlanStatus.SOLVER)
_CHECK_S = 0.02


class MoversSeen(StrEnum):
    """Where movers are obstacles."""

    PREDICTED = "predicted"  # where they will be met
    CURRENT = "current"  # where they are now, paper 2's traditional method


@dataclass(slots=True, kw_only=True)
class FindAndShape:
    """Any finder with any shaper; the options of the group are pairs of them."""

    find: Finder
    shape: Shaper
    min_clearance_m: Positive = 0.26  # m, hard limit on the mapped distance of the body centre: its circle
    # of 0.226 m and a third of a voxel [ours]
    safe_clearance_m: Positive = 0.75  # m, obstacle cost and path penalty vanish beyond it [ours]
    z_band_m: NonNegative = 0.3  # m, the path may leave the heights between start and goal by this much
    # [ours]
    unknown: Unknown = Unknown.OPTIMISTIC  # optimistic: unknown space is free; conservative: it is not
    # entered
    movers: MoversSeen = MoversSeen.PREDICTED  # predicted: obstacles where they will be met; current:
    # where they are now, paper 2's traditional method [ours]
    mover_margin_m: NonNegative = 0.5  # m, beyond the body's circle, kept from movers: delta of paper 2;
    # trigger.margin_m of risk is the same [ours]
    mover_horizon_s: NonNegative = 2.0  # s, predictions count for so long; stopping from 2.5 m/s takes as
    # long; 0: movers do not count [ours]
    narrow_clearance_m: NarrowClearance = 0.22  # m, tried where min_clearance_m finds no way; 0: never [ours]
    narrow_speed_mps: NarrowSpeed = 1.0  # m/s, of such a plan, and at most of the vehicle then [ours]
    _constraints: Constraints | None = field(default=None, init=False, repr=False)
    _rng: np.random.Generator = field(init=False, repr=False)
    _drawn_from: Mapping[str, Any] = field(init=False, repr=False)  # state of `_rng` at every request

    def __post_init__(self) -> None:
        require(
            self.safe_clearance_m > self.min_clearance_m,
            f"safe_clearance_m must be > min_clearance_m {self.min_clearance_m}, got {self.safe_clearance_m}",
        )

    def reset(self, limits: Limits, rng: np.random.Generator) -> None:
        """Begin a trial of a vehicle with these limits; every request draws from the same new stream."""
        self._rng, self._drawn_from = rng, rng.bit_generator.state
        self._constraints = Constraints(
            limits=limits,
            min_clearance_m=self.min_clearance_m,
            safe_clearance_m=self.safe_clearance_m,
            z_band_m=self.z_band_m,
            known_only=self.unknown is Unknown.CONSERVATIVE,
        )

    def plan(self, request: PlanRequest) -> PlanResult:
        """Return a trajectory or the reason why there is none (`Planner.plan`)."""
        if self._constraints is None:
            raise RuntimeError("plan() needs reset() first")
        result = self._plan(request, self._constraints)
        narrow = self._constraints.narrowed(result, request, self.narrow_clearance_m, self.narrow_speed_mps)
        if narrow is not None:
            result = summed(result, self._plan(request, narrow), "a narrow place")
        squeeze = request.squeeze
        if squeeze is None:
            return result
        least = self._constraints.narrowed(result, request, squeeze.clearance_m, squeeze.speed_mps)
        return result if least is None else summed(result, self._plan(request, least), "a squeeze")

    def _plan(self, request: PlanRequest, constraints: Constraints) -> PlanResult:
        """`plan` within these constraints."""
        limits, movers = constraints.limits, self._moving(request, constraints.limits)
        refused = _refusal(request, limits)
        if refused is not None:
            return refused
        ladder = rungs(self.shape.sees_movers) if len(movers) else ALONE
        result = self._climb(request, constraints, movers, ladder)
        if result.trajectory is not None:
            return result
        if len(movers):
            blocked = partial(constraints.shortfall, request)
            stop, aside = safest_stop(request, movers, blocked, limits)
            reason = "steps aside first" if aside else "brakes first"
        elif result.status in _MENDED_BY_BRAKING and float(np.linalg.norm(request.velocity_mps)) > REST_MPS:
            state = (request.position_m, request.velocity_mps, request.acceleration_mps2)
            stop, reason = braking_trajectory(request.time_s, *state, limits), "brakes first"
        else:
            return result
        way_m = evaluate(stop, sample_times(stop, stop.start_s, _CHECK_S))[0]
        if constraints.shortfall(request, way_m):
            return result
        left = [rung for rung in ladder if rung.margin == ladder[-1].margin]
        onward = partial(self._climb, constraints=constraints, movers=movers, ladder=left)
        return stop_first(request, stop, way_m[-1], onward, result, reason)

    def _moving(self, request: PlanRequest, limits: Limits) -> MovingObstacles:
        """The believed movers with what is kept from them; none when they do not count at all."""
        tracks = request.tracks if self.mover_horizon_s > 0.0 else Tracks.none(request.time_s)
        if self.movers is MoversSeen.CURRENT:
            still_mps = np.zeros_like(tracks.velocity_mps)
            tracks = replace(tracks, velocity_mps=still_mps, swerve_m=Tracks.none().swerve_m)
        return MovingObstacles(
            tracks=tracks,
            field=request.field,
            body_radius_m=limits.body_radius_m,
            margin_m=self.mover_margin_m,
            horizon_s=self.mover_horizon_s,
        )

    def _climb(
        self, request: PlanRequest, constraints: Constraints, movers: MovingObstacles, ladder: Sequence[Rung]
    ) -> PlanResult:
        """The first rung's plan that keeps everything, or the first one's failure."""
        failed = self._attempt(request, constraints, movers, ladder[0])
        for rung in ladder[1:]:
            if failed.trajectory is not None:
                break
            result = self._attempt(request, constraints, movers, rung)
            failed = summed(failed, result, rung.reason or result.reason)
        return failed

    def _attempt(
        self, request: PlanRequest, constraints: Constraints, movers: MovingObstacles, rung: Rung
    ) -> PlanResult:
        """Search and shape once."""
        if rung.margin != 1.0:
            movers = replace(movers, margin_m=rung.margin * movers.margin_m)
        sees, began_s = self.shape.sees_movers, time.perf_counter()
        asked = request if rung.pace is None else met(request, constraints, movers, rung.pace, not sees)
        found = self._found(asked, constraints)
        if found.status is not PlanStatus.OK and sees and asked is not request:
            found = self._found(request, constraints)
        searched_s = time.perf_counter()
        shaped = self._shaped(request if sees else asked, found, constraints, movers)
        return PlanResult(
            status=shaped.status,
            trajectory=shaped.trajectory,
            path_m=found.path_m,
            reason=shaped.reason or found.reason,
            iterations=shaped.iterations,
            expansions=found.expansions,
            collision_checks=found.checks,
            history=found.history,
            tree_m=found.tree_m,
            wall_search_s=searched_s - began_s if found.wall_s is None else found.wall_s,
            wall_optimise_s=time.perf_counter() - searched_s,
        )

    def _found(self, request: PlanRequest, constraints: Constraints) -> FoundPath:
        self._rng.bit_generator.state = self._drawn_from
        return self.find.find(request, constraints, self._rng)

    def _shaped(
        self, request: PlanRequest, found: FoundPath, constraints: Constraints, movers: MovingObstacles
    ) -> ShapedPath:
        """The shaper's answer, unless there is nothing to shape, or it comes too near to a mover."""
        if found.status is not PlanStatus.OK:
            return ShapedPath(status=found.status, reason=found.reason)
        shaped = self.shape.shape(request, found, constraints, movers)
        if shaped.trajectory is None or self.shape.sees_movers or not len(movers):
            return shaped
        times_s = request.time_s + np.arange(0.0, movers.horizon_s, _CHECK_S)
        points_m = evaluate(shaped.trajectory, times_s)[0]
        reason = movers.shortfall(points_m, times_s, constraints.limits.max_acceleration_mps2)
        if not reason:
            return shaped
        return replace(shaped, status=PlanStatus.NOT_CLEAR, trajectory=None, reason=reason)


def _refusal(request: PlanRequest, limits: Limits) -> PlanResult | None:
    """Why no trajectory can begin or end as asked, or be flown at all; None when one may."""
    state = (request.position_m, request.velocity_mps, request.acceleration_mps2, request.goal.position_m)
    if not all(np.isfinite(part).all() for part in state):
        return PlanResult(status=PlanStatus.SOLVER, reason="start or goal is not finite")
    top, most = limits.max_speed_mps, limits.max_acceleration_mps2
    if not (top > 0.0 and most > 0.0):
        return PlanResult(status=PlanStatus.LIMITS, reason=f"limits of {top:g} m/s and {most:g} m/s²")
    return None
