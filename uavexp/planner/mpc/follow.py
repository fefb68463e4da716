"""A plan along a guide: the horizon, the way back to the spline, and the rest of it, checked as a whole."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from uavexp.arrays import Float
from uavexp.braking import with_stop
from uavexp.planner.movers.moving import MovingObstacles
from uavexp.planner.mpc.guide import Guide, StaticPlanner, phase_of
from uavexp.planner.mpc.horizon import HorizonModel, Rollout, Surroundings, Tracked, to_trajectory, track
from uavexp.planner.mpc.rejoin import BLENDS_S, rejoined, state_at
from uavexp.planner.shape.excess import instants, limit_excess
from uavexp.planner.shape.start import state_of
from uavexp.trajectory import Trajectory, evaluate
from uavexp.types import Limits, PlanRequest

SLACK_M = 1e-3  # more than this is a region that was not kept out of
_ABOVE_M = 0.02  # clearance inside the horizon above the limit: room between its steps
_CHECK_S = 0.05  # spacing of the instants at which predicted movers are checked
_SAME_M = 1e-6  # a request this close to the last plan follows on from it


class Followed(NamedTuple):
    """Answer of `follow`."""

    trajectory: Trajectory | None  # None: no plan along this guide keeps limits and clearance
    slack_m: float  # largest depth in a region that the horizon had to accept
    iterations: int  # QPs solved


@dataclass(frozen=True, slots=True, kw_only=True)
class Follower:
    """The dynamic planner."""

    static: StaticPlanner
    model: HorizonModel
    iterations: int  # linearisations
    limits: Limits  # of the horizon

    def follow(self, request: PlanRequest, guide: Guide, moving: MovingObstacles) -> Followed:
        """Plan along a guide.

        Args:
            request: what was asked.
            guide: to be followed.
            moving: the movers, with what is to be kept from them.
        """
        start = state_of(request)
        phase_s = phase_of(guide.spline, start)[0]
        tracked = self._track(request, guide, start, phase_s, moving)
        if tracked.motion is None:
            return Followed(None, tracked.slack_m, tracked.iterations)
        touching = replace(moving, margin_m=0.0)
        strongest = self.static.constraints.limits.max_acceleration_mps2
        best, most_m = None, -np.inf
        for steps in self._lengths(guide.spline.end_s - phase_s):
            head, state, end_s, meet_s = None, start, request.time_s, phase_s
            if steps > 0:
                head = to_trajectory(self.model, start, tracked.motion, steps, request.time_s)
                state, end_s = state_at(head, head.end_s), head.end_s
                meet_s = phase_of(guide.spline, state, phase_s)[0]
            for way in rejoined(head, state, guide.spline, meet_s, end_s, strongest):
                if not self._is_sound(request, way):
                    continue
                room_m = least_room_m(touching, way, request.time_s)
                if room_m >= 0.0:
                    return Followed(way, tracked.slack_m, tracked.iterations)
                if room_m > most_m:
                    best, most_m = way, room_m
        return Followed(best, tracked.slack_m, tracked.iterations)

    def _track(
        self, request: PlanRequest, guide: Guide, start: Float, phase_s: float, moving: MovingObstacles
    ) -> Tracked:
        """Solve the horizon around the last motion, or the reference; where it gives way, around a stop too.

        A stop that keeps out of the regions satisfies all their half spaces, so none is given way to.
        """
        kept, model = self.static.constraints, self.model
        ahead_s = model.step_s * np.arange(1.0, model.steps + 1.0)
        wanted = Rollout(*evaluate(with_stop(guide.spline, kept.limits), phase_s + ahead_s))
        clearance_m, table = kept.min_clearance_m + _ABOVE_M, moving.table(request.time_s)
        around = Surroundings(request.field, clearance_m, table, request.flight_bounds_m)
        guess = _last_motion(guide, request, ahead_s) or wanted
        first = track(model, start, wanted, guess, around, self.limits, self.iterations)
        if first.slack_m <= SLACK_M or not len(moving):
            return first
        stop = Rollout(*evaluate(self.static.brake(request), request.time_s + ahead_s))
        second = track(model, start, wanted, stop, around, self.limits, self.iterations)
        better = second if second.slack_m < first.slack_m else first
        return better._replace(iterations=first.iterations + second.iterations)

    def _lengths(self, left_s: float) -> list[int]:
        """How many steps of the horizon precede the way back: fewer near the end, or where many fail."""
        most = int(np.clip((left_s - BLENDS_S[0]) // self.model.step_s, 0, self.model.steps))
        return sorted({most, most // 2, most // 4}, reverse=True)

    def _is_sound(self, request: PlanRequest, trajectory: Trajectory) -> bool:
        """Whether a trajectory keeps the limits and the clearance."""
        if not np.isfinite(trajectory.coefficients).all():
            return False
        if limit_excess(trajectory, self.static.constraints.limits, self.model.step_s) > 1.0:
            return False
        return not self.static.constraints.shortfall(request, evaluate(trajectory, instants(trajectory))[0])


def _last_motion(guide: Guide, request: PlanRequest, ahead_s: Float) -> Rollout | None:
    """The last plan at these times ahead, when the request follows on from it: the warm start."""
    if guide.flown is None or not guide.flown.start_s <= request.time_s <= guide.flown.end_s:
        return None
    if np.abs(state_at(guide.flown, request.time_s)[0] - request.position_m).max() > _SAME_M:
        return None
    return Rollout(*evaluate(guide.flown, request.time_s + ahead_s))


def least_room_m(moving: MovingObstacles, trajectory: Trajectory, from_s: float) -> float:
    """Least clearance from the predicted movers along a trajectory, m; inf without any."""
    if not len(moving) or moving.horizon_s <= 0.0:
        return np.inf
    times = from_s + np.arange(0.0, moving.horizon_s, _CHECK_S)
    return float(moving.clearance_m(evaluate(trajectory, times)[0], times).min())
