"""What a path costs on a costmap as Nav2 makes it, and by how much that has risen since it was planned.

A place costs NavFn's neutral 50 and 0.8 times the inflation layer's 252 exp(-3 (d - r)), d the mapped
distance and r the body's radius; in neutral costs, and nothing beyond the inflation radius of 0.7 m:

    c(d) = 1 + 4.03 exp(-3 (d - r))

Source: Nav2's defaults (Macenski et al. 2020), "IsPathValid Improvement: Change in Cost" (its issue 2880).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavexp.arrays import Float
from uavexp.field import DistanceField
from uavexp.trajectory import Trajectory, evaluate, sample_times

_SAMPLE_S = 0.05  # at 2.5 m/s about one voxel apart
_INFLATED = 0.8 * 252.0 / 50.0
_SCALING_PER_M = 3.0
_RADIUS_M = 0.7


def place_cost(clearance_m: Float, body_radius_m: float) -> Float:
    """Cost (N,) of places with these mapped distances (N,), m; 1 far from everything."""
    near_m = np.maximum(clearance_m - body_radius_m, 0.0)
    return np.where(clearance_m < _RADIUS_M, 1.0 + _INFLATED * np.exp(-_SCALING_PER_M * near_m), 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class PathCost:
    """A plan with what each place of it cost when it was made."""

    times_s: Float  # (N,)
    point_m: Float  # (N, 3)
    cost: Float  # (N,)
    body_radius_m: float

    @classmethod
    def of(cls, planned: Trajectory, field: DistanceField, body_radius_m: float) -> PathCost:
        """Of a new plan."""
        times_s = sample_times(planned, planned.start_s, _SAMPLE_S)
        point_m = evaluate(planned, times_s)[0]
        cost = place_cost(field.distance_m(point_m), body_radius_m)
        return cls(times_s=times_s, point_m=point_m, cost=cost, body_radius_m=body_radius_m)

    def rise(self, field: DistanceField, from_s: float) -> float:
        """Share by which what is left of the plan from this time of it on costs more now than then."""
        left = slice(int(np.searchsorted(self.times_s, from_s)), None)
        if not len(self.cost[left]):
            return 0.0
        now = place_cost(field.distance_m(self.point_m[left]), self.body_radius_m)
        return float(now.sum() / self.cost[left].sum()) - 1.0
