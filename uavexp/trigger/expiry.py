"""Replanning as Nav2 does (Macenski et al. 2020): when the path is invalid, old, or the goal is new.

The behaviour tree "replanning only if path becomes invalid": PathExpiringTimer, IsPathValid
and GlobalUpdatedGoal, any of which asks for a new path. Two rules can be added: near the target a valid
path is not replaced (IsGoalNearby, in Nav2's trees since 2026), and a path whose cost has risen is (asked
for in its issue 2880 and never measured).
"""

from __future__ import annotations

from dataclasses import field

import numpy as np

from uavexp import causes
from uavexp.field import DistanceField
from uavexp.geometry import polyline_length_m
from uavexp.parameters import NonNegative, Positive, option
from uavexp.path_clearance import clearance_ahead_m
from uavexp.trajectory import Trajectory, evaluate, sample_times
from uavexp.trigger.path_cost import PathCost
from uavexp.trigger.validity import as_flown, comes_near, ends_within, is_flown, is_older
from uavexp.types import Decision, Limits, Observation

_SAMPLE_S = 0.05


@option
class Expiry:
    """Replans when the plan is invalid, expired or its goal replaced, and before a frontier."""

    expiry_s: Positive = 10.0  # s, a plan that old is replaced (PathExpiringTimer; 10 s in Nav2's tree)
    clearance_m: NonNegative = 0.23  # m, least mapped distance ahead (IsPathValid):
    # the body's circle is 0.226 m [ours]; 0: validity is not asked
    horizon_s: Positive = 10.0  # s, the validity check looks so far ahead: in practice the whole trajectory
    goal_updated: bool = True  # whether another goal g* asks for a plan (GoalUpdated)
    arrival_s: Positive = 0.5  # s, also replan so long before a frontier is reached
    # (FUEL's thresh_replan1) [ours]
    nearby_m: NonNegative = 0.0  # m, with so little left to the target only a collision asks for a plan
    # (IsGoalNearby; 1 m in Nav2); 0: everything does
    cost_rise: NonNegative = 0.0  # 1, replan when what is left costs more by this share than when it was
    # planned (`trigger.path_cost`); 0: never
    _radius_m: float = field(init=False, repr=False, default=0.0)
    _cost: PathCost | None = field(init=False, repr=False, default=None)
    _trajectory: Trajectory | None = field(init=False, repr=False, default=None)

    def reset(self, limits: Limits) -> None:
        """Begin a trial."""
        self._trajectory, self._cost, self._radius_m = None, None, limits.body_radius_m

    def planned(self, trajectory: Trajectory, field: DistanceField) -> None:
        """Watch the new plan; its timer starts when it takes effect."""
        self._trajectory = trajectory
        self._cost = PathCost.of(trajectory, field, self._radius_m) if self.cost_rise > 0.0 else None

    def decide(self, observation: Observation) -> Decision:
        """Replan on the first of collision, new goal, cost, expiry and arrival that holds."""
        if not is_flown(self._trajectory, observation.time_s):
            return Decision(replan=False)
        cause = self._cause(self._trajectory, observation)
        score = (observation.time_s - self._trajectory.start_s) / self.expiry_s
        return Decision(replan=cause != "", cause=cause, score=score)

    def _cause(self, trajectory: Trajectory, observation: Observation) -> str:
        now_s, flown = observation.time_s, as_flown(trajectory, observation)
        ahead_m = clearance_ahead_m(flown, observation.field, now_s, self.horizon_s)
        if comes_near(ahead_m, self.clearance_m):
            return causes.COLLISION.name
        if self._is_nearby(flown, observation):
            return ""
        if self.goal_updated and _is_another_goal(observation):
            return causes.GOAL.name
        planned_s = now_s - (flown.start_s - trajectory.start_s)
        if self._cost is not None and self._cost.rise(observation.field, planned_s) > self.cost_rise:
            return causes.COST.name
        if is_older(trajectory, now_s, self.expiry_s):
            return causes.EXPIRED.name
        return causes.ARRIVAL.name if ends_within(flown, observation.goal, now_s, self.arrival_s) else ""

    def _is_nearby(self, flown: Trajectory, observation: Observation) -> bool:
        """Whether less than `nearby_m` of the way is left, and it leads to the target."""
        goal = observation.goal
        if goal is None or not goal.is_target or not self.nearby_m > 0.0:
            return False
        times_s = sample_times(flown, observation.time_s, _SAMPLE_S)
        return polyline_length_m(evaluate(flown, times_s)[0]) < self.nearby_m


def _is_another_goal(observation: Observation) -> bool:
    """Whether g* is not the goal flown to: any difference counts, as in Nav2."""
    flown, best = observation.goal, observation.best_goal
    if flown is None or best is None:
        return False
    return not np.array_equal(flown.position_m, best.position_m)
