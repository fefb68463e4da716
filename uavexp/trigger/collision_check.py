"""Replanning on a collision check: when what is left of the trajectory meets a mapped obstacle.

The safety check of Fast-Planner (Zhou et al. 2019, everything within 6 m), FUEL and
EGO-Planner (Zhou et al. 2021, the first two thirds of a local trajectory): sample the
trajectory on the inflated map of this moment. Unlike `mcr` it remembers nothing of the
clearance that the plan was made with.
"""

from __future__ import annotations

from dataclasses import field

from uavexp import causes
from uavexp.field import DistanceField
from uavexp.parameters import Positive, option
from uavexp.path_clearance import clearance_ahead_m
from uavexp.trajectory import Trajectory
from uavexp.trigger.validity import as_flown, comes_near, ends_within, is_flown
from uavexp.types import Decision, Limits, Observation


@option
class CollisionCheck:
    """Replans when the path within `horizon_s` is nearer than `clearance_m`, and before a frontier."""

    clearance_m: Positive = 0.23  # m, least mapped distance ahead: the body's circle is 0.226 m;
    # must stay below planner.min_clearance_m [ours]
    horizon_s: Positive = 10.0  # s, looks so far ahead: in practice the whole trajectory, as FUEL and Nav2 do
    arrival_s: Positive = 0.5  # s, also replan so long before a frontier is reached (FUEL's thresh_replan1)
    _trajectory: Trajectory | None = field(init=False, repr=False, default=None)

    def reset(self, limits: Limits) -> None:
        """Begin a trial."""
        self._trajectory = None

    def planned(self, trajectory: Trajectory, field: DistanceField) -> None:
        """Watch the new plan."""
        self._trajectory = trajectory

    def decide(self, observation: Observation) -> Decision:
        """Replan on a collision ahead, or on arrival."""
        trajectory, now_s = self._trajectory, observation.time_s
        if not is_flown(trajectory, now_s):
            return Decision(replan=False)
        trajectory = as_flown(trajectory, observation)
        ahead_m = clearance_ahead_m(trajectory, observation.field, now_s, self.horizon_s)
        if comes_near(ahead_m, self.clearance_m):
            return Decision(replan=True, cause=causes.COLLISION.name)
        arrival = ends_within(trajectory, observation.goal, now_s, self.arrival_s)
        return Decision(replan=arrival, cause=causes.ARRIVAL.name if arrival else "")
