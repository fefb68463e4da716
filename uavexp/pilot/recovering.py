"""A pilot's recovery at work: what the ladder is told, and what its rungs need."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from uavexp import causes
from uavexp.arrays import Float
from uavexp.log import Replan
from uavexp.pace import AS_PLANNED
from uavexp.pilot.back_up import back_up, remembered, way_back
from uavexp.pilot.flown import Flown
from uavexp.pilot.heading import room_to_turn
from uavexp.pilot.noting import here
from uavexp.pilot.recovery import Ladder, Patience, Rung, Situation, climbed
from uavexp.pilot.rules import Rules
from uavexp.pilot.touch import Touch, ball_m, is_stopped_short, touched_m
from uavexp.safety.base import Guard
from uavexp.trajectory import Trajectory, evaluate, sample_times
from uavexp.types import Goal, Limits, Observation, Outcome, PlanResult, PlanStatus, Squeeze

_SET_ASIDE_S = 12.0  # goals that were refused come back by then
_STEP_M = 0.02  # of clearance
_SPARE_M = 0.02  # between the body's half width and an obstacle
_BEYOND = 2.0  # body radii from where the safety holds the vehicle to what holds it
_SAMPLE_S = 0.1
_SAME_PLACE_M = 0.5
_APART = 3  # goals without a plan in a row; explorations that were over had one at most
_NO_WAY = (PlanStatus.NO_PATH, PlanStatus.GOAL_BLOCKED, PlanStatus.NOT_CLEAR)


@dataclass(slots=True, kw_only=True)
class Recovering:
    """What is remembered of a flight to get on where no plan leads on."""

    rules: Rules
    limits: Limits
    ladder: Ladder = field(default_factory=Ladder)
    touch: Touch = field(default_factory=Touch)
    refused_s: float = -math.inf  # when a goal was set aside last, because no plan led there
    held_at_m: Float | None = None  # (3,) what the safety holds the vehicle back from
    _held_m: Float | None = None  # (3,) where the safety held the vehicle last
    _way_m: Float = field(default_factory=lambda: np.zeros((0, 3)))
    _touched_m: list[Float] = field(default_factory=list)
    _seen_m3: float = 0.0

    @property
    def lost(self) -> bool:
        """Whether other goals alone have not helped."""
        return self.ladder.climbing and self.ladder.rung is not Rung.GOALS

    @property
    def lasts(self) -> bool:
        """Whether something is left to be tried."""
        return self.ladder.climbing and not self.ladder.ended

    def look(self, observation: Observation) -> None:
        """Take note of an ESDF update."""
        first_seen = int(np.count_nonzero(observation.update.first_seen))
        self._seen_m3 += first_seen * observation.field.voxel_size_m**3
        self._way_m = remembered(self._way_m, observation.state.position_m, self.rules.back_up_m)
        self.touch = self.touch.felt(observation)

    def touches(self, observation: Observation, *, behind: bool) -> bool:
        """Whether the vehicle stands against something, or slides along it; once told, it begins anew."""
        holds = self.touch.holds(observation.time_s) or (behind and is_stopped_short(observation))
        self.touch = Touch() if holds else self.touch
        return holds

    def noted(self, observation: Observation) -> tuple[Float, float] | None:
        """Ball, centre (3,) and radius, that the vehicle stands against; None: what it does is mapped."""
        here_m = observation.state.position_m
        radius_m = ball_m(here_m, self._touched_m)
        centre_m = touched_m(observation, self.limits, radius_m)
        self._touched_m.append(here_m.copy())
        return None if centre_m is None else (centre_m, radius_m)

    def misses_goals(self, observation: Observation) -> bool:
        """Whether there may be goals that are not offered: refused, or beyond the narrow place it is in."""
        refused = observation.time_s < self.refused_s + _SET_ASIDE_S
        return refused or not room_to_turn(observation.field, observation.state.position_m, self.limits)

    def climb(self, observation: Observation, *, lost: bool, busy: bool) -> Rung | None:
        """The rung whose turn it is from now on; None: it stays as it is."""
        here_m, target_m = observation.state.position_m, observation.target_m
        away_m = math.inf if target_m is None else float(np.linalg.norm(target_m - here_m))
        x, y, z = here_m.tolist()
        now = Situation(
            time_s=observation.time_s, here_m=(x, y, z), lost=lost, busy=busy, seen_m3=self._seen_m3,
            away_m=away_m,
        )  # fmt: skip
        before = self.ladder
        patience = Patience(
            wait_s=self.rules.recover_after_s,
            turn_s=2.0 * math.pi / max(self.rules.look_around_radps, 1e-3),
            climbs=self.rules.recoveries,
        )
        self.ladder = climbed(before, now, patience, lambda rung: self._is_possible(rung, observation))
        rung = self.ladder.rung
        return None if rung in (before.rung, Rung.GOALS) else rung

    def back(
        self, observation: Observation, guard: Guard, room_m: float | None = None
    ) -> tuple[Goal, PlanResult, Flown | None]:
        """Where to back up to, the plan, and what is to be flown of it: nothing where the safety refuses.

        `room_m` is the clearance looked for, in place of the usual one.
        """
        way_m = self._back_m(observation, room_m)
        if len(way_m) < 2:
            return here(observation), PlanResult(status=PlanStatus.NO_PATH, reason="no way back"), None
        state = observation.state
        at = replace(observation.reference, position_m=state.position_m, velocity_mps=state.velocity_mps)
        observation = replace(observation, reference=at)  # it begins where the vehicle is
        plan = back_up(way_m, observation.time_s, self.rules.back_up_mps)
        goal = replace(here(observation), position_m=way_m[-1])
        way = guard.flyable(plan, plan.start_s, AS_PLANNED.at(plan.start_s)[1:], observation)
        if way.refused:
            return goal, PlanResult(status=PlanStatus.LIMITS, reason=way.refused), None
        flown = Flown(trajectory=plan, pace=way.pace, backs=True)
        return goal, PlanResult(status=PlanStatus.OK, trajectory=plan), flown

    def squeezes(self) -> tuple[Squeeze, ...]:
        """Lesser clearances, down to the body's half width and a margin."""
        least_m = max(self.rules.lesser_clearance_m, 0.5 * min(self.limits.body_size_m[:2]) + _SPARE_M)
        steps_m = (least_m + _STEP_M, least_m) if self.rules.lesser_clearance_m > 0.0 else ()
        return tuple(Squeeze(clearance_m=m, speed_mps=self.rules.lesser_speed_mps) for m in steps_m)

    def held_again(self, observation: Observation, flown: Flown) -> bool:
        """Remember where the safety holds the vehicle, and on what; whether it did so here before."""
        here_m, before_m = observation.state.position_m.copy(), self._held_m
        self.note_hold(flown.trajectory, flown.pace.at(observation.time_s)[0])
        self._held_m = here_m
        return before_m is not None and float(np.linalg.norm(here_m - before_m)) < _SAME_PLACE_M

    def note_hold(self, plan: Trajectory, from_s: float) -> None:
        """Remember what lies ahead on a plan, from its own time on, that the safety holds the vehicle on."""
        way_m = evaluate(plan, sample_times(plan, from_s, _SAMPLE_S))[0]
        far = np.linalg.norm(way_m - way_m[0], axis=1) >= _BEYOND * self.limits.body_radius_m
        self.held_at_m = way_m[int(np.argmax(far))] if far.any() else None

    def _back_m(self, observation: Observation, room_m: float | None = None) -> Float:
        """Places (N, 3) back along the way flown to where there is room; none: there are none."""
        here_m = observation.state.position_m
        return way_back(self._way_m, here_m, observation.field, room_m or self.rules.back_up_clearance_m)

    def _is_possible(self, rung: Rung, observation: Observation) -> bool:
        if rung is Rung.LOOK:
            turns = self.rules.look_around_radps > 0.0
            return turns and room_to_turn(observation.field, observation.state.position_m, self.limits)
        if rung is Rung.BACK:
            return len(self._back_m(observation)) > 1
        if rung is Rung.LESSER:
            return len(self.squeezes()) > 0
        if rung is Rung.NOTE:
            return self.held_at_m is not None
        return len(observation.tracks) == 0  # people move on


def ending(replans: list[Replan], *, has_goal: bool) -> Outcome:
    """How a flight ends that has tried everything."""
    no_way = not replans or replans[-1].status in _NO_WAY
    return Outcome.UNREACHABLE if no_way or not has_goal else Outcome.STUCK


def is_shut_in(replans: Sequence[Replan]) -> bool:
    """Whether the last requests failed for `_APART` goals or more, a metre apart: no way leads anywhere."""
    goals = set()
    for replan in reversed(replans):
        if replan.status is PlanStatus.OK:
            break
        if np.isfinite(replan.goal_m).all():
            goals.add(tuple(np.round(replan.goal_m).tolist()))
    return len(goals) >= _APART


def tried(replans: list[Replan]) -> str:
    """What has been tried, in words."""
    names = {replan.cause for replan in replans}
    words = [cause.name.replace("_", " ") for cause in causes.RECOVERY if cause.name in names]
    return f"tried: {', '.join(words)}" if words else "nothing else could be tried"
