"""What is kept of a planning request: the row of `replans` that metrics and figures read."""

from __future__ import annotations

import math

import numpy as np

from uavexp.arrays import Float
from uavexp.log import Replan
from uavexp.map_change import changed_near
from uavexp.trajectory import Trajectory, evaluate, sample_times
from uavexp.types import Decision, Goal, Observation, PlanResult, PlanStatus

_NEAR_M, _CHANGED_M = 2.0, 0.15  # r_mon and delta_map of paper 1
NO_GOAL = PlanResult(status=PlanStatus.NO_PATH, reason="no goal is reachable")
_SAMPLE_S = 0.1  # spacing of the samples kept of a trajectory
_AT_ONCE = 256


def replan_of(
    decision: Decision, observation: Observation, goal: Goal, result: PlanResult, flown: Trajectory | None
) -> Replan:
    """One planning request, its answer, and how far the new path lies from the one being flown."""
    new_m = np.zeros((0, 3))
    change_m, effective_s = math.nan, math.nan
    if result.trajectory is not None:
        effective_s = result.trajectory.start_s
        new_m = _samples(result.trajectory, effective_s)
        if flown is not None:
            change_m = _path_change_m(_samples(flown, effective_s), new_m)
    return Replan(
        time_s=observation.time_s,
        effective_s=effective_s,
        cause=decision.cause,
        score=decision.score,
        position_m=observation.state.position_m,
        goal_m=goal.position_m,
        status=result.status,
        reason=result.reason,
        path_change_m=change_m,
        iterations=result.iterations,
        expansions=result.expansions,
        near_change=_near_change(observation),
        changed_m=observation.field.voxel_centres_m(decision.voxel).astype(np.float32),
        trajectory_m=new_m.astype(np.float32),
    )


def here(observation: Observation) -> Goal:
    """The place of the vehicle, for requests that have no goal."""
    return Goal(position_m=observation.state.position_m, is_target=False, score=-math.inf)


def target_of(observation: Observation) -> Goal | None:
    """The mission's target, whatever the explorer says of it; None without one."""
    target_m = observation.target_m
    return None if target_m is None else Goal(position_m=target_m, is_target=True, score=-math.inf)


def error_of(observation: Observation) -> float:
    """Tracking error, m."""
    return float(np.linalg.norm(observation.reference.position_m - observation.state.position_m))


def _near_change(observation: Observation) -> bool:
    """Whether this update brought obstacles nearer, by more than delta_map, within r_mon of vehicle or path.

    Asked alike of every policy's replans: how many lie near a structural change.
    """
    update, field_ = observation.update, observation.field
    counted = ~update.first_seen | update.occupied
    points_m = observation.state.position_m[None]
    if observation.trajectory is not None:
        points_m = np.concatenate([points_m, _samples(observation.trajectory, observation.time_s)])
    voxel, _ = changed_near(
        update.voxel[counted],
        update.old_distance_m[counted],
        update.new_distance_m[counted],
        np.array(field_.distance.shape),
        field_.origin_m,
        field_.voxel_size_m,
        points_m,
        _NEAR_M,
        _CHANGED_M,
        False,
    )
    return len(voxel) > 0


def _samples(trajectory: Trajectory, from_s: float) -> Float:
    return evaluate(trajectory, sample_times(trajectory, from_s, _SAMPLE_S))[0]


def _path_change_m(old_m: Float, new_m: Float) -> float:
    """Largest distance of a point of the old path from the new path (one-sided Hausdorff)."""
    parts = np.array_split(old_m, math.ceil(len(old_m) / _AT_ONCE))  # a slow plan has thousands of samples
    return max(float(np.linalg.norm(part[:, None] - new_m[None], axis=2).min(axis=1).max()) for part in parts)
