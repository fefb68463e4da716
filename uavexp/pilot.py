"""The pilot: owns the flown trajectory, turns decisions into plans, holds and brakes.

A request made at t is planned from the predicted reference at t + latency on the map at t
and takes effect at t + latency; until then the vehicle follows the old trajectory. One
request is in flight at a time, further triggers meanwhile are dropped and counted. When
no plan is found: the goal is set aside, the next goals are tried, then the vehicle brakes
within its stopping distance, holds, and tries again at the explorer's rate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from uavexp.arrays import Float, Int32
from uavexp.braking import braking_trajectory, with_stop
from uavexp.explorer.base import Explorer
from uavexp.geometry import wrap_angle
from uavexp.planner.base import Planner
from uavexp.recorder import Stopwatch
from uavexp.safety.base import Safety
from uavexp.trajectory import Trajectory, derivative, evaluate, hover_before, sample_times
from uavexp.trigger.base import TriggerPolicy
from uavexp.trigger.change import changed_near
from uavexp.types import Goal, Limits, Observation, PlanRequest, PlanResult, PlanStatus, Reference, Replan

_GOALS_FAULT = (PlanStatus.GOAL_BLOCKED, PlanStatus.NO_PATH, PlanStatus.NOT_CLEAR)  # another may do
_NEAR_M, _CHANGED_M = 2.0, 0.15  # r_mon and delta_map of paper 1
_AHEAD_M = 0.1  # a shorter way ahead has no direction
_REST_MPS = 0.05  # slower is standing
_SAMPLE_S = 0.1  # spacing of the samples kept of a trajectory


@dataclass(frozen=True, slots=True)
class _Pending:
    """A plan waiting for its latency to pass."""

    trajectory: Trajectory
    goal: Goal
    moves_s: float  # before, it only turns


@dataclass(slots=True, kw_only=True)
class Pilot:
    """What is flown, and every planning request made on the way."""

    explorer: Explorer
    trigger: TriggerPolicy
    planner: Planner
    safety: Safety
    limits: Limits
    watch: Stopwatch
    latency_s: float
    settle_s: float  # no plan before the map has seen as much
    restart_error_m: float
    goals_per_request: int  # so many goals are tried before the vehicle brakes
    look_around_radps: float  # turning while there is no plan
    turn_first_rad: float  # from standstill, the vehicle turns before it flies where it does not look
    yaw_lookahead_s: float
    yaw_rate_radps: float  # kept below the body-rate limit: roll and pitch need their share
    flight_bounds_m: Float  # (2, 3)
    hover_m: Float  # (3,) held until the first plan takes effect
    yaw_rad: float
    trajectory: Trajectory | None = None
    goal: Goal | None = None
    best_goal: Goal | None = None
    replans: list[Replan] = field(default_factory=list)
    dropped_triggers: int = 0
    first_plan: PlanResult | None = None  # the first that was found
    failure: str = ""  # reason of the last failed request, "" after a success
    _pending: _Pending | None = None
    _moves_s: float = -math.inf  # until then the flown trajectory only turns
    _wait_for_rest: bool = False  # after the safety's brake: no new plan before standstill

    @property
    def ever_planned(self) -> bool:
        """Whether any plan was found."""
        return any(replan.status is PlanStatus.OK for replan in self.replans)

    def reference(self, time_s: float, step_s: float) -> Reference:
        """What to follow now; adopts a plan whose time has come and turns the yaw."""
        if self._pending is not None and time_s >= self._pending.trajectory.start_s - 1e-9:
            self.trajectory, self.goal = self._pending.trajectory, self._pending.goal
            self._moves_s, self._pending = self._pending.moves_s, None
        if self.failure and not self._moving(time_s):
            return self._look_around(step_s)
        if self.trajectory is None:
            return self._hold(self.hover_m)
        ahead_s = max(time_s, self._moves_s) + self.yaw_lookahead_s
        ahead_s = min(ahead_s, max(time_s, self.trajectory.end_s))
        position, velocity, acceleration = evaluate(self.trajectory, np.array([time_s, ahead_s]))
        rate_radps = self._turn(self._bearing_rad(position[1] - position[0]), step_s)
        return Reference(
            position_m=position[0],
            velocity_mps=velocity[0],
            acceleration_mps2=acceleration[0],
            yaw_rad=self.yaw_rad,
            yaw_rate_radps=rate_radps,
            jerk_mps3=derivative(self.trajectory, np.array([time_s]), 3)[0],
        )

    def _hold(self, position_m: Float, yaw_rate_radps: float = 0.0) -> Reference:
        zero = np.zeros(3)
        return Reference(
            position_m=position_m,
            velocity_mps=zero,
            acceleration_mps2=zero,
            yaw_rad=self.yaw_rad,
            yaw_rate_radps=yaw_rate_radps,
        )

    def _look_around(self, step_s: float) -> Reference:
        """Hold and turn: without a plan, only new sights can help."""
        self.yaw_rad = wrap_angle(self.yaw_rad + self.look_around_radps * step_s)
        return self._hold(self._planned_state(math.inf)[0], self.look_around_radps)

    def _bearing_rad(self, ahead_m: Float) -> float:
        """Where to look: as the goal asks, else along the path ahead; NaN: as before."""
        if self.best_goal is not None and math.isfinite(self.best_goal.yaw_rad):
            return self.best_goal.yaw_rad
        if math.hypot(ahead_m[0], ahead_m[1]) < _AHEAD_M:
            return math.nan
        return math.atan2(ahead_m[1], ahead_m[0])

    def _turn(self, bearing_rad: float, step_s: float) -> float:
        """Turn the yaw towards a bearing; return the rate, rad/s."""
        if math.isnan(bearing_rad):
            return 0.0
        error_rad = float(wrap_angle(bearing_rad - self.yaw_rad))
        rate_radps = min(max(4.0 * error_rad, -self.yaw_rate_radps), self.yaw_rate_radps)
        self.yaw_rad = wrap_angle(self.yaw_rad + rate_radps * step_s)
        return rate_radps

    def explore(self, observation: Observation) -> None:
        """Update g*; while without a valid plan, try again."""
        self._select(observation, fresh=False)
        if observation.time_s < self.settle_s - 1e-9:
            return
        if self.trajectory is None and not self.replans:
            self.request("first", observation)
        elif self.failure and not (self._wait_for_rest and self._moving(observation.time_s)):
            self.request("brake" if self._wait_for_rest else "retry", observation)

    def decide(self, observation: Observation) -> float:
        """Ask safety and trigger; return the trigger's score."""
        if not self.failure and self.safety.must_brake(observation):
            self._brake(observation.time_s, "braked before an obstacle or unknown space")
            self._wait_for_rest = True
        with self.watch.lap("trigger"):
            decision = self.trigger.decide(observation)
        # After a failure the pilot tries again by itself, equally often under every policy.
        if decision.replan and self.trajectory is not None and not self.failure:
            self.request(decision.cause, observation, decision.score, decision.voxel)
        return decision.score

    def request(
        self, cause: str, observation: Observation, score: float = 0.0, fired: Int32 | None = None
    ) -> None:
        """Plan to the best goal, else to the next best; brake when there is no plan."""
        if self._pending is not None:
            self.dropped_triggers += 1
            return
        goal = self._select(observation, fresh=True)
        for _ in range(self.goals_per_request):
            if goal is None:
                break
            result = self._plan(observation, goal)
            self._note(cause, score, observation, goal, result, fired)
            if result.trajectory is not None:
                self.first_plan = self.first_plan or result
                self._accept(result.trajectory, goal, observation)
                return
            self.failure = f"{result.status.value}: {result.reason}"
            if result.status not in _GOALS_FAULT:
                break
            self.explorer.reject(goal.position_m, observation.time_s)
            goal = self._select(observation, fresh=True)
        if goal is None:
            self.failure = self.failure or "no goal is reachable"
        self._brake(observation.time_s, self.failure)

    def _select(self, observation: Observation, *, fresh: bool) -> Goal | None:
        with self.watch.lap("explore"):
            self.best_goal = self.explorer.select(observation, fresh=fresh)
        return self.best_goal

    def _plan(self, observation: Observation, goal: Goal) -> PlanResult:
        result = self.planner.plan(self._plan_request(observation, goal))
        self.watch.add("search", result.wall_search_s)
        self.watch.add("optimise", result.wall_optimise_s)
        return result

    def _plan_request(self, observation: Observation, goal: Goal) -> PlanRequest:
        """From the reference at t + latency; from the measured state if that is far off or in an obstacle."""
        start_s = observation.time_s + self.latency_s
        state = observation.state
        position_m, velocity_mps, acceleration_mps2 = self._planned_state(start_s)
        error_m = float(np.linalg.norm(observation.reference.position_m - state.position_m))
        if error_m >= self.restart_error_m or observation.field.distance_m(position_m[None])[0] <= 0.0:
            position_m = state.position_m + self.latency_s * state.velocity_mps
            velocity_mps, acceleration_mps2 = state.velocity_mps, np.zeros(3)
        return PlanRequest(
            time_s=start_s,
            position_m=position_m,
            velocity_mps=velocity_mps,
            acceleration_mps2=acceleration_mps2,
            goal=goal,
            field=observation.field,
            flight_bounds_m=self.flight_bounds_m,
            tracks=observation.tracks,
        )

    def _planned_state(self, time_s: float) -> tuple[Float, Float, Float]:
        if self.trajectory is None:
            return self.hover_m, np.zeros(3), np.zeros(3)
        position, velocity, acceleration = evaluate(self.trajectory, np.array([time_s]))
        return position[0], velocity[0], acceleration[0]

    def _accept(self, trajectory: Trajectory, goal: Goal, observation: Observation) -> None:
        turn_s = self._turn_s(trajectory)
        flown = with_stop(hover_before(trajectory, turn_s), self.limits)
        self._pending = _Pending(flown, goal, trajectory.start_s + turn_s)
        self.failure, self._wait_for_rest = "", False
        self.trigger.planned(flown, observation.field)

    def _turn_s(self, trajectory: Trajectory) -> float:
        """Time to turn until the camera sees where a flight from standstill goes, s.

        Sensing is what keeps the flight off unseen obstacles, under every policy alike.
        """
        times_s = trajectory.start_s + np.array([0.0, self.yaw_lookahead_s])
        position, velocity, _ = evaluate(trajectory, times_s)
        bearing_rad = self._bearing_rad(position[1] - position[0])
        if float(np.linalg.norm(velocity[0])) > _REST_MPS or math.isnan(bearing_rad):
            return 0.0
        error_rad = abs(float(wrap_angle(bearing_rad - self.yaw_rad)))
        return max(0.0, error_rad - self.turn_first_rad) / self.yaw_rate_radps

    def _note(
        self,
        cause: str,
        score: float,
        observation: Observation,
        goal: Goal,
        result: PlanResult,
        fired: Int32 | None,
    ) -> None:
        voxel = np.zeros(0, dtype=np.int32) if fired is None else fired
        new_m = np.zeros((0, 3))
        change_m, effective_s = math.nan, math.nan
        if result.trajectory is not None:
            effective_s = result.trajectory.start_s
            new_m = _samples(result.trajectory, effective_s)
            if self.trajectory is not None:
                change_m = _path_change_m(_samples(self.trajectory, effective_s), new_m)
        self.replans.append(
            Replan(
                time_s=observation.time_s,
                effective_s=effective_s,
                cause=cause,
                score=score,
                position_m=observation.state.position_m,
                goal_m=goal.position_m,
                status=result.status,
                reason=result.reason,
                path_change_m=change_m,
                iterations=result.iterations,
                expansions=result.expansions,
                near_change=_near_change(observation),
                changed_m=observation.field.voxel_centres_m(voxel).astype(np.float32),
                trajectory_m=new_m.astype(np.float32),
            )
        )

    def _moving(self, time_s: float) -> bool:
        return self.trajectory is not None and time_s < self.trajectory.end_s

    def _brake(self, time_s: float, reason: str) -> None:
        """Leave the trajectory and any plan in flight, and stop; hold where that ends."""
        self.failure, self._pending = reason, None
        if self._moving(time_s) and not self._stopping():
            position_m, velocity_mps, acceleration_mps2 = self._planned_state(time_s)
            self.trajectory = braking_trajectory(
                time_s, position_m, velocity_mps, acceleration_mps2, self.limits
            )
            self.goal = None

    def _stopping(self) -> bool:
        return self.trajectory is not None and self.goal is None


def _near_change(observation: Observation) -> bool:
    """Whether this update brought obstacles nearer, by more than delta_map, within r_mon of vehicle or path.

    Asked alike of every policy's replans: how many lie near a structural change.
    """
    update, field_ = observation.update, observation.field
    counted = ~update.first_seen | update.occupied
    points_m = observation.state.position_m[None]
    if observation.trajectory is not None:
        points_m = np.concatenate([points_m, _samples(observation.trajectory, observation.time_s)])
    voxel, _ = changed_near(
        update.voxel[counted],
        update.old_distance_m[counted],
        update.new_distance_m[counted],
        np.array(field_.distance.shape),
        field_.origin_m,
        field_.voxel_size_m,
        points_m,
        _NEAR_M,
        _CHANGED_M,
        False,
    )
    return len(voxel) > 0


def _samples(trajectory: Trajectory, from_s: float) -> Float:
    return evaluate(trajectory, sample_times(trajectory, from_s, _SAMPLE_S))[0]


def _path_change_m(old_m: Float, new_m: Float) -> float:
    """Largest distance of a point of the old path from the new path (one-sided Hausdorff)."""
    between_m = np.linalg.norm(old_m[:, None] - new_m[None], axis=2)
    return float(between_m.min(axis=1).max())
