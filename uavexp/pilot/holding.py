"""Flies plans as they come, and without one brakes, holds, looks around and tries again.

A request made at t is planned from the predicted reference at t + latency on the map at t
and takes effect at t + latency; until then the vehicle follows the old trajectory. One
request is in flight at a time, further triggers meanwhile are dropped and counted. When
no plan is found: the goal is set aside, the next goals are tried, then the vehicle brakes
within its stopping distance, holds, and tries again at the explorer's rate. A vehicle that
has fallen behind its reference, whatever held it, stops where it is, and a plan is asked for.
What the safety lets be flown of a plan is asked at every ESDF update (`safety.base.Guard`): a
plan that it refuses has failed, one that it has held for `held_s` is made anew, the second
time at one place to another goal.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from uavexp import causes
from uavexp.arrays import Float
from uavexp.braking import REST_MPS, braking_trajectory, with_stop
from uavexp.log import Replan
from uavexp.pace import AS_PLANNED
from uavexp.parameters import Count, NonNegative, option
from uavexp.pilot.base import Crew
from uavexp.pilot.flown import Flown
from uavexp.pilot.following import follow, reference_of, row_of
from uavexp.pilot.heading import Heading, bearing_rad
from uavexp.pilot.noting import replan_of
from uavexp.trajectory import Trajectory, evaluate, hover_before
from uavexp.types import Decision, Goal, Observation, PlanRequest, PlanResult, PlanStatus, Reference

_GOALS_FAULT = (PlanStatus.GOAL_BLOCKED, PlanStatus.NO_PATH, PlanStatus.NOT_CLEAR)  # another may do
_SAME_PLACE_M = 0.5
_YAW_SHARE = 0.9  # of the body-rate limit: roll and pitch need theirs


@option(frozen=True)
class Holding:
    """The rules; `HoldingPilot` flies by them."""

    settle_s: NonNegative = 0.5  # s, hovering and mapping before the first plan, or it is made
    # on a single scan [ours]
    restart_error_m: NonNegative = 0.4  # m, tracking error at which the vehicle has fallen behind: it stops,
    # and a plan starts at the measured state instead of the reference; 0: every plan does [ours]
    held_s: NonNegative = 0.6  # s, held by the safety on a plan until another one is asked for [ours]
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


@dataclass(slots=True, kw_only=True)
class HoldingPilot:
    """What is flown, and every planning request made on the way."""

    rules: Holding
    crew: Crew
    heading: Heading
    flown: Flown | None = None
    best_goal: Goal | None = None
    replans: list[Replan] = field(default_factory=list)
    dropped_triggers: int = 0
    first_plan: PlanResult | None = None
    failure: str = ""
    _pending: Flown | None = None  # a plan waiting for its latency to pass
    _wait_for_rest: bool = False  # after the safety's brake: no new plan before standstill
    _held_m: Float | None = None  # (3,) where the safety held the vehicle last

    @property
    def trajectory(self) -> Trajectory | None:
        """Being flown; None before the first plan."""
        return None if self.flown is None else self.flown.trajectory

    @property
    def goal(self) -> Goal | None:
        """Of that trajectory."""
        return None if self.flown is None else self.flown.goal

    @property
    def ever_planned(self) -> bool:
        """Whether any plan was found."""
        return any(replan.status is PlanStatus.OK for replan in self.replans)

    def reference(self, time_s: float, step_s: float) -> Reference:
        """What to follow now; adopts a plan whose time has come and turns the yaw."""
        if self._pending is not None and time_s >= self._pending.trajectory.start_s - 1e-9:
            self.flown, self._pending = self._pending, None
        if self.failure and not self._moving(time_s):
            return self._look_around(step_s)
        if self.flown is None:
            return self._hold(self.crew.start_m)
        return reference_of(self._follow(self.flown, np.array([time_s]), step_s)[0])

    def references(self, times_s: Float, step_s: float) -> Float:
        """`reference` of one step to come after the other, as rows (N, 14) of `following`."""
        pending = self._pending
        adopts = pending is not None and times_s[-1] >= pending.trajectory.start_s - 1e-9
        if self.flown is None or self.failure or adopts:
            return np.array([row_of(self.reference(time_s, step_s)) for time_s in times_s.tolist()])
        return self._follow(self.flown, times_s, step_s)

    def explore(self, observation: Observation) -> None:
        """Update g*; while without a valid plan, try again."""
        self._select(observation, fresh=False)
        if observation.time_s < self.rules.settle_s - 1e-9:
            return
        if self.flown is None and not self.replans:
            self.request(Decision(replan=True, cause=causes.FIRST.name), observation)
        elif self.failure and not (self._wait_for_rest and self._moving(observation.time_s)):
            cause = (causes.BRAKE if self._wait_for_rest else causes.RETRY).name
            self.request(Decision(replan=True, cause=cause), observation)
        elif self._waits_s(observation.time_s) >= self.rules.held_s:
            self._ask_anew(observation)

    def decide(self, observation: Observation) -> float:
        """Ask safety and trigger; return the trigger's score."""
        behind = self._stops_behind(observation)
        if not self.failure and self.crew.guard.must_brake(observation):
            self._brake(observation, "braked before an obstacle or unknown space")
            self._wait_for_rest = True
        if self.flown is not None and self._pending is None:  # a plan in flight begins on the present pace
            with self.crew.watch.lap("safety"):
                self.flown = self.flown.repaced(observation, self.crew.guard, stops=bool(self.failure))
        with self.crew.watch.lap("trigger"):
            decision = self.crew.trigger.decide(observation)
        # After a failure the pilot tries again by itself, equally often under every policy.
        if behind:
            self.request(Decision(replan=True, cause=causes.BEHIND.name), observation)
        elif decision.replan and self.flown is not None and not self.failure:
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
            result, flown = self._plan(observation, goal)
            self.replans.append(replan_of(decision, observation, goal, result, self.trajectory))
            if flown is not None:
                self.first_plan = self.first_plan or result
                self._accept(flown, observation)
                return
            self.failure = f"{result.status.value}: {result.reason}"
            if result.status not in _GOALS_FAULT:
                break
            self.crew.explorer.reject(goal.position_m, observation.time_s)
            goal = self._select(observation, fresh=True)
        if goal is None:
            self.failure = self.failure or "no goal is reachable"
        self._brake(observation, self.failure)

    def _select(self, observation: Observation, *, fresh: bool) -> Goal | None:
        with self.crew.watch.lap("explore"):
            self.best_goal = self.crew.explorer.select(observation, fresh=fresh)
        return self.best_goal

    def _plan(self, observation: Observation, goal: Goal) -> tuple[PlanResult, Flown | None]:
        """The planner's answer, and what is to be flown of it: nothing where the safety refuses."""
        result = self.crew.planner.plan(self._plan_request(observation, goal))
        self.crew.watch.add("search", result.wall_search_s)
        self.crew.watch.add("optimise", result.wall_optimise_s)
        plan = result.trajectory
        if plan is None:
            return result, None
        turn_s = self._turn_s(plan)
        flown = with_stop(hover_before(plan, turn_s), self.crew.limits)
        way = self.crew.guard.flyable(flown, plan.start_s, AS_PLANNED.at(plan.start_s)[1:], observation)
        if way.refused:
            return replace(result, status=PlanStatus.LIMITS, trajectory=None, reason=way.refused), None
        return result, Flown(trajectory=flown, goal=goal, moves_s=plan.start_s + turn_s, pace=way.pace)

    def _plan_request(self, observation: Observation, goal: Goal) -> PlanRequest:
        """From the reference at t + latency; from the measured state if that is far off or in an obstacle."""
        start_s = observation.time_s + self.crew.latency_s
        state = observation.state
        position_m, velocity_mps, acceleration_mps2 = self._planned_state(start_s)
        far = _error_m(observation) >= self.rules.restart_error_m or self._waits_s(start_s) > 0.0
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

    def _follow(self, flown: Flown, times_s: Float, step_s: float) -> Float:
        pace = (flown.pace.times_s, flown.pace.own_s, flown.pace.rate)
        rows: Float = follow(
            flown.trajectory.breaks_s, flown.trajectory.coefficients, pace, times_s, flown.moves_s,
            self.rules.yaw_lookahead_s, self._wanted_rad, self.heading.yaw_rad, self.heading.most_radps,
            step_s,
        )  # fmt: skip
        self.heading.yaw_rad = float(rows[-1, 9])
        return rows

    @property
    def _wanted_rad(self) -> float:
        """The yaw that g* asks for; NaN: none."""
        return math.nan if self.best_goal is None else self.best_goal.yaw_rad

    def _planned_state(self, time_s: float) -> tuple[Float, Float, Float]:
        if self.flown is None:
            return self.crew.start_m, np.zeros(3), np.zeros(3)
        return self.flown.state(time_s)

    def _accept(self, flown: Flown, observation: Observation) -> None:
        self._pending = flown
        self.failure, self._wait_for_rest = "", False
        self.crew.trigger.planned(flown.trajectory, observation.field)

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
        return self.flown is not None and time_s < self.flown.ends_s

    def _waits_s(self, time_s: float) -> float:
        """How long the safety has held the vehicle on a plan, s; not positive: it does not."""
        held = self.flown is not None and self._pending is None and not self.failure
        return time_s - self.flown.waits_since_s if held and self.flown is not None else -math.inf

    def _ask_anew(self, observation: Observation) -> None:
        """Plan from where the safety holds the vehicle: to another goal, if that has not helped before."""
        here_m, before_m = observation.state.position_m.copy(), self._held_m
        again = before_m is not None and float(np.linalg.norm(here_m - before_m)) < _SAME_PLACE_M
        if again and self.goal is not None:
            self.crew.explorer.reject(self.goal.position_m, observation.time_s)
        self._held_m = here_m
        self.request(Decision(replan=True, cause=causes.HELD.name), observation)

    def _brake(self, observation: Observation, reason: str) -> None:
        """Leave any plan in flight and stop, along the way where the safety does; hold where that ends."""
        self.failure, self._pending = reason, None
        flown = self.flown
        if flown is not None and flown.goal is not None and self._moving(observation.time_s):
            self.flown = flown.stopped(observation, self.crew.guard, self.crew.limits)

    def _stops_behind(self, observation: Observation) -> bool:
        """Whether the vehicle has fallen behind its reference; from now on it stops where it is."""
        error_m, most_m = _error_m(observation), self.rules.restart_error_m
        if self.flown is None or not 0.0 < most_m <= error_m:
            return False
        self._pending = None
        self.failure = f"the vehicle was {error_m:.2f} m from its reference"
        state = observation.state
        stop = braking_trajectory(
            observation.time_s, state.position_m, state.velocity_mps, np.zeros(3), self.crew.limits
        )
        self.flown = Flown(trajectory=stop)
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
