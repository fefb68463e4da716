"""Flies plans as they come, and without one brakes, holds, looks around and tries again.

A request made at t is planned from the predicted reference at t + latency on the map at t
and takes effect at t + latency; until then the vehicle follows the old trajectory. One
request is in flight at a time, further triggers meanwhile are dropped and counted. When
no plan is found: the goal is set aside, the next goals are tried, then the vehicle brakes
within its stopping distance, holds, and tries again at the explorer's rate. A vehicle that
has fallen behind its reference, whatever held it, stops where it is, and a plan is asked for.
What the safety lets be flown of a plan is asked at every ESDF update (`safety.base.Guard`): a
plan that it refuses has failed, one that it has held for `held_s` is made anew, the second time
at one place to another goal; so is one at whose end the vehicle stands though its goal is offered yet. A
vehicle that gets no further so climbs a ladder (`recovery`). What it stands against though nothing
is mapped there is noted in the map (`touch`). With `recovers=false` none of this asks for a plan: after the
first one only the trigger does, and a request that failed is made again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from uavexp import causes
from uavexp.answers import ask
from uavexp.arrays import Float
from uavexp.pilot.flown import Flown, stopped_off
from uavexp.pilot.following import reference_of, row_of
from uavexp.pilot.glance import towards_encounter_rad
from uavexp.pilot.heading import room_to_turn
from uavexp.pilot.noting import NO_GOAL, error_of, here, replan_of, target_of
from uavexp.pilot.recovering import tried
from uavexp.pilot.recovery import Rung
from uavexp.pilot.requesting import ANYWAY, GOALS_FAULT, Motion, plan_request, planned
from uavexp.pilot.touch import BALL_M
from uavexp.pilot.underway import Underway
from uavexp.types import Decision, Goal, Observation, Reference, Squeeze

_WARY_S = 5.0  # after a touch
_OFF_M = 0.3  # clearance of a place to draw back to from what was touched


@dataclass(slots=True, kw_only=True)
class HoldingPilot(Underway):
    """`Underway`, and the rules by which it goes on."""

    _wait_for_rest: bool = False  # after the safety's brake: no new plan before standstill
    _stopped_s: float = -math.inf  # when it stopped where it was last
    _touched_s: float = -math.inf  # when something was touched last

    def reference(self, time_s: float, step_s: float) -> Reference:
        """What to follow now; adopts a plan whose time has come and turns the yaw."""
        if self._pending is not None and time_s >= self._pending.trajectory.start_s - 1e-9:
            self.flown, self._pending = self._pending, None
        if self.failure and not self._moving(time_s):
            return self.steering.look_around(self._planned_state(math.inf)[0], step_s)
        if self.flown is None:
            return self.steering.hold(self.crew.start_m)
        times_s = np.array([time_s])
        return reference_of(self.steering.follow(self.flown, self._wanted_rad, times_s, step_s)[0])

    def references(self, times_s: Float, step_s: float) -> Float:
        """`reference` of one step to come after the other, as rows (N, 14) of `following`."""
        pending = self._pending
        adopts = pending is not None and times_s[-1] >= pending.trajectory.start_s - 1e-9
        if self.flown is None or self.failure or adopts:
            return np.array([row_of(self.reference(time_s, step_s)) for time_s in times_s.tolist()])
        return self.steering.follow(self.flown, self._wanted_rad, times_s, step_s)

    def explore(self, observation: Observation) -> None:
        """Update g*; while without a valid plan, try again."""
        self._select(observation, fresh=False)
        if observation.time_s < self.rules.settle_s - 1e-9:
            return
        rung = self._climbed(observation) if self.rules.recovers else None
        if rung is not None:
            self._recover(rung, observation)
        elif self.flown is None and not self.replans:
            self.request(Decision(replan=True, cause=causes.FIRST.name), observation)
        elif self.failure and not (self._wait_for_rest and self._moving(observation.time_s)):
            braked = self._wait_for_rest and not self.recovery.lost
            cause = (causes.BRAKE if braked else causes.RETRY).name
            self.request(Decision(replan=True, cause=cause), observation)
        elif not self.rules.recovers:
            return
        elif self._waits_s(observation.time_s) >= self.rules.held_s:
            self._ask_anew(observation)
        elif self._idles(observation.time_s):
            self._ask_anew(observation, been_there=self.goal is not None and not self.goal.is_target)

    def decide(self, observation: Observation) -> float:
        """Ask safety and trigger; return the trigger's score."""
        if self.rules.glance_rad > 0.0:
            self.steering.glance_rad = towards_encounter_rad(observation, self.trajectory)
        self.recovery.look(observation)
        behind = self._stops_behind(observation)
        wary = self.recovery.ladder.climbing or observation.time_s < self._touched_s + _WARY_S
        here_m = observation.state.position_m
        self.steering.turns = not wary or room_to_turn(observation.field, here_m, self.crew.limits)
        if not self.failure and self.crew.guard.must_brake(observation):
            self._brake(observation, "braked before an obstacle or unknown space")
            self._wait_for_rest = True
        if self.flown is not None and self._pending is None:  # a plan in flight begins on the present pace
            with self.crew.watch.lap("safety"):
                stops = bool(self.failure) and not self.flown.backs
                self.flown = self.flown.repaced(observation, self.crew.guard, stops=stops)
        with self.crew.watch.lap("trigger"):
            decision = ask(Decision, self.crew.trigger.decide, observation)
        # After a failure the pilot tries again by itself, equally often under every policy.
        if behind is not None:
            asked = Decision(replan=True, cause=behind.name)
            if self._touched_s < observation.time_s or not self._back_up(asked, observation, _OFF_M):
                self.request(asked, observation)
        elif decision.replan and self.flown is not None and not self.failure:
            self.request(decision, observation)
        return decision.score

    def request(self, decision: Decision, observation: Observation, squeeze: Squeeze | None = None) -> None:
        """Plan to the best goal, else to the next best; brake when there is no plan."""
        if self._pending is not None:
            self.dropped_triggers += 1
            return
        goal = self._select(observation, fresh=True) if self.rules.fresh_goal else self.best_goal
        if squeeze is not None:
            goal = goal or target_of(observation)
        if goal is None and self.recovery.lost:
            self.replans.append(replan_of(decision, observation, here(observation), NO_GOAL, None))
        for _ in range(self.rules.goals_per_request):
            if goal is None:
                break
            asked = plan_request(self.crew, observation, self._start(observation), goal, squeeze)
            parts = (self.crew, self.steering, self.recovery)
            result, flown = planned(*parts, asked, observation, self._wanted_rad)
            self.replans.append(replan_of(decision, observation, goal, result, self.trajectory))
            if flown is not None:
                self.first_plan = self.first_plan or result
                self._accept(flown, observation)
                return
            self.failure = f"{result.status.value}: {result.reason}"
            if result.status not in (ANYWAY if self.recovery.lost else GOALS_FAULT):
                break
            self.recovery.refused_s = observation.time_s
            self.crew.explorer.reject(goal.position_m, observation.time_s)
            goal = self._select(observation, fresh=True)
        if goal is None:
            self.failure = self.failure or "no goal is reachable"
        self._brake(observation, self.failure)

    def _select(self, observation: Observation, *, fresh: bool) -> Goal | None:
        with self.crew.watch.lap("explore"):
            self.best_goal = self.crew.explorer.select(observation, fresh=fresh)
        return self.best_goal

    def _start(self, observation: Observation) -> Motion:
        """The reference at t + latency; the measured state if that is far off or in an obstacle."""
        start_s, state = observation.time_s + self.crew.latency_s, observation.state
        start = self._planned_state(start_s)
        left = error_of(observation) >= self.rules.restart_error_m and self._stopped_s < observation.time_s
        far = left or self._waits_s(start_s) > 0.0
        if far or observation.field.distance_m(start[0][None])[0] <= 0.0:
            ahead_m = state.position_m + self.crew.latency_s * state.velocity_mps
            return ahead_m, state.velocity_mps, np.zeros(3)
        return start

    @property
    def _wanted_rad(self) -> float:
        """The yaw that g* asks for; NaN: none."""
        return math.nan if self.best_goal is None else self.best_goal.yaw_rad

    def _planned_state(self, time_s: float) -> Motion:
        if self.flown is None:
            return self.crew.start_m, np.zeros(3), np.zeros(3)
        return self.flown.state(time_s)

    def _accept(self, flown: Flown, observation: Observation) -> None:
        self._pending = flown
        self.failure, self._wait_for_rest = "", False
        self.crew.trigger.planned(flown.trajectory, observation.field)

    def _ask_anew(self, observation: Observation, *, been_there: bool = False) -> None:
        """Plan from where the vehicle is held or stands: to another goal, if this one has not helped."""
        again = self.flown is not None and self.recovery.held_again(observation, self.flown)
        if (again or been_there) and self.goal is not None:
            self.recovery.refused_s = observation.time_s
            self.crew.explorer.reject(self.goal.position_m, observation.time_s)
        self.request(Decision(replan=True, cause=causes.HELD.name), observation)

    def _miss_goals(self, observation: Observation) -> None:
        """Without any goal, though not for want of frontiers, the vehicle is lost."""
        stands = self.flown is not None and self._pending is None and not self._moving(observation.time_s)
        if self.best_goal is not None or self.failure or not stands:
            return
        if self.recovery.misses_goals(observation):
            self.failure = "no goal is reachable"

    def _climbed(self, observation: Observation) -> Rung | None:
        """The rung of the ladder whose turn it is; None: go on as before."""
        self._miss_goals(observation)
        time_s = observation.time_s
        moving, waits_s = self._moving(time_s), self._waits_s(time_s)
        held = waits_s > 0.0 if self.recovery.ladder.climbing else waits_s >= self.rules.held_s
        lost = held or (bool(self.failure) and not moving)
        return self.recovery.climb(observation, lost=lost, busy=moving or self._pending is not None)

    def _recover(self, rung: Rung, observation: Observation) -> None:
        """Do what a rung asks for."""
        decision = Decision(replan=True, cause=rung.value)
        if rung is Rung.END:
            self.failure = f"{self.failure or 'the safety holds it'}; {tried(self.replans)}"
            return
        if not self.failure:
            self._brake(observation, "the safety holds it")
        if rung is Rung.BACK and self._back_up(decision, observation):
            return
        if rung is Rung.NOTE and self.recovery.held_at_m is not None:
            self.crew.note_obstacle(self.recovery.held_at_m, BALL_M)
            self.recovery.held_at_m = None
        for squeeze in self.recovery.squeezes() if rung is Rung.LESSER else (None,):
            self.request(decision, observation, squeeze)
            if not self.failure:
                return

    def _back_up(self, decision: Decision, observation: Observation, room_m: float | None = None) -> bool:
        """Fly back along the way that was flown; False: that is not possible."""
        goal, result, flown = self.recovery.back(observation, self.crew.guard, room_m)
        if flown is None:
            return False
        self.replans.append(replan_of(decision, observation, goal, result, self.trajectory))
        self.flown, self._wait_for_rest = flown, True
        return True

    def _brake(self, observation: Observation, reason: str) -> None:
        """Leave any plan in flight and stop, along the way where the safety does; hold where that ends."""
        self.failure, self._pending = reason, None
        flown = self.flown
        if flown is not None and flown.goal is not None and self._moving(observation.time_s):
            self.flown = flown.stopped(observation, self.crew.guard, self.crew.limits)

    def _stops_behind(self, observation: Observation) -> causes.Cause | None:
        """Why the vehicle stops where it is from now on: it fell behind, or it touches; None: it does not."""
        if not self.rules.recovers:
            return None
        error_m, most_m = error_of(observation), self.rules.restart_error_m
        behind = 0.0 < most_m <= error_m
        touches = self.recovery.touches(observation, behind=behind)
        if self.flown is None or not (behind or touches):
            return None
        self.failure = f"the vehicle was {error_m:.2f} m from its reference"
        self._pending, self.flown = None, stopped_off(observation, self.crew.limits)
        self._stopped_s = observation.time_s
        if not touches:
            return causes.BEHIND
        self._touched_s = observation.time_s
        ball = self.recovery.noted(observation)
        if ball is None:
            return causes.BEHIND
        self.crew.note_obstacle(*ball)
        self.failure += ", and nothing is mapped in its way"
        return causes.NOTED
