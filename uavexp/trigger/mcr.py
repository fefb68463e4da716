"""Map-change-driven replanning (paper 1, §3.4): replan on a map event or a goal event.

Equation (20): a map event is some x within r_mon of the trajectory with

    |d_t(x) - d_{t-1}(x)| > delta_map

and a goal event is ||g*_t - g*_{t-1}|| > delta_g. Read literally, the first fires at most
checks while anything new is in view. §3.4 calls it a "planning validity violation" and a
"contraction of the local free-space boundary", §4.5 speaks of "accumulated structural map
variations rather than instantaneous measurements". So every part of the reading is a
parameter. `judge: region` is the equation; `judge: path` (the default) asks the same of
the trajectory's own points: the clearance there has dropped by more than delta_map since
the plan was made, to below `valid_clearance_m`, at a point reached within `horizon_s`; or
that it has dropped at all to where the body would touch.
A plan whose room has not shrunk is valid however much the map changes beside it; a change
further ahead keeps accumulating until it matters, and is then answered by one replan.
"""

from __future__ import annotations

import math
from dataclasses import field
from enum import StrEnum

import numpy as np

from uavexp import causes
from uavexp.arrays import Float, Float32, Int32
from uavexp.errors import require
from uavexp.field import DistanceField
from uavexp.map_change import MapNear, changed_near, columns_near, map_near
from uavexp.mapping.base import MapBackend
from uavexp.parameters import Count, NonNegative, Positive, option
from uavexp.trajectory import Trajectory, evaluate, sample_times
from uavexp.trigger.validity import as_flown
from uavexp.types import Decision, Goal, Limits, Observation

_SAMPLE_S = 0.05  # at 2.5 m/s about one voxel apart
_NOISE_M = 0.01  # a smaller drop is no drop


class Judge(StrEnum):
    """Where a change is judged."""

    PATH = "path"  # at the trajectory's own points
    REGION = "region"  # anywhere within the monitoring radius


class Since(StrEnum):
    """What a change is measured against."""

    PLAN = "plan"  # the field on which the plan was made
    UPDATE = "update"  # the previous ESDF update


class Extent(StrEnum):
    """Which part of the trajectory is monitored."""

    REMAINING = "remaining"
    WHOLE = "whole"


class FirstSight(StrEnum):
    """Which voxels seen for the first time count as changed."""

    NONE = "none"
    OCCUPIED = "occupied"
    ALL = "all"


class Sign(StrEnum):
    """Which changes of distance count."""

    CONTRACTION = "contraction"
    BOTH = "both"


_NO_VOXELS = np.zeros(0, dtype=np.int32)


@option
class Mcr:
    """The MCR policy; every reading of the paper is a parameter."""

    delta_map_m: Positive = 0.15  # m, map-change threshold (paper)
    delta_goal_m: Positive = 0.3  # m, goal-drift threshold (paper)
    monitor_radius_m: Positive = 2.0  # m, r_mon (paper); judge=path: only which voxels the log names;
    # <= mapping.max_distance_m
    judge: Judge = Judge.PATH  # path: the change at the trajectory's own points [ours] | region: equation
    # (20) within r_mon
    since: Since = Since.PLAN  # plan: accumulated since the plan was made (§4.5) | update:
    # between consecutive updates (eq. 20)
    goal_since: Since = Since.PLAN  # plan: g* against the goal flown to | update:
    # g* between consecutive checks (the paper's)
    extent: Extent = Extent.REMAINING  # remaining | whole trajectory
    first_sight: FirstSight = FirstSight.OCCUPIED  # judge=region, voxels first seen: none | occupied (§4.4:
    # newly observed obstacles) | all count as changed
    sign: Sign = Sign.CONTRACTION  # contraction of free space only (§3.4) | both
    min_changed_voxels: Count = 1  # judge=region: at least so many changed voxels
    valid_clearance_m: Positive = 0.4  # m, judge=path: a plan is valid while its clearance stays
    # above this [ours]
    horizon_s: Positive = 1.0  # s, judge=path: a violation counts when it is reached within this time:
    # stopping from 2.5 m/s takes 1.2 s, swerving less [ours]
    min_interval_s: NonNegative = 0.0  # s, least time between replans
    _touch_m: float = field(init=False, repr=False, default=0.0)
    _trajectory: Trajectory | None = field(init=False, repr=False, default=None)
    _at_plan: MapNear | None = field(init=False, repr=False, default=None)
    _planned_s: float = field(init=False, repr=False, default=-math.inf)
    _points_m: Float = field(init=False, repr=False, default_factory=lambda: np.zeros((0, 3)))
    _times_s: Float = field(init=False, repr=False, default_factory=lambda: np.zeros(0))
    _clearance_m: Float = field(init=False, repr=False, default_factory=lambda: np.zeros(0))
    _previous_goal: Goal | None = field(init=False, repr=False, default=None)

    def requires(self, *, mapping: MapBackend, **_: object) -> None:
        """Refuse a field truncated below the radius: it hides changes inside (paper 1)."""
        radius_m, reach_m = self.monitor_radius_m, mapping.max_distance_m
        require(
            radius_m <= reach_m,
            f"monitor_radius_m must be <= mapping.max_distance_m = {reach_m}, got {radius_m}",
        )

    def reset(self, limits: Limits) -> None:
        """Begin a trial."""
        self._touch_m = limits.body_radius_m
        self._trajectory, self._at_plan, self._previous_goal = None, None, None
        self._planned_s = -math.inf

    def planned(self, trajectory: Trajectory, field: DistanceField) -> None:
        """Keep the new plan and its clearance on the map that it was made on."""
        self._trajectory = trajectory
        self._planned_s = trajectory.start_s
        self._times_s = sample_times(trajectory, trajectory.start_s, _SAMPLE_S)
        self._points_m = evaluate(trajectory, self._times_s)[0]
        self._clearance_m = field.distance_m(self._points_m)
        if self.since is Since.PLAN:
            self._at_plan = map_near(field, columns_near(field, self._points_m, self.monitor_radius_m))

    def decide(self, observation: Observation) -> Decision:
        """Return the map event, else the goal event, else no."""
        goal_drift_m = self._goal_drift_m(observation)
        self._previous_goal = observation.best_goal
        if self._trajectory is None or observation.time_s - self._planned_s < self.min_interval_s:
            return Decision(replan=False)
        decision = (
            self._path_event(observation) if self.judge is Judge.PATH else self._region_event(observation)
        )
        if decision.replan or goal_drift_m <= self.delta_goal_m:
            return decision
        return Decision(replan=True, cause=causes.GOAL.name, score=goal_drift_m / self.delta_goal_m)

    def _goal_drift_m(self, observation: Observation) -> float:
        """Distance between g* now and the goal flown to (or g* at the previous check)."""
        before = observation.goal if self.goal_since is Since.PLAN else self._previous_goal
        if observation.best_goal is None or before is None:
            return 0.0
        return float(np.linalg.norm(observation.best_goal.position_m - before.position_m))

    def _late_s(self, observation: Observation) -> float:
        """By how much the plan is flown later than it was planned, s."""
        planned = self._trajectory
        return 0.0 if planned is None else as_flown(planned, observation).start_s - planned.start_s

    def _monitored(self, now_s: float) -> slice:
        if self.extent is Extent.WHOLE:
            return slice(None)
        return slice(int(np.searchsorted(self._times_s, now_s)), None)

    def _path_event(self, observation: Observation) -> Decision:
        """Clearance at the trajectory's points: dropped since the plan, low, and soon."""
        now_s = observation.time_s - self._late_s(observation)
        part = self._monitored(now_s)
        now_m = observation.field.distance_m(self._points_m[part])
        change_m = self._clearance_m[part] - now_m
        if self.since is Since.UPDATE:
            self._clearance_m[part] = now_m
        size_m = np.abs(change_m) if self.sign is Sign.BOTH else change_m
        soon = self._times_s[part] - now_s <= self.horizon_s
        invalid = (size_m > self.delta_map_m) & (now_m < self.valid_clearance_m)
        touching = (change_m > _NOISE_M) & (now_m < self._touch_m)
        violated = (invalid | touching) & soon
        score = float(size_m[soon].max(initial=0.0)) / self.delta_map_m
        if not violated.any():
            return Decision(replan=False, score=score)
        voxel, _ = self._changed(observation, self._points_m[part][violated])
        return Decision(replan=True, cause=causes.MAP.name, score=score, voxel=voxel)

    def _region_event(self, observation: Observation) -> Decision:
        """Equation (20) over the voxels of B(tau)."""
        part = self._monitored(observation.time_s - self._late_s(observation))
        voxel, largest_m = self._changed(observation, self._points_m[part])
        score = largest_m / self.delta_map_m
        if len(voxel) < self.min_changed_voxels:
            return Decision(replan=False, score=score)
        return Decision(replan=True, cause=causes.MAP.name, score=score, voxel=voxel)

    def _changed(self, observation: Observation, points_m: Float) -> tuple[Int32, float]:
        """Voxels within r_mon of the points that changed by more than delta_map, and the largest change."""
        if len(points_m) == 0:
            return _NO_VOXELS, 0.0
        update, now = observation.update, observation.field
        if self.since is Since.UPDATE or self._at_plan is None:
            counted = ~update.first_seen
            if self.first_sight is FirstSight.ALL:
                counted = np.ones_like(counted)
            elif self.first_sight is FirstSight.OCCUPIED:
                counted |= update.occupied
            voxel = update.voxel[counted]
            old, new = update.old_distance_m[counted], update.new_distance_m[counted]
        else:
            voxel, old, new = self._since_plan(self._at_plan, now)
        both = self.sign is Sign.BOTH
        near, largest_m = changed_near(
            voxel,
            old,
            new,
            np.array(now.distance.shape),
            now.origin_m,
            now.voxel_size_m,
            points_m,
            self.monitor_radius_m,
            self.delta_map_m,
            both,
        )
        return near, largest_m

    def _since_plan(self, then: MapNear, field: DistanceField) -> tuple[Int32, Float32, Float32]:
        """Voxels whose distance differs from that at the plan; first sights as configured."""
        now = map_near(field, then.column)
        differs = now.distance != then.distance
        if self.first_sight is not FirstSight.ALL:
            counted = then.state != 0
            if self.first_sight is FirstSight.OCCUPIED:
                counted = counted | (now.state == 2)
            differs &= counted
        at, k = np.nonzero(differs)
        voxel = (then.column[at] * differs.shape[1] + k).astype(np.int32)
        return voxel, then.distance[at, k], now.distance[at, k]
