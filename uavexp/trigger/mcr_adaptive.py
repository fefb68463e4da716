"""Map-change-driven replanning whose thresholds adapt: the future work of paper 1 (§5) [ours].

A map event is, as in `mcr`, a place of the plan that is reached within the horizon and has lost more than
delta_map of the clearance it was planned with. Both follow from what flies and what is seen; no threshold is
a length or a time fixed for one kind of world:

    horizon      T = v / a_max + dt                  the time to stop from the speed now, and to answer
    visibility   s = min(1, t_seen / T)              t_seen: time until the plan enters what was never seen
    change       c = share of the places within T whose clearance the latest updates took away
    delta_map(x) = delta_share s (1 - c / 2) (d_plan(x) - r)

so a plan with much room may lose much and one through a door little; less where the vehicle flies out of
what it sees, and less while walls are still growing beside the way. v is the speed now, a_max the
vehicle's, dt the time between two checks, r the body's radius, d_plan(x) the clearance that the plan was
made with, at most `safe_clearance_m`: more is of no use to a planner. A goal event is another goal than
the flown one by more than the path that is flown during dt.
"""

from __future__ import annotations

from dataclasses import field

import numpy as np

from uavexp import causes
from uavexp.arrays import Float
from uavexp.field import DistanceField
from uavexp.parameters import Positive, PositiveShare, option
from uavexp.trajectory import Trajectory, evaluate, sample_times
from uavexp.trigger.validity import as_flown
from uavexp.types import Decision, Limits, Observation

_SAMPLE_S = 0.05  # at 2.5 m/s about one voxel apart
_NOISE_M = 0.01  # a smaller drop is no drop
_MEMORY = 0.5  # share of the recent change that is remembered from one check to the next


@option
class McrAdaptive:
    """MCR with thresholds from speed, visibility and recent change."""

    delta_share: PositiveShare = 0.5  # 1, share of its room over the body that a plan may lose at best
    safe_clearance_m: Positive = 0.75  # m, more is no more room; as planner.safe_clearance_m
    _limits: Limits | None = field(init=False, repr=False, default=None)
    _trajectory: Trajectory | None = field(init=False, repr=False, default=None)
    _times_s: Float = field(init=False, repr=False, default_factory=lambda: np.zeros(0))
    _points_m: Float = field(init=False, repr=False, default_factory=lambda: np.zeros((0, 3)))
    _planned_m: Float = field(init=False, repr=False, default_factory=lambda: np.zeros(0))
    _latest_m: Float = field(init=False, repr=False, default_factory=lambda: np.zeros(0))
    _change: float = field(init=False, repr=False, default=0.0)
    _checked_s: float | None = field(init=False, repr=False, default=None)

    def reset(self, limits: Limits) -> None:
        """Begin a trial."""
        self._limits, self._trajectory, self._checked_s, self._change = limits, None, None, 0.0

    def planned(self, trajectory: Trajectory, field: DistanceField) -> None:
        """Keep the new plan and its clearance on the map that it was made on."""
        self._trajectory = trajectory
        self._times_s = sample_times(trajectory, trajectory.start_s, _SAMPLE_S)
        self._points_m = evaluate(trajectory, self._times_s)[0]
        self._planned_m = field.distance_m(self._points_m)
        self._latest_m = self._planned_m.copy()

    def decide(self, observation: Observation) -> Decision:
        """Return the map event, else the goal event, else no."""
        checked_s, self._checked_s = self._checked_s, observation.time_s
        if self._trajectory is None or self._limits is None:
            return Decision(replan=False)
        between_s = 0.0 if checked_s is None else observation.time_s - checked_s
        speed_mps = float(np.linalg.norm(observation.reference.velocity_mps))
        horizon_s = speed_mps / self._limits.max_acceleration_mps2 + between_s
        score = self._map_score(observation, self._trajectory, self._limits.body_radius_m, horizon_s)
        if score > 1.0:
            return Decision(replan=True, cause=causes.MAP.name, score=score)
        drifts = _drift_m(observation) > self._limits.max_speed_mps * max(between_s, _SAMPLE_S)
        return Decision(replan=drifts, cause=causes.GOAL.name if drifts else "", score=score)

    def _map_score(
        self, observation: Observation, planned: Trajectory, radius_m: float, horizon_s: float
    ) -> float:
        """Largest loss of clearance within the horizon over what may be lost there."""
        now_s = observation.time_s - (as_flown(planned, observation).start_s - planned.start_s)
        first = int(np.searchsorted(self._times_s, now_s))
        now_m = observation.field.distance_m(self._points_m[first:])
        soon = self._times_s[first:] - now_s <= horizon_s
        took = (self._latest_m[first:] - now_m > _NOISE_M)[soon]
        self._change = max(_MEMORY * self._change, float(took.mean()) if took.size else 0.0)
        self._latest_m[first:] = now_m
        room_m = np.minimum(self._planned_m[first:], self.safe_clearance_m) - radius_m
        seen = observation.field.observed(self._points_m[first:])
        visible_s = np.inf if seen.all() else float(self._times_s[first:][~seen][0] - now_s)
        sight = min(1.0, visible_s / horizon_s) if horizon_s > 0.0 else 1.0
        may_lose_m = self.delta_share * sight * (1.0 - 0.5 * self._change) * np.maximum(room_m, 0.0)
        lost_m = np.minimum(self._planned_m[first:], self.safe_clearance_m) - now_m
        return float((lost_m / np.maximum(may_lose_m, _NOISE_M))[soon].max(initial=0.0))


def _drift_m(observation: Observation) -> float:
    """Distance of the explorer's goal now from the one flown to."""
    best, flown = observation.best_goal, observation.goal
    return 0.0 if best is None or flown is None else float(np.linalg.norm(best.position_m - flown.position_m))
