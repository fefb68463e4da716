"""Stop in time: when the flown trajectory meets a mapped obstacle or leaves known-free space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavexp.braking import stopping_distance_m
from uavexp.errors import require
from uavexp.parameters import NonNegative, option
from uavexp.safety.base import Guard, Unguarded
from uavexp.trajectory import evaluate, sample_times
from uavexp.types import Limits, Observation

_SAMPLE_S = 0.04  # at 2.5 m/s one voxel apart


@option(frozen=True)
class Brake:
    """Brakes when the path within the stopping distance ahead is not known to be free."""

    margin_m: NonNegative = 0.03  # m, the path counts as blocked when its clearance is below body
    # radius + this [ours]
    reaction_s: NonNegative = 0.2  # s, flown on before braking begins: one ESDF period and the latency [ours]
    stop_at_unknown: bool = True  # also brake before leaving known-free space

    def begin(self, limits: Limits) -> Guard:
        """Begin a trial."""
        require(limits.max_acceleration_mps2 > 0.0, "max_acceleration_mps2 must be > 0 to brake")
        return _Watch(self, limits)


@dataclass(frozen=True, slots=True)
class _Watch(Unguarded):
    """`Brake` in one trial."""

    rules: Brake
    limits: Limits

    def must_brake(self, observation: Observation) -> bool:
        """Whether the trajectory, up to the stopping distance ahead, is blocked or unknown.

        The look-ahead distance is the stopping distance, plus what is flown in `reaction_s` (one ESDF
        period and the latency), plus the body's radius.
        """
        rules, limits, trajectory = self.rules, self.limits, observation.trajectory
        if trajectory is None:
            return False
        times_s = sample_times(trajectory, observation.time_s, _SAMPLE_S)
        points_m = evaluate(trajectory, times_s)[0]
        speed_mps = float(np.linalg.norm(observation.reference.velocity_mps))
        if speed_mps < 0.05 or len(points_m) < 2:
            return False
        ahead_m = stopping_distance_m(speed_mps, limits) + speed_mps * rules.reaction_s + limits.body_radius_m
        along_m = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points_m, axis=0), axis=1)))
        near = points_m[along_m <= ahead_m]
        clearance_m = observation.field.distance_m(near)
        # Getting away from what is near already is no danger.
        blocked = (clearance_m < limits.body_radius_m + rules.margin_m) & (
            clearance_m < clearance_m[0] - 0.01
        )
        if rules.stop_at_unknown:
            blocked |= ~observation.field.observed(near)
        return bool(blocked.any())
