"""What the sampling-based planners share: which requests are hopeless, and from a path to a plan.

All of them are given the same free space (`free_space`), and what they find is made a trajectory by
the same smoother and with it the same time law, so that a comparison is one of searches.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uavexp.arrays import Float
from uavexp.errors import require
from uavexp.planner.find.free_space import FreeSpace, free_space
from uavexp.planner.shape.base import Smoother, SmoothResult
from uavexp.trajectory import Trajectory
from uavexp.types import Limits, PlanRequest, PlanResult, PlanStatus

START_EXCESS = 1.1  # a start beyond the speed limit by more than this factor is refused


def require_whole(**values: int) -> None:
    """Raise `ConfigError` unless every value is a whole number >= 0."""
    for name, value in values.items():
        whole = isinstance(value, int) and not isinstance(value, bool)
        require(whole and value >= 0, f"{name} must be a whole number >= 0, got {value!r}")


def require_known_or_not(unknown: str) -> None:
    """Raise `ConfigError` unless it says how unknown space is treated."""
    require(
        unknown in ("optimistic", "conservative"),
        f"unknown must be optimistic or conservative, got {unknown!r}",
    )


class Refusal(NamedTuple):
    """Why a request is hopeless before any search."""

    status: PlanStatus
    reason: str


class FoundWay(NamedTuple):
    """What a search found, and what it took."""

    path: Float  # (P, 3) from start to goal; empty: nothing
    times: Float | None  # (P,) s from the start, where the search has them
    history: Float  # (K, 2) iteration and best cost
    iterations: int
    checks: int
    reason: str = ""
    pieces: tuple[Float, Float] | None = None  # breaks and coefficients of a motion to be taken as it is
    tree: Float = np.zeros((0, 2, 3))  # (E, 2, 3) edges of the search's tree


def space_of(request: PlanRequest, min_clearance_m: float, z_band_m: float, known_only: bool) -> FreeSpace:
    """Free space of a request."""
    ends = np.stack([request.position_m, request.goal.position_m])
    return free_space(request.field, ends, request.flight_bounds_m, min_clearance_m, z_band_m, known_only)


def refusal(request: PlanRequest, limits: Limits, min_clearance_m: float, known_only: bool) -> Refusal | None:
    """Why no search can help, or None.

    Args:
        request: what is asked.
        limits: of the vehicle.
        min_clearance_m: least mapped distance of the body centre.
        known_only: whether unknown space is closed.
    """
    goal_m, bounds = request.goal.position_m, request.flight_bounds_m
    numbers = (request.position_m, request.velocity_mps, request.acceleration_mps2, goal_m)
    if not all(np.isfinite(part).all() for part in numbers):
        return Refusal(PlanStatus.SOLVER, "start or goal is not finite")
    if not (limits.max_speed_mps > 0.0 and limits.max_acceleration_mps2 > 0.0):
        return Refusal(
            PlanStatus.LIMITS,
            f"limits of {limits.max_speed_mps:g} m/s and {limits.max_acceleration_mps2:g} m/s²",
        )
    speed = float(np.linalg.norm(request.velocity_mps))
    if speed > START_EXCESS * limits.max_speed_mps:
        return Refusal(PlanStatus.LIMITS, f"the start has {speed:.2f} m/s")
    here, there = request.field.distance_m(np.stack([request.position_m, goal_m]))
    if here <= 0.0:
        return Refusal(PlanStatus.START_BLOCKED, f"the start lies {-here:.2f} m inside an obstacle")
    if there < min_clearance_m or np.any(goal_m < bounds[0]) or np.any(goal_m > bounds[1]):
        return Refusal(PlanStatus.GOAL_BLOCKED, f"the goal's clearance is {there:.2f} m, or it is outside")
    if known_only and not request.field.observed(goal_m[None])[0]:
        return Refusal(PlanStatus.GOAL_BLOCKED, "the goal's voxel is unknown")
    return None


def finish(
    request: PlanRequest,
    found: FoundWay,
    smoother: Smoother,
    limits: Limits,
    min_clearance_m: float,
    known_only: bool,
    began_s: float,
) -> PlanResult:
    """Plan made of what a search found.

    Args:
        request: what was asked.
        found: by the search.
        smoother: makes it a trajectory.
        limits: of the vehicle.
        min_clearance_m: as the search kept it.
        known_only: whether unknown space is closed.
        began_s: clock at which the search began.
    """
    searched_s = time.perf_counter()
    failed = PlanResult(
        status=PlanStatus.NO_PATH,
        path_m=found.path,
        reason=found.reason,
        expansions=found.iterations,
        collision_checks=found.checks,
        history=found.history,
        tree_m=found.tree,
        wall_search_s=searched_s - began_s,
    )
    if len(found.path) == 0:
        return failed
    smoothed = _smooth(request, found, smoother, limits, min_clearance_m, known_only)
    return replace(
        failed,
        status=smoothed.status,
        trajectory=smoothed.trajectory,
        reason=smoothed.reason or found.reason,
        iterations=smoothed.iterations,
        wall_optimise_s=time.perf_counter() - searched_s,
    )


def _smooth(
    request: PlanRequest,
    found: FoundWay,
    smoother: Smoother,
    limits: Limits,
    min_clearance_m: float,
    known_only: bool,
) -> SmoothResult:
    """The motion as it was found, if that is wanted, else smoothed."""
    if found.pieces is None:
        return smoother.smooth(request, found.path, found.times, limits, min_clearance_m, known_only)
    breaks, coefficients = found.pieces
    motion = Trajectory(breaks_s=request.time_s + breaks, coefficients=coefficients, at_rest=True)
    return SmoothResult(status=PlanStatus.OK, trajectory=motion)
