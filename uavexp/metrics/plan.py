"""The first plan of a flight, as planned: its length, limits and clearance, whatever was flown.

A limit is checked on a grid of 1 ms over the whole trajectory. A violation is one unbroken
stretch of it on which a norm exceeds its limit (‖v‖ <= v_max, ‖a‖ <= a_max) by more than a
millionth; paper 4 counts "violations" and does not say of what [ours].
"""

from __future__ import annotations

import numpy as np

from uavexp.arrays import Bool, Float
from uavexp.geometry import polyline_length_m
from uavexp.log import TrialLog
from uavexp.metrics import voxel_path
from uavexp.scene import Scene
from uavexp.trajectory import Trajectory, evaluate
from uavexp.types import World

GRID_S = 1e-3
CHECKPOINTS = tuple(n * 10**k for k in range(5) for n in (10, 15, 20, 30, 50, 70))  # iterations
SWING_M = 0.1  # of height; less is no climb: the ends lie off their voxels' centres [ours]
_EXCESS = 1.0 + 1e-6


def planned(log: TrialLog) -> Trajectory | None:
    """The first plan's trajectory; None when there was none."""
    plan = log.first_plan
    if not plan.breaks_s.size:
        return None
    return Trajectory(breaks_s=plan.breaks_s, coefficients=plan.coefficients, at_rest=True)


def measures(log: TrialLog, world: World) -> dict[str, float]:
    """Figures of the first plan, by name; every one is NaN when there was none."""
    trajectory = planned(log)
    if trajectory is None:
        return dict.fromkeys(_NAMES, float("nan"))
    path_m = log.first_plan.path_m
    count = int(np.ceil(trajectory.duration_s / GRID_S)) + 1
    times_s = np.linspace(trajectory.start_s, trajectory.end_s, count)
    position_m, velocity_mps, acceleration_mps2 = evaluate(trajectory, times_s)
    speed_mps = np.linalg.norm(velocity_mps, axis=1)
    size_mps2 = np.linalg.norm(acceleration_mps2, axis=1)
    clearance_m = Scene(world).fixed_distance_m(position_m)
    fast = speed_mps > _EXCESS * log.limits.max_speed_mps
    over = fast | (size_mps2 > _EXCESS * log.limits.max_acceleration_mps2)
    values = (
        polyline_length_m(path_m),
        polyline_length_m(position_m),
        trajectory.duration_s,
        float(speed_mps.max()),
        float(size_mps2.max()),
        float(stretches(over)),
        float(clearance_m.min()),
        float(stretches(clearance_m < log.limits.body_radius_m)),
        float(log.first_plan.collision_checks),
        float(log.replans[0].expansions) if log.replans else float("nan"),
        float(voxel_path.height_reversals(path_m, SWING_M)),
        voxel_path.excess_climb(path_m),
        float(np.degrees(voxel_path.cumulative_heading_change_rad(path_m))),
        float(np.degrees(voxel_path.mean_heading_change_rad(path_m))),
    )
    return dict(zip(_NAMES, values, strict=True))


_NAMES = (
    "plan_path_length_m",
    "plan_length_m",
    "plan_duration_s",
    "plan_max_speed_mps",
    "plan_max_acceleration_mps2",
    "limit_violations",
    "plan_min_clearance_m",  # true, of the body's centre to fixed surfaces
    "plan_collisions",  # stretches on which that is less than the body's radius
    "plan_collision_checks",
    "plan_iterations",  # of the search: nodes expanded, edges taken, samples
    "plan_path_height_reversals",  # of the searched path (`voxel_path`)
    "plan_path_excess_climb_m",
    "plan_path_heading_change_deg",  # summed
    "plan_path_mean_heading_change_deg",  # of the places where it changes
)


def costs(log: TrialLog) -> dict[str, float]:
    """Cost of the best plan after so many iterations; none for a planner that keeps no history.

    NaN where there was no plan yet; after the search's end its last.
    """
    if not len(log.first_plan.history):
        return {}
    iteration, cost = log.first_plan.history.T
    return {f"plan_cost_at_{at}": _cost_at(iteration, cost, at) for at in CHECKPOINTS}


def _cost_at(iteration: Float, cost: Float, at: int) -> float:
    known = int(np.searchsorted(iteration, at, side="right"))
    return float(cost[known - 1]) if known else float("nan")


def stretches(flags: Bool) -> int:
    """Number of unbroken runs of True in flags (N,)."""
    return int(np.count_nonzero(np.diff(flags.astype(np.int8), prepend=0) == 1))
