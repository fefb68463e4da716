"""Replanning by distance: after every so many metres, whatever the map says.

Receding horizon with a fixed execution length; the DistanceController of Nav2 (Macenski
et al. 2020) is this policy for ground robots.
"""

from __future__ import annotations

import math
from dataclasses import field

import numpy as np

from uavexp import causes
from uavexp.field import DistanceField
from uavexp.geometry import polyline_length_m
from uavexp.parameters import Positive, option
from uavexp.trajectory import Trajectory, evaluate
from uavexp.trigger.validity import as_flown, ends_within, is_flown
from uavexp.types import Decision, Limits, Observation

_SAMPLE_S = 0.02  # at 2.5 m/s half a voxel


@option
class Distance:
    """Replans once `distance_m` of the plan are flown, and `arrival_s` before a frontier."""

    distance_m: Positive = 1.0  # m, flown along a plan before the next; Nav2's DistanceController example
    arrival_s: Positive = 0.5  # s, also replan so long before a frontier is reached
    # (FUEL's thresh_replan1) [ours]
    _trajectory: Trajectory | None = field(init=False, repr=False, default=None)

    def reset(self, limits: Limits) -> None:
        """Begin a trial."""
        self._trajectory = None

    def planned(self, trajectory: Trajectory, field: DistanceField) -> None:
        """Begin to measure along the new plan."""
        self._trajectory = trajectory

    def decide(self, observation: Observation) -> Decision:
        """Replan when the distance is flown, or on arrival."""
        trajectory, now_s = self._trajectory, observation.time_s
        if not is_flown(trajectory, now_s):
            return Decision(replan=False)
        trajectory = as_flown(trajectory, observation)
        score = flown_m(trajectory, now_s) / self.distance_m
        if score >= 1.0:
            return Decision(replan=True, cause=causes.DISTANCE.name, score=score)
        arrival = ends_within(trajectory, observation.goal, now_s, self.arrival_s)
        return Decision(replan=arrival, cause=causes.ARRIVAL.name if arrival else "", score=score)


def flown_m(trajectory: Trajectory, now_s: float) -> float:
    """Length of a trajectory from its start until now, m: of the reference, free of estimation noise."""
    end_s = min(max(now_s, trajectory.start_s), trajectory.end_s)
    count = 1 + math.ceil((end_s - trajectory.start_s) / _SAMPLE_S)
    return polyline_length_m(evaluate(trajectory, np.linspace(trajectory.start_s, end_s, count))[0])
