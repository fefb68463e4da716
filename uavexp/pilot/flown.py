"""What is flown: a trajectory, the goal at its end, and the pace at which the safety lets it be flown."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from uavexp.arrays import Float
from uavexp.braking import braking_trajectory
from uavexp.geometry import GRAVITY_MPS2, rotation_from_quaternion
from uavexp.pace import AS_PLANNED, Pace, delayed, evaluate_paced
from uavexp.safety.base import Guard
from uavexp.trajectory import Trajectory, evaluate
from uavexp.types import Goal, Limits, Observation, Squeeze

_LEAST_UP = 0.5
_BEGUN_M = 0.1  # a plan that comes so far moves


@dataclass(frozen=True, slots=True, kw_only=True)
class Flown:
    """A trajectory on its way; `repaced` at every ESDF update."""

    trajectory: Trajectory  # with the times at which it is flown, as of the last update
    goal: Goal | None = None  # at its end; None: it is a stop
    moves_s: float = -math.inf  # before, it only turns
    pace: Pace = AS_PLANNED
    squeeze: Squeeze | None = None  # through which it leads
    backs: bool = False  # it leads back along the way flown, and is no stop though it has no goal
    waits_since_s: float = math.inf  # since when it has been stood still on before its end; inf: it moves

    @property
    def ends_s(self) -> float:
        """When it is at rest, at its end or where the safety stops it."""
        pace = self.pace
        if not len(pace.rate):
            return self.trajectory.end_s
        left_s = self.trajectory.end_s - float(pace.own_s[-1])
        last = float(pace.rate[-1])
        return float(pace.times_s[-1]) + (max(left_s, 0.0) / last if last > 0.0 else 0.0)

    def state(self, time_s: float) -> tuple[Float, Float, Float]:
        """Position, velocity and acceleration (3,) of the reference."""
        trajectory, pace = self.trajectory, self.pace
        _, position, velocity, acceleration, _ = evaluate_paced(
            trajectory.breaks_s, trajectory.coefficients, (pace.times_s, pace.own_s, pace.rate),
            np.array([time_s]),
        )  # fmt: skip
        return position[0], velocity[0], acceleration[0]

    def stopped(self, observation: Observation, guard: Guard, limits: Limits) -> Flown:
        """A stop from here on: along the way where the safety stops so, else straight ahead."""
        stop = self.repaced(observation, guard, stops=True)
        if stop.pace is AS_PLANNED:
            state = self.state(observation.time_s)
            stop = Flown(trajectory=braking_trajectory(observation.time_s, *state, limits))
        return replace(stop, goal=None)

    def repaced(self, observation: Observation, guard: Guard, *, stops: bool) -> Flown:
        """The same with the times and the pace of now; `stops`: it comes to rest soon."""
        now_s = observation.time_s
        own_s, *rate = self.pace.at(now_s)
        late_s = now_s - own_s if own_s < now_s else 0.0
        trajectory = delayed(self.trajectory, late_s) if late_s else self.trajectory
        moves_s = self.moves_s + late_s
        pace = guard.flyable(
            trajectory, now_s, (rate[0], rate[1]), observation, stops=stops, squeeze=self.squeeze
        ).pace
        waits = pace.rests_s <= now_s < trajectory.end_s and now_s >= moves_s
        since_s = min(self.waits_since_s, now_s) if waits else math.inf
        return replace(self, trajectory=trajectory, moves_s=moves_s, pace=pace, waits_since_s=since_s)


def stopped_off(observation: Observation, limits: Limits) -> Flown:
    """A stop of a vehicle that is off its reference, from where it is, as accelerated as it is tilted.

    A vehicle that was catching up is tilted; a stop that took it for level would be left behind at once.
    """
    state, most_mps2 = observation.state, limits.max_acceleration_mps2
    up = rotation_from_quaternion(state.quaternion_wxyz)[:, 2]
    tilt = GRAVITY_MPS2 * np.array([up[0], up[1], 0.0]) / max(up[2], _LEAST_UP)
    acceleration = tilt * min(1.0, most_mps2 / max(float(np.linalg.norm(tilt)), 1e-9))
    start = (observation.time_s, state.position_m, state.velocity_mps, acceleration)
    return Flown(trajectory=braking_trajectory(*start, limits))


def is_held(plan: Trajectory, pace: Pace) -> bool:
    """Whether a plan at this pace rests where it begins."""
    if not math.isfinite(pace.rests_s):
        return False
    ends_m = evaluate(plan, np.array([plan.start_s, float(pace.own_s[-1])]))[0]
    return float(np.linalg.norm(ends_m[1] - ends_m[0])) < _BEGUN_M
