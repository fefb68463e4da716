"""Flies plans as they come, and without one brakes, holds, looks around and tries again.

A request made at t is planned from the predicted reference at t + latency on the map at t
and takes effect at t + latency; until then the vehicle follows the old trajectory. One
request is in flight at a time, further triggers meanwhile are dropped and counted. When
no plan is found: the goal is set aside, the next goals are tried, then the vehicle brakes
within its stopping distance, holds, and tries again at the explorer's rate. A vehicle that
has fallen behind its reference, whatever held it, stops where it is, and a plan is asked for.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from uavexp import causes
from uavexp.arrays import Float
from uavexp.braking import REST_MPS, braking_trajectory, with_stop
from uavexp.log import Replan
from uavexp.parameters import Count, NonNegative, option
from uavexp.pilot.base import Crew
from uavexp.pilot.following import follow, reference_of, row_of
from uavexp.pilot.heading import Heading, bearing_rad
from uavexp.pilot.noting import replan_of
from uavexp.trajectory import Trajectory, evaluate, hover_before
from uavexp.types import Decision, Goal, Observation, PlanRequest, PlanResult, PlanStatus, Reference

_GOALS_FAULT = (PlanStatus.GOAL_BLOCKED, PlanStatus.NO_PATH, PlanStatus.NOT_CLEAR)  # another may do
_YAW_SHARE = 0.9  # of the body-rate limit: roll and pitch need theirs


@option(frozen=True)
class Holding:
    """The rules; `HoldingPilot` flies by them."""

    settle_s: NonNegative = 0.5  # s, hovering and mapping before the first plan, or it is made
    # on a single scan [ours]
    restart_error_m: NonNegative = 0.4  # m, tracking error at which the vehicle has fallen behind: it stops,
    # and a plan starts at the measured state instead of the reference; 0: every plan does [ours]
    goals_per_request: Count = 3  # so many goals are tried before the vehicle brakes [ours]
    look_around_radps: NonNegative = 0.8  # rad/s, turning on the spot while there is no plan:
    # only new sights can help [ours]
    turn_first_rad: NonNegative = 0.6  # rad, from standstill the vehicle turns until it looks this close
    # to its way (4: never) [ours]
    yaw_lookahead_s: NonNegative = 0.8  # s, the yaw looks at the path so far ahead [ours]

    def begin(self, crew: Crew) -> HoldingPilot:
        """Begin a trial."""
        most_radps = _YAW_SHARE * crew.limits.max_body_rate_radps
        return HoldingPilot(
            rules=self, crew=crew, heading=Heading(yaw_rad=crew.start_yaw_rad, most_radps=most_radps)
        )


@dataclass(frozen=True, slots=True)
class _Pending:
    """A plan waiting for its latency to pass."""

    trajectory: Trajectory
    goal: Goal
    moves_s: float  # before, it only turns


@dataclass(slots=True, kw_only=True)
class HoldingPilot:
    """What is flown, and every planning request made on the way."""

    rules: Holding
    crew: Crew
    heading: Heading
    trajectory: Trajectory | None = None
    goal: Goal | None = None
    best_goal: Goal | None = None
    replans: list[Replan] = field(default_factory=list)
    dropped_triggers: int = 0
    first_plan: PlanResult | None = None
    failure: str = ""
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
            return self._hold(self.crew.start_m)
        return reference_of(self._follow(self.trajectory, np.array([time_s]), step_s)[0])

    def references(self, times_s: Float, step_s: float) -> Float:
        """`reference` of one step to come after the other, as rows (N, 14) of `following`."""
        pending = self._pending
        adopts = pending is not None and times_s[-1] >= pending.trajectory.start_s - 1e-9
        if self.trajectory is None or self.failure or adopts:
            return np.array([row_of(self.reference(time_s, step_s)) for time_s in times_s.tolist()])
        return self._follow(self.trajectory, times_s, step_s)

    def explore(self, observation: Observation) -> None:
        """Update g*; while without a valid plan, try again."""
        self._select(observation, fresh=False)
        if observation.time_s < self.rules.settle_s - 1e-9:
            return
        if self.trajectory is None and not self.replans:
            self.request(Decision(replan=True, cause=causes.FIRST.name), observation)
        elif self.failure and not (self._wait_for_rest and self._moving(observation.time_s)):
            cause = (causes.BRAKE if self._wait_for_rest else causes.RETRY).name
            self.request(Decision(replan=True, cause=cause), observation)

    def decide(self, observation: Observation) -> float:
        """Ask safety and trigger; return the trigger's score."""
        behind = self._stops_behind(observation)
        if not self.failure and self.crew.must_brake(observation):
            self._brake(observation.time_s, "braked before an obstacle or unknown space")
            self._wait_for_rest = True
        with self.crew.watch.lap("trigger"):
            decision = self.crew.trigger.decide(observation)
        # After a failure the pilot tries again by itself, equally often under every policy.
        if behind:
            self.request(Decision(replan=True, cause=causes.BEHIND.name), observation)
        elif decision.replan and self.trajectory is not None and not self.failure:
            self.request(decision, observation)
        return decision.score

    def request(self, decision: Decision, observation: Observation) -> None:
        """Plan to the best goal, else to the next best; brake when there is no plan."""
        if self._pending is not None:
            self.dropped_triggers += 1
            return
        goal = self._select(observation, fresh=True)
        for _ in range(self.rules.goals_per_request):
            if goal is None:
                break
            result = self._plan(observation, goal)
            self.replans.append(replan_of(decision, observation, goal, result, self.trajectory))
            if result.trajectory is not None:
                self.first_plan = self.first_plan or result
                self._accept(result.trajectory, goal, observation)
                return
            self.failure = f"{result.status.value}: {result.reason}"
            if result.status not in _GOALS_FAULT:
                break
            self.crew.explorer.reject(goal.position_m, observation.time_s)
            goal = self._select(observation, fresh=True)
        if goal is None:
            self.failure = self.failure or "no goal is reachable"
        self._brake(observation.time_s, self.failure)

    def _select(self, observation: Observation, *, fresh: bool) -> Goal | None:
        with self.crew.watch.lap("explore"):
            self.best_goal = self.crew.explorer.select(observation, fresh=fresh)
        return self.best_goal

    def _plan(self, observation: Observation, goal: Goal) -> PlanResult:
        result = self.crew.planner.plan(self._plan_request(observation, goal))
        self.crew.watch.add("search", result.wall_search_s)
        self.crew.watch.add("optimise", result.wall_optimise_s)
        return result

    def _plan_request(self, observation: Observation, goal: Goal) -> PlanRequest:
        """From the reference at t + latency; from the measured state if that is far off or in an obstacle."""
        start_s = observation.time_s + self.crew.latency_s
        state = observation.state
        position_m, velocity_mps, acceleration_mps2 = self._planned_state(start_s)
        far = _error_m(observation) >= self.rules.restart_error_m
        if far or observation.field.distance_m(position_m[None])[0] <= 0.0:
            position_m = state.position_m + self.crew.latency_s * state.velocity_mps
            velocity_mps, acceleration_mps2 = state.velocity_mps, np.zeros(3)
        return PlanRequest(
            time_s=start_s,
            position_m=position_m,
            velocity_mps=velocity_mps,
            acceleration_mps2=acceleration_mps2,
            goal=goal,
            field=observation.field,
            flight_bounds_m=self.crew.flight_bounds_m,
            tracks=observation.tracks,
        )

    def _follow(self, trajectory: Trajectory, times_s: Float, step_s: float) -> Float:
        rows: Float = follow(
            trajectory.breaks_s, trajectory.coefficients, times_s, self._moves_s, self.rules.yaw_lookahead_s,
            self._wanted_rad, self.heading.yaw_rad, self.heading.most_radps, step_s,
        )  # fmt: skip
        self.heading.yaw_rad = float(rows[-1, 9])
        return rows

    @property
    def _wanted_rad(self) -> float:
        """The yaw that g* asks for; NaN: none."""
        return math.nan if self.best_goal is None else self.best_goal.yaw_rad

    def _planned_state(self, time_s: float) -> tuple[Float, Float, Float]:
        if self.trajectory is None:
            return self.crew.start_m, np.zeros(3), np.zeros(3)
        position, velocity, acceleration = evaluate(self.trajectory, np.array([time_s]))
        return position[0], velocity[0], acceleration[0]

    def _accept(self, trajectory: Trajectory, goal: Goal, observation: Observation) -> None:
        turn_s = self._turn_s(trajectory)
        flown = with_stop(hover_before(trajectory, turn_s), self.crew.limits)
        self._pending = _Pending(flown, goal, trajectory.start_s + turn_s)
        self.failure, self._wait_for_rest = "", False
        self.crew.trigger.planned(flown, observation.field)

    def _turn_s(self, trajectory: Trajectory) -> float:
        """Time to turn until the camera sees where a flight from standstill goes, s.

        Sensing is what keeps the flight off unseen obstacles, under every policy alike.
        """
        times_s = trajectory.start_s + np.array([0.0, self.rules.yaw_lookahead_s])
        position, velocity, _ = evaluate(trajectory, times_s)
        bearing = bearing_rad(self._wanted_rad, position[1] - position[0])
        if float(np.linalg.norm(velocity[0])) > REST_MPS or math.isnan(bearing):
            return 0.0
        return self.heading.turning_s(bearing, self.rules.turn_first_rad)

    def _moving(self, time_s: float) -> bool:
        return self.trajectory is not None and time_s < self.trajectory.end_s

    def _brake(self, time_s: float, reason: str) -> None:
        """Leave the trajectory and any plan in flight, and stop; hold where that ends."""
        self.failure, self._pending = reason, None
        stopping = self.trajectory is not None and self.goal is None
        if self._moving(time_s) and not stopping:
            self.trajectory = braking_trajectory(time_s, *self._planned_state(time_s), self.crew.limits)
            self.goal = None

    def _stops_behind(self, observation: Observation) -> bool:
        """Whether the vehicle has fallen behind its reference; from now on it stops where it is."""
        error_m, most_m = _error_m(observation), self.rules.restart_error_m
        if self.trajectory is None or not 0.0 < most_m <= error_m:
            return False
        self._pending, self.goal = None, None
        self.failure = f"the vehicle was {error_m:.2f} m from its reference"
        state = observation.state
        self.trajectory = braking_trajectory(
            observation.time_s, state.position_m, state.velocity_mps, np.zeros(3), self.crew.limits
        )
        return True

    def _look_around(self, step_s: float) -> Reference:
        """Hold and turn: without a plan, only new sights can help."""
        rate_radps = self.heading.turn(self.rules.look_around_radps, step_s)
        return self._hold(self._planned_state(math.inf)[0], rate_radps)

    def _hold(self, position_m: Float, yaw_rate_radps: float = 0.0) -> Reference:
        zero = np.zeros(3)
        return Reference(
            position_m=position_m,
            velocity_mps=zero,
            acceleration_mps2=zero,
            yaw_rad=self.heading.yaw_rad,
            yaw_rate_radps=yaw_rate_radps,
        )


def _error_m(observation: Observation) -> float:
    """Tracking error."""
    return float(np.linalg.norm(observation.reference.position_m - observation.state.position_m))
