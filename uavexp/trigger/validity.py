"""Is the trajectory still worth following? Questions that several policies ask, as pure functions.

All of them judge the trajectory as it is flown, the stop behind a plan's end included: it is
what happens if nobody replans.
"""

from __future__ import annotations

from typing import TypeGuard

import numpy as np

from uavexp.arrays import Float
from uavexp.field import UNKNOWN, DistanceField
from uavexp.trajectory import Trajectory, evaluate
from uavexp.types import Goal, Observation

_SLACK_M = 0.03  # a third of a voxel: what the map's distances are exact to
_TIME_S = 1e-9  # times are sums of steps


def is_flown(trajectory: Trajectory | None, now_s: float) -> TypeGuard[Trajectory]:
    """Whether there is a plan and it has taken effect; during its latency the one before is flown."""
    return trajectory is not None and is_older(trajectory, now_s, 0.0)


def as_flown(planned: Trajectory, observation: Observation) -> Trajectory:
    """A plan with the times at which it is flown: later than planned where the safety slows it."""
    flown = observation.trajectory
    is_it = flown is not None and flown.coefficients is planned.coefficients
    return flown if is_it and flown is not None else planned


def is_older(trajectory: Trajectory, now_s: float, age_s: float) -> bool:
    """Whether a plan took effect so long ago, or longer."""
    return now_s - trajectory.start_s >= age_s - _TIME_S


def comes_near(clearance_m: Float, limit_m: float) -> bool:
    """Whether a path comes nearer to an obstacle than the limit.

    A vehicle that is nearer already may leave: up to the first sample that keeps the limit only
    a further approach counts (as for the planner, which must accept such a start, too). FUEL
    and Fast-Planner count the way out, and replan at every check until it is over.

    Args:
        clearance_m: (N,) along the path, m, N >= 1.
        limit_m: least distance, m; 0 or less: nothing counts.
    """
    near = clearance_m < limit_m
    leaving = len(near) if near.all() else int(np.argmin(near))
    near[:leaving] = clearance_m[:leaving] < clearance_m[0] - _SLACK_M
    return limit_m > 0.0 and bool(near.any())


def ends_within(trajectory: Trajectory, goal: Goal | None, now_s: float, margin_s: float) -> bool:
    """Whether less than the margin is left until the goal, a frontier, is reached; also after that.

    FUEL's "trajectory almost fully executed" (Zhou et al. 2021). False for the mission's
    target, where the flight ends, and without a goal, when the pilot stops the vehicle.

    Args:
        trajectory: the one flown.
        goal: of that trajectory.
        now_s: trial time, s.
        margin_s: time before the goal, s.
    """
    if goal is None or goal.is_target:
        return False
    return goal_time_s(trajectory, goal.position_m) - now_s < margin_s - _TIME_S


def goal_time_s(trajectory: Trajectory, goal_m: Float) -> float:
    """When a flown trajectory is at its goal, s: where the plan ends and the stop behind it begins."""
    breaks_m = evaluate(trajectory, trajectory.breaks_s)[0]
    return float(trajectory.breaks_s[np.argmin(np.linalg.norm(breaks_m - goal_m, axis=1))])


def unknown_count(field: DistanceField, centre_m: Float, radius_m: float) -> int:
    """Number of unknown voxels whose centres lie within a ball.

    Args:
        field: the map.
        centre_m: (3,) of the ball.
        radius_m: of the ball, m.
    """
    cell = (centre_m - field.origin_m) / field.voxel_size_m - 0.5  # in voxels, centres at integers
    reach = radius_m / field.voxel_size_m
    low = np.maximum(np.ceil(cell - reach), 0).astype(int)
    high = np.minimum(np.floor(cell + reach), np.array(field.state.shape) - 1).astype(int)
    box = tuple(slice(a, max(b + 1, a)) for a, b in zip(low, high, strict=True))
    x, y, z = (np.arange(part.start, part.stop) - middle for part, middle in zip(box, cell, strict=True))
    inside = x[:, None, None] ** 2 + y[:, None] ** 2 + z**2 <= reach**2
    return int(np.count_nonzero(inside & (field.state[box] == UNKNOWN)))
