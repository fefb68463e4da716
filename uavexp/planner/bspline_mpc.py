"""A B-spline among static obstacles, followed by model predictive control among moving ones (paper 3).

    A* path -> static spline (`shape.static_spline`, eqs. 1, 2), kept while it stays clear
            -> horizon that follows it and keeps out of predicted movers (`mpc.horizon`, eqs. 3a to 3f)
            -> quintic back to the spline and the rest of it to the goal (`mpc.rejoin`)

What the paper leaves open, decided here [ours]:
- The plan goes on to the goal behind the horizon. A plan that stopped at the horizon's end would be
  safe only as long as the next one comes in time, and no trigger but a clock would ask for one.
- The static spline is kept between requests while its goal is wanted, it is clear of what has been
  mapped since, and the vehicle is near it; so is the last motion, as the first linearisation.
- Where the regions cannot be kept the horizon gives way (slack, counted in `slackened`). When what is
  left would touch a predicted mover, the vehicle comes to rest where that stays farthest from all of
  them, by braking or by a side step, and goes on from there (counted in `braked`): a mover does not
  look out, so merely stopping may be no rescue.
- The horizon's jerk is limited to what turns the thrust vector at a share of the body rate limit. A
  reference that asks for all of it again and again is not followed: the quadrotor overshoots.
- A horizon that breaks a limit or comes too near a mapped obstacle is not flown: a new spline from the
  present state is tried once, and is the answer itself if it stays off the movers.

Left out: yaw; movers in the search for the path; movers behind the prediction's end.
All budgets are iterations; the answer depends on the trial's requests so far and nothing else.
"""

from __future__ import annotations

import time
from copy import deepcopy
from dataclasses import field, replace
from typing import Annotated

import numpy as np

from uavexp.errors import require
from uavexp.parameters import (
    Count,
    NarrowClearance,
    NarrowSpeed,
    NonNegative,
    Positive,
    PositiveShare,
    Unknown,
    between,
    option,
)
from uavexp.planner.constraints import Constraints
from uavexp.planner.find.base import Finder
from uavexp.planner.find.grid import Grid
from uavexp.planner.movers.escape import stops
from uavexp.planner.movers.moving import MovingObstacles
from uavexp.planner.mpc.follow import SLACK_M, Followed, Follower, least_room_m
from uavexp.planner.mpc.guide import Guide, StaticPlanner, still_holds
from uavexp.planner.mpc.horizon import horizon_model
from uavexp.planner.shape.static_spline import StaticSpline
from uavexp.planner.shape.stop_first import summed
from uavexp.types import Limits, PlanRequest, PlanResult, PlanStatus, Squeeze, Tracks


@option
class BsplineMpc:
    """Static B-spline planner and dynamic MPC planner of paper 3; see the module."""

    find: Finder = field(default_factory=Grid)
    order: Annotated[int, between(4, 8)] = 4  # k of the spline, degree k - 1; the first and last k - 1
    # control points are fixed (paper 3); 4 is the least with continuous acceleration
    stop_at_ends: bool = False  # true: repeated control points, a stop at every goal (paper 3); false:
    # continuous with the present motion [ours]
    control_weight: Positive = 1.0  # 1, alpha_control of the integral of squared acceleration; the paper
    # gives no number
    smooth_weight: NonNegative = 0.01  # s², alpha_smooth of the integral of squared jerk [ours]
    static_weight: NonNegative = 60.0  # m²/s⁴, alpha_static: what a surface's touch is worth as a squared
    # acceleration [ours]
    min_clearance_m: Positive = 0.26  # m, hard limit on the mapped distance of the body centre: its circle
    # of 0.226 m and a third of a voxel [ours]
    safe_clearance_m: Positive = 0.75  # m, obstacle cost and path penalty vanish beyond it [ours]
    end_speed_mps: NonNegative = 1.5  # m/s, speed at a goal that is not the target, if there is room to
    # stop behind it [ours]
    duration_margin: Annotated[float, between(1, 10)] = 1.1  # 1, factor on the time-optimal traversal of
    # the curve [ours]
    control_spacing_m: Positive = 0.6  # m, path length per control point [ours]
    first_iterations: Count = 3  # QPs of the spline before the curve is timed anew [ours]
    final_iterations: Count = 4  # QPs at most after that, and after each stretching of the duration [ours]
    z_band_m: NonNegative = 0.3  # m, the path may leave the heights between start and goal by this much
    # [ours]
    unknown: Unknown = Unknown.OPTIMISTIC  # optimistic: unknown space is free; conservative: it is not
    # entered
    horizon_steps: Annotated[int, between(2, 60)] = 20  # N of the horizon (paper 3 gives none): with
    # horizon_step_s as long as predictions count [ours]
    horizon_step_s: Positive = 0.1  # s, dt; at 2.5 m/s the vehicle and a walker come 0.4 m closer in it
    # [ours]
    velocity_weight: NonNegative = 0.3  # s², of the velocity in the deviation from the reference [ours]
    terminal_weight: Positive = 5.0  # 1, factor on the last step's deviation: the way back to the spline
    # stays short [ours]
    input_weight: Positive = 0.01  # s⁴, lambda_u; the paper gives none
    horizon_iterations: Annotated[int, between(1, 20)] = 2  # QPs of the horizon, each linearised around the
    # one before [ours]
    keep_within_m: NonNegative = 0.5  # m, farther from the static spline than this it is planned anew
    # [ours]
    mover_margin_m: NonNegative = 0.5  # m, beyond the body's circle, kept from predicted movers, which grow
    # by their uncertainty [ours]
    mover_horizon_s: NonNegative = 2.0  # s, predictions count for so long; stopping from 2.5 m/s takes 1.2
    # s; 0: movers do not count [ours]
    turn_share: PositiveShare = 0.5  # of the body rate limit, with which the horizon turns the thrust; the
    # rest is left to the controller and the yaw [ours]
    narrow_clearance_m: NarrowClearance = 0.22  # m, tried where min_clearance_m finds no way; 0: never [ours]
    narrow_speed_mps: NarrowSpeed = 1.0  # m/s, of such a plan, and at most of the vehicle then [ours]
    slackened: int = field(default=0, init=False)  # requests at which the horizon gave way
    braked: int = field(default=0, init=False)  # requests at which only coming to rest was left
    _follower: Follower | None = field(default=None, init=False, repr=False)
    _guide: Guide | None = field(default=None, init=False, repr=False)

    def __post_init__(self) -> None:
        require(
            self.safe_clearance_m > self.min_clearance_m,
            f"safe_clearance_m must be > min_clearance_m {self.min_clearance_m}, got {self.safe_clearance_m}",
        )

    def reset(self, limits: Limits, rng: np.random.Generator) -> None:
        """Begin a trial of a vehicle with these limits; every request draws from the same stream."""
        self._guide, self.slackened, self.braked = None, 0, 0
        constraints = Constraints(
            limits=limits,
            min_clearance_m=self.min_clearance_m,
            safe_clearance_m=self.safe_clearance_m,
            z_band_m=self.z_band_m,
            known_only=self.unknown is Unknown.CONSERVATIVE,
        )
        shaper = StaticSpline(
            order=self.order,
            stop_at_ends=self.stop_at_ends,
            control_weight=self.control_weight,
            smooth_weight=self.smooth_weight,
            static_weight=self.static_weight,
            end_speed_mps=self.end_speed_mps,
            duration_margin=self.duration_margin,
            control_spacing_m=self.control_spacing_m,
            first_iterations=self.first_iterations,
            final_iterations=self.final_iterations,
        )
        weights = (self.velocity_weight, self.terminal_weight, self.input_weight)
        self._follower = Follower(
            static=StaticPlanner(search=self.find, shaper=shaper, constraints=constraints, rng=deepcopy(rng)),
            model=horizon_model(self.horizon_steps, self.horizon_step_s, *weights),
            iterations=self.horizon_iterations,
            limits=replace(limits, max_body_rate_radps=self.turn_share * limits.max_body_rate_radps),
        )

    def plan(self, request: PlanRequest) -> PlanResult:
        """Return a trajectory or the reason why there is none (`Planner.plan`)."""
        follower = self._follower
        if follower is None:
            raise RuntimeError("plan() needs reset() first")
        result, squeeze = self._plan(request, follower), request.squeeze
        narrow = Squeeze(clearance_m=self.narrow_clearance_m, speed_mps=self.narrow_speed_mps)
        result = self._narrowed(result, request, follower, narrow, "a narrow place")
        return result if squeeze is None else self._narrowed(result, request, follower, squeeze, "a squeeze")

    def _narrowed(
        self, result: PlanResult, request: PlanRequest, follower: Follower, through: Squeeze, where: str
    ) -> PlanResult:
        """The result, unless a lesser clearance at a lesser speed finds a way that it lacks."""
        constraints = follower.static.constraints
        least = constraints.narrowed(result, request, through.clearance_m, through.speed_mps)
        if least is None:
            return result
        static = replace(follower.static, constraints=least)
        slow = replace(follower.limits, max_speed_mps=least.limits.max_speed_mps)
        return summed(result, self._plan(request, replace(follower, static=static, limits=slow)), where)

    def _plan(self, request: PlanRequest, follower: Follower) -> PlanResult:
        """`plan` by this follower."""
        state = (request.position_m, request.velocity_mps, request.acceleration_mps2)
        if not all(np.isfinite(part).all() for part in (*state, request.goal.position_m)):
            return PlanResult(status=PlanStatus.LIMITS, reason="start or goal is not finite")
        guide, self._guide = self._guide, None
        if guide is not None and still_holds(guide, request, follower.static, self.keep_within_m):
            began = time.perf_counter()
            kept = PlanResult(status=PlanStatus.NOT_CLEAR, path_m=guide.path_m)
            followed = follower.follow(request, guide, self._moving(request, self.mover_margin_m))
            kept = replace(kept, iterations=followed.iterations, wall_optimise_s=time.perf_counter() - began)
            if followed.trajectory is not None:
                return self._judged(request, guide, followed, kept)
        fresh = follower.static.plan(request)
        if fresh.trajectory is None:
            return fresh
        began = time.perf_counter()
        guide = Guide(request.goal, fresh.trajectory, fresh.path_m, None)
        followed = follower.follow(request, guide, self._moving(request, self.mover_margin_m))
        if followed.trajectory is None:  # the spline itself keeps limits and clearance
            followed = followed._replace(trajectory=fresh.trajectory)
        wall_s = fresh.wall_optimise_s + time.perf_counter() - began
        fresh = replace(fresh, iterations=fresh.iterations + followed.iterations, wall_optimise_s=wall_s)
        return self._judged(request, guide, followed, fresh)

    def _moving(self, request: PlanRequest, margin_m: float) -> MovingObstacles:
        """The believed movers with what is to be kept from them; none when they do not count at all."""
        if self._follower is None:
            raise RuntimeError("plan() needs reset() first")
        return MovingObstacles(
            tracks=request.tracks if self.mover_horizon_s > 0.0 else Tracks.none(request.time_s),
            field=request.field,
            body_radius_m=self._follower.static.constraints.limits.body_radius_m,
            margin_m=margin_m,
            horizon_s=self.mover_horizon_s,
        )

    def _judged(
        self, request: PlanRequest, guide: Guide, followed: Followed, result: PlanResult
    ) -> PlanResult:
        """The followed plan, unless it would touch a predicted mover and a stop would do so less."""
        if self._follower is None or followed.trajectory is None:
            raise RuntimeError("plan() needs reset() first")
        reason = result.reason
        if followed.slack_m > SLACK_M:
            self.slackened += 1
            reason = f"gives way by {followed.slack_m:.2f} m"
        touching = self._moving(request, 0.0)
        room_m = least_room_m(touching, followed.trajectory, request.time_s)
        plan = replace(result, status=PlanStatus.OK, trajectory=followed.trajectory, reason=reason)
        if room_m < 0.0:
            ways = stops(request, self._follower.static.constraints.limits)
            rooms_m = [least_room_m(touching, way, request.time_s) for way in ways]
            # braking itself unless a side step gets farther away; only what is better than to go on
            for index in sorted(range(len(ways)), key=lambda n: -min(rooms_m[n], 0.0)):
                if rooms_m[index] <= room_m:
                    break
                stopped = self._follower.static.after_stop(request, ways[index], plan)
                if stopped.trajectory is not plan.trajectory:
                    self.braked += 1
                    self._guide = guide._replace(flown=stopped.trajectory)
                    return stopped if index == 0 else replace(stopped, reason="steps aside first")
        self._guide = guide._replace(flown=followed.trajectory)
        return plan
