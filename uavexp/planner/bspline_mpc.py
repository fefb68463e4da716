"""A B-spline among static obstacles, followed by model predictive control among moving ones (paper 3).

    A* path -> static spline (`mpc.static_spline`, eqs. 1 and 2), kept while it stays clear
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
from dataclasses import dataclass, field, replace

import numpy as np

from uavexp.errors import require, require_non_negative, require_positive
from uavexp.planner.constraints import Constraints
from uavexp.planner.find.grid import PathSearch
from uavexp.planner.movers.escape import stops
from uavexp.planner.movers.moving import MovingObstacles
from uavexp.planner.mpc.follow import SLACK_M, Followed, Follower, least_room_m
from uavexp.planner.mpc.guide import Guide, StaticPlanner, still_holds
from uavexp.planner.mpc.horizon import horizon_model
from uavexp.planner.shape.static_spline import StaticSpline
from uavexp.types import Limits, PlanRequest, PlanResult, PlanStatus, Tracks


@dataclass(slots=True, kw_only=True)
class BsplineMpc:
    """Static B-spline planner and dynamic MPC planner of paper 3; see the module."""

    order: int = 4
    stop_at_ends: bool = False
    control_weight: float = 1.0
    smooth_weight: float = 0.01
    static_weight: float = 60.0
    min_clearance_m: float = 0.26
    safe_clearance_m: float = 0.75
    end_speed_mps: float = 1.5
    duration_margin: float = 1.1
    control_spacing_m: float = 0.6
    first_iterations: int = 3
    final_iterations: int = 4
    path_clearance_weight: float = 2.0
    z_band_m: float = 0.3
    unknown: str = "optimistic"
    max_expansions: int = 300_000
    horizon_steps: int = 20
    horizon_step_s: float = 0.1
    velocity_weight: float = 0.3
    terminal_weight: float = 5.0
    input_weight: float = 0.01
    horizon_iterations: int = 2
    keep_within_m: float = 0.5
    mover_margin_m: float = 0.5
    mover_horizon_s: float = 2.0
    turn_share: float = 0.5
    slackened: int = field(default=0, init=False)  # requests at which the horizon gave way
    braked: int = field(default=0, init=False)  # requests at which only coming to rest was left
    _follower: Follower | None = field(default=None, init=False, repr=False)
    _guide: Guide | None = field(default=None, init=False, repr=False)

    def __post_init__(self) -> None:
        require_positive(
            control_weight=self.control_weight,
            min_clearance_m=self.min_clearance_m,
            safe_clearance_m=self.safe_clearance_m,
            control_spacing_m=self.control_spacing_m,
            horizon_step_s=self.horizon_step_s,
            terminal_weight=self.terminal_weight,
            input_weight=self.input_weight,
        )
        require_non_negative(
            smooth_weight=self.smooth_weight,
            static_weight=self.static_weight,
            end_speed_mps=self.end_speed_mps,
            path_clearance_weight=self.path_clearance_weight,
            z_band_m=self.z_band_m,
            velocity_weight=self.velocity_weight,
            keep_within_m=self.keep_within_m,
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
        require(0.0 < self.turn_share <= 1.0, f"turn_share must be in (0, 1], got {self.turn_share}")
        whole = {"order": (4, 8), "horizon_steps": (2, 60), "horizon_iterations": (1, 20)}
        whole |= dict.fromkeys(("first_iterations", "final_iterations", "max_expansions"), (1, 10**9))
        for name, (least, most) in whole.items():
            value = getattr(self, name)
            require(
                isinstance(value, int) and not isinstance(value, bool) and least <= value <= most,
                f"{name} must be a whole number in [{least}, {most}], got {value!r}",
            )
        require(
            self.unknown in ("optimistic", "conservative"),
            f"unknown must be optimistic or conservative, got {self.unknown!r}",
        )

    def reset(self, limits: Limits, rng: np.random.Generator) -> None:
        """Begin a trial of a vehicle with these limits; draws nothing."""
        del rng
        self._guide, self.slackened, self.braked = None, 0, 0
        known_only = self.unknown == "conservative"
        constraints = Constraints(
            limits=limits,
            min_clearance_m=self.min_clearance_m,
            safe_clearance_m=self.safe_clearance_m,
            z_band_m=self.z_band_m,
            known_only=known_only,
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
        search = PathSearch(
            min_clearance_m=self.min_clearance_m,
            safe_clearance_m=self.safe_clearance_m,
            clearance_weight=self.path_clearance_weight,
            z_band_m=self.z_band_m,
            known_only=known_only,
            max_expansions=self.max_expansions,
        )
        weights = (self.velocity_weight, self.terminal_weight, self.input_weight)
        self._follower = Follower(
            static=StaticPlanner(search=search, shaper=shaper, constraints=constraints),
            model=horizon_model(self.horizon_steps, self.horizon_step_s, *weights),
            iterations=self.horizon_iterations,
            limits=replace(limits, max_body_rate_radps=self.turn_share * limits.max_body_rate_radps),
        )

    def plan(self, request: PlanRequest) -> PlanResult:
        """Return a trajectory or the reason why there is none (`Planner.plan`)."""
        follower = self._follower
        if follower is None:
            raise RuntimeError("plan() needs reset() first")
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
