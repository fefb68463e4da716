"""Replanning when a new plan is expected to be worth more than it costs [ours].

Every check compares two futures over the next `horizon_s`: the plan is kept, or made anew now. What the
new one gains is told in seconds, all of it from what the vehicle believes:

    gain = risk + time,  replan if gain > cost_s

- risk, which a new plan would avoid: what a stop and a new start cost, 2 v_max / a, times the chance that
  it comes to that, the most of p(d) - p(d*) over the horizon, less what it was there when the plan was made.
  p(d) = ((d_s - d) / (d_s - r))⁴, within [0, 1]: none from `safe_clearance_m` d_s on, 1 where the body's
  radius r touches at the mapped distance d. d* is the most that a step aside of `aside_m` can reach: a door
  that is as narrow as its world allows, or was seen from the start, asks for nothing. What comes to touch
  is avoided whole.
- time: with another goal g* than the flown one, what is lost by flying the old plan for the horizon and to g*
  only then, T - (‖p(0) - g*‖ - ‖p(T) - g*‖) / v, v the speed now. A goal further along the same way costs
  nothing until the plan slows down to its end: it is merged, and asked for as late as no speed is lost.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from uavexp import causes
from uavexp.arrays import Float
from uavexp.field import DistanceField
from uavexp.parameters import Positive, option
from uavexp.trajectory import Trajectory, evaluate, sample_times
from uavexp.trigger.validity import as_flown, is_flown
from uavexp.types import Decision, Goal, Limits, Observation

_SAMPLE_S = 0.05  # at 2.5 m/s about one voxel apart
_STEP_M = 0.1  # between two places aside
_NOISE_M = 0.01  # a smaller drop is no drop
_STILL_MPS = 0.1
_SAME_GOAL_M = 0.3  # delta_g of paper 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """A plan's places with what they were when it was made."""

    times_s: Float  # (N,)
    aside_m: Float  # (N, K, 3) each place and those beside it, the place itself in the middle
    clearance_m: Float  # (N,) mapped when the plan was made
    avoidable: Float  # (N,) chance of a stop that a step aside would have spared then

    def after(self, now_s: float, horizon_s: float) -> slice:
        """The places that are reached within the horizon."""
        first, last = np.searchsorted(self.times_s, [now_s, now_s + horizon_s + 1e-9])
        return slice(int(first), int(last))


def chance_of_stop(clearance_m: Float, safe_m: float, body_radius_m: float) -> Float:
    """Of places by their mapped distances, m: 0 from the safe one on, 1 at the body's radius [ours]."""
    span_m = max(safe_m - body_radius_m, _NOISE_M)  # a body larger than what is held for safe
    return np.clip((safe_m - clearance_m) / span_m, 0.0, 1.0) ** 4


def places_aside(point_m: Float, velocity_mps: Float, reach_m: float) -> Float:
    """Places (N, K, 3) across the way, level, up to the reach on both sides; the middle ones are on it."""
    speed = np.hypot(velocity_mps[:, 0], velocity_mps[:, 1])
    across = np.column_stack([-velocity_mps[:, 1], velocity_mps[:, 0], np.zeros(len(speed))])
    across /= np.maximum(speed, _STILL_MPS)[:, None]
    steps = math.ceil(reach_m / _STEP_M)
    offset_m = np.linspace(-reach_m, reach_m, 2 * steps + 1)
    return np.asarray(point_m[:, None] + offset_m[None, :, None] * across[:, None])


@option
class Gain:
    """Replans when the seconds that a new plan is expected to gain exceed `cost_s`."""

    cost_s: Positive = 0.5  # s, a new plan must gain more
    horizon_s: Positive = 1.0  # s, the future that is compared: a stop from 2.5 m/s takes as long
    safe_clearance_m: Positive = 0.75  # m, more is no less risk; as planner.safe_clearance_m
    aside_m: Positive = 0.5  # m, a new plan may lie so far beside the old one
    _limits: Limits | None = field(init=False, repr=False, default=None)
    _trajectory: Trajectory | None = field(init=False, repr=False, default=None)
    _judged: Judged | None = field(init=False, repr=False, default=None)

    def reset(self, limits: Limits) -> None:
        """Begin a trial."""
        self._limits, self._trajectory, self._judged = limits, None, None

    def planned(self, trajectory: Trajectory, field: DistanceField) -> None:
        """Keep the new plan with the exposure that it was made with."""
        times_s = sample_times(trajectory, trajectory.start_s, _SAMPLE_S)
        point_m, velocity_mps, _ = evaluate(trajectory, times_s)
        aside_m = places_aside(point_m, velocity_mps, self.aside_m)
        clearance_m, avoidable = self._avoidable(aside_m, field)
        self._trajectory = trajectory
        self._judged = Judged(times_s=times_s, aside_m=aside_m, clearance_m=clearance_m, avoidable=avoidable)

    def decide(self, observation: Observation) -> Decision:
        """Replan when the gain exceeds the cost; the larger part of it names the cause."""
        trajectory, now_s = self._trajectory, observation.time_s
        if self._judged is None or not is_flown(trajectory, now_s):
            return Decision(replan=False)
        flown = as_flown(trajectory, observation)
        risk_s = self._risk_s(self._judged, observation.field, now_s - (flown.start_s - trajectory.start_s))
        time_s = self._time_s(flown, observation)
        score = (risk_s + time_s) / self.cost_s
        if score <= 1.0:
            return Decision(replan=False, score=score)
        cause = causes.MAP if risk_s >= time_s else causes.GOAL
        return Decision(replan=True, cause=cause.name, score=score)

    def _avoidable(self, aside_m: Float, field: DistanceField) -> tuple[Float, Float]:
        """Mapped distance of places (N,), and the chance of a stop there that a step aside would spare."""
        assert self._limits is not None
        distance_m = field.distance_m(aside_m.reshape(-1, 3)).reshape(aside_m.shape[:2])
        clearance_m = distance_m[:, aside_m.shape[1] // 2]
        here, best = (
            chance_of_stop(far_m, self.safe_clearance_m, self._limits.body_radius_m)
            for far_m in (clearance_m, distance_m.max(axis=1))
        )
        return clearance_m, here - best

    def _risk_s(self, made: Judged, field: DistanceField, now_s: float) -> float:
        """Seconds that the risk ahead is expected to cost which the plan was not made with."""
        assert self._limits is not None
        part = made.after(now_s, self.horizon_s)
        clearance_m, avoidable = self._avoidable(made.aside_m[part], field)
        dropped = clearance_m < made.clearance_m[part] - _NOISE_M
        chance = np.maximum(avoidable - made.avoidable[part], 0.0)
        chance[dropped & (clearance_m < self._limits.body_radius_m)] = 1.0
        stop_s = 2.0 * self._limits.max_speed_mps / self._limits.max_acceleration_mps2
        return stop_s * float(chance.max(initial=0.0))

    def _time_s(self, flown: Trajectory, observation: Observation) -> float:
        """Seconds lost by flying the plan for the horizon and only then to another goal."""
        if not _is_another(observation.best_goal, observation.goal):
            return 0.0
        assert observation.best_goal is not None
        now_s = observation.time_s
        (here_m, there_m), velocity_mps, _ = evaluate(flown, np.array([now_s, now_s + self.horizon_s]))
        best_m = observation.best_goal.position_m
        nearer_m = float(np.linalg.norm(here_m - best_m) - np.linalg.norm(there_m - best_m))
        speed_mps = max(float(np.linalg.norm(velocity_mps[0])), _STILL_MPS)
        return max(self.horizon_s - nearer_m / speed_mps, 0.0)


def _is_another(best: Goal | None, flown: Goal | None) -> bool:
    """Whether the explorer has another goal than the one flown to."""
    if best is None or flown is None:
        return False
    return float(np.linalg.norm(best.position_m - flown.position_m)) > _SAME_GOAL_M
