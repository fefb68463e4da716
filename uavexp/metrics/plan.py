"""The first plan of a flight, as planned: its length, limits and clearance, whatever was flown.

A limit is checked on a grid of 1 ms over the whole trajectory. A violation is one unbroken
stretch of it on which a norm exceeds its limit (‖v‖ <= v_max, ‖a‖ <= a_max) by more than a
millionth; paper 4 counts "violations" and does not say of what [ours].
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from uavexp.arrays import Bool, Float
from uavexp.geometry import polyline_length_m
from uavexp.log import TrialLog
from uavexp.metrics import voxel_path
from uavexp.metrics.metric import Flight, Measure, Metric, Metrics
from uavexp.trajectory import Trajectory, evaluate
from uavexp.types import PlanStatus

GRID_S = 1e-3
CHECKPOINTS = tuple(n * 10**k for k in range(5) for n in (10, 15, 20, 30, 50, 70))  # iterations
SWING_M = 0.1  # of height; less is no climb: the ends lie off their voxels' centres [ours]
_EXCESS = 1.0 + 1e-6
_NO_PLAN = "there was no plan"


@dataclass(frozen=True, slots=True, kw_only=True)
class Sampled:
    """The first plan on the grid (S,) of times."""

    log: TrialLog
    duration_s: float
    position_m: Float  # (S, 3)
    speed_mps: Float  # (S,)
    acceleration_mps2: Float  # (S,) its size
    clearance_m: Float  # (S,) true, of the body's centre to fixed surfaces

    @property
    def path_m(self) -> Float:
        """The path (P, 3) that was searched first."""
        return self.log.first_plan.path_m


def planned(log: TrialLog) -> Trajectory | None:
    """The first plan's trajectory; None when there was none."""
    plan = log.first_plan
    if not plan.breaks_s.size:
        return None
    return Trajectory(breaks_s=plan.breaks_s, coefficients=plan.coefficients, at_rest=True)


@lru_cache(maxsize=1)
def sampled(flight: Flight) -> Sampled | None:
    """The first plan of a flight on the grid; None when there was none."""
    trajectory = planned(flight.log)
    if trajectory is None:
        return None
    from uavexp.scene import Scene  # Open3D takes seconds to load, and whoever reads a log needs none

    count = int(np.ceil(trajectory.duration_s / GRID_S)) + 1
    times_s = np.linspace(trajectory.start_s, trajectory.end_s, count)
    position_m, velocity_mps, acceleration_mps2 = evaluate(trajectory, times_s)
    return Sampled(
        log=flight.log,
        duration_s=trajectory.duration_s,
        position_m=position_m,
        speed_mps=np.linalg.norm(velocity_mps, axis=1),
        acceleration_mps2=np.linalg.norm(acceleration_mps2, axis=1),
        clearance_m=Scene(flight.world).fixed_clearance_m(position_m),
    )


def limit_violations(plan: Sampled) -> int:
    """Stretches on which speed or acceleration exceed what plans have to keep."""
    limits = plan.log.limits
    fast = plan.speed_mps > _EXCESS * limits.max_speed_mps
    return stretches(fast | (plan.acceleration_mps2 > _EXCESS * limits.max_acceleration_mps2))


def cost_at(log: TrialLog, at: int) -> float | None:
    """Cost of the best plan after so many iterations; None for a planner that keeps no history.

    NaN where there was no plan yet; after the search's end its last.
    """
    if not len(log.first_plan.history):
        return None
    iteration, cost = log.first_plan.history.T
    known = int(np.searchsorted(iteration, at, side="right"))
    return float(cost[known - 1]) if known else math.nan


def stretches(flags: Bool) -> int:
    """Number of unbroken runs of True in flags (N,)."""
    return int(np.count_nonzero(np.diff(flags.astype(np.int8), prepend=0) == 1))


def _of(figure: Callable[[Sampled], float]) -> Measure:
    """A figure of the first plan; NaN when there was none."""

    def measure(flight: Flight) -> float:
        plan = sampled(flight)
        return math.nan if plan is None else float(figure(plan))

    return measure


def _cost_at(at: int) -> Measure:
    return lambda flight: cost_at(flight.log, at)


def _metric(column: str, title: str, unit: str = "", digits: int = 2, better: int = 0) -> Metric:
    return Metric(column=column, title=title, unit=unit, digits=digits, better=better, missing=_NO_PLAN)


METRICS: Metrics = {
    _metric("plan_path_length_m", "Length of the searched path", "m", better=-1): _of(
        lambda plan: polyline_length_m(plan.path_m)
    ),
    _metric("plan_length_m", "Length of the plan", "m", better=-1): _of(
        lambda plan: polyline_length_m(plan.position_m)
    ),
    _metric("plan_duration_s", "Duration of the plan", "s", better=-1): _of(lambda plan: plan.duration_s),
    _metric("plan_max_speed_mps", "Max. planned speed", "m/s"): _of(lambda plan: plan.speed_mps.max()),
    _metric("plan_max_acceleration_mps2", "Max. planned acceleration", "m/s²"): _of(
        lambda plan: plan.acceleration_mps2.max()
    ),
    _metric("limit_violations", "Limit violations of the plan", better=-1): _of(limit_violations),
    _metric("plan_min_clearance_m", "Least true clearance of the plan", "m", better=1): _of(
        lambda plan: plan.clearance_m.min()
    ),
    # stretches on which the body's circle does not fit
    _metric("plan_collisions", "Collisions of the plan", better=-1): _of(
        lambda plan: stretches(plan.clearance_m < plan.log.limits.body_radius_m)
    ),
    _metric("plan_collision_checks", "Collision checks", digits=0, better=-1): _of(
        lambda plan: plan.log.first_plan.collision_checks
    ),
    # of the search: nodes expanded, edges taken, samples
    _metric("plan_iterations", "Iterations", digits=0): _of(
        lambda plan: next(
            (one.expansions for one in plan.log.replans if one.status is PlanStatus.OK), math.nan
        )
    ),
    _metric("plan_path_height_reversals", "Reversals of height", better=-1): _of(
        lambda plan: voxel_path.height_reversals(plan.path_m, SWING_M)
    ),
    _metric("plan_path_excess_climb_m", "Height gained and lost for nothing", "m", better=-1): _of(
        lambda plan: voxel_path.excess_climb(plan.path_m)
    ),
    _metric("plan_path_heading_change_deg", "Heading change, summed", "°", digits=0, better=-1): _of(
        lambda plan: np.degrees(voxel_path.cumulative_heading_change_rad(plan.path_m))
    ),
    _metric("plan_path_mean_heading_change_deg", "Heading change, mean of turns", "°", 1, better=-1): _of(
        lambda plan: np.degrees(voxel_path.mean_heading_change_rad(plan.path_m))
    ),
    **{
        Metric(
            column=f"plan_cost_at_{at}",
            title=f"Cost after {at} iterations",
            better=-1,
            missing="there was no plan yet",
        ): _cost_at(at)
        for at in CHECKPOINTS
    },
}
