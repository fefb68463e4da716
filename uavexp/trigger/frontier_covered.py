"""Replanning when the frontier flown to has been seen: FUEL's state machine (Zhou et al. 2021).

FUEL replans on any of four events; each is a parameter here and can be switched off:

- collision: the rest of the trajectory meets a mapped obstacle (its safety timer);
- arrival: less than `arrival_s` of the trajectory is left (its `thresh_replan1`, 0.5 s);
- covered: after `min_age_s` (`thresh_replan2`, 0.5 s), a share of what made the goal worth
  flying to has been seen meanwhile (`min_view_finish_fraction`, 0.2);
- clock: the plan is `period_s` old (`thresh_replan3`, 1.5 s).

FUEL counts the cells of every frontier cluster that are frontier no longer; here it is the
unknown voxels within `neighbourhood_m` of the goal flown to, the information that the
explorer scored it by [ours]. The same test with the period switched off is the "gain has
gone" rule of next-best-view planners (Bircher et al. 2016).
"""

from __future__ import annotations

from dataclasses import field, replace

from uavexp import causes
from uavexp.field import DistanceField
from uavexp.parameters import NonNegative, Positive, PositiveShare, option
from uavexp.path_clearance import clearance_ahead_m
from uavexp.trajectory import Trajectory
from uavexp.trigger.validity import as_flown, comes_near, ends_within, is_flown, is_older, unknown_count
from uavexp.types import Decision, Limits, Observation


@option
class FrontierCovered:
    """Replans when the frontier is covered, on a collision ahead, on arrival, and by the clock."""

    covered_share: PositiveShare = 0.2  # 1, replan when more than this share of the unknown around the goal
    # has been seen since the plan (FUEL's min_view_finish_fraction); 1: never
    neighbourhood_m: Positive = 1.0  # m, radius around the goal; that of J_info in explorer=frontier [ours]
    min_age_s: NonNegative = 0.5  # s, a younger plan is not given up for being covered
    # (FUEL's thresh_replan2)
    period_s: NonNegative = 1.5  # s, a plan that old is replaced anyway (FUEL's thresh_replan3); 0: never
    clearance_m: NonNegative = 0.23  # m, least mapped distance ahead (FUEL inflates by its radius):
    # the body's circle is 0.226 m [ours]; 0: no collision check
    horizon_s: Positive = 10.0  # s, the collision check looks so far ahead: in practice the whole trajectory
    arrival_s: Positive = 0.5  # s, replan so long before a frontier is reached (FUEL's thresh_replan1)
    _trajectory: Trajectory | None = field(init=False, repr=False, default=None)
    _at_plan: DistanceField | None = field(init=False, repr=False, default=None)

    def reset(self, limits: Limits) -> None:
        """Begin a trial."""
        self._trajectory, self._at_plan = None, None

    def planned(self, trajectory: Trajectory, field: DistanceField) -> None:
        """Keep what was known when the plan was made."""
        self._trajectory, self._at_plan = trajectory, replace(field, state=field.state.copy())

    def decide(self, observation: Observation) -> Decision:
        """Replan on the first of collision, arrival, cover and clock that holds."""
        if not is_flown(self._trajectory, observation.time_s):
            return Decision(replan=False)
        score = self._covered_share(observation) / self.covered_share
        cause = self._cause(self._trajectory, observation, score)
        return Decision(replan=cause != "", cause=cause, score=score)

    def _cause(self, trajectory: Trajectory, observation: Observation, score: float) -> str:
        now_s, flown = observation.time_s, as_flown(trajectory, observation)
        ahead_m = clearance_ahead_m(flown, observation.field, now_s, self.horizon_s)
        if comes_near(ahead_m, self.clearance_m):
            return causes.COLLISION.name
        if ends_within(flown, observation.goal, now_s, self.arrival_s):
            return causes.ARRIVAL.name
        if score > 1.0 and is_older(trajectory, now_s, self.min_age_s):
            return causes.COVERED.name
        aged = self.period_s > 0.0 and is_older(trajectory, now_s, self.period_s)
        return causes.CLOCK.name if aged else ""

    def _covered_share(self, observation: Observation) -> float:
        """Share of what was unknown around the frontier at the plan that has been seen since."""
        goal = observation.goal
        if self._at_plan is None or goal is None or goal.is_target:  # the target is no frontier
            return 0.0
        before = unknown_count(self._at_plan, goal.position_m, self.neighbourhood_m)
        now = unknown_count(observation.field, goal.position_m, self.neighbourhood_m)
        return 1.0 - now / before if before else 0.0
