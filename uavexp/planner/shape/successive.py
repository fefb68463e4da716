"""Successive convex programming of a spline: duration, stretching, checks, ladder.

Duration: the time-optimal traversal of the path within the limits (`timing`), times a margin; taken
again from the optimised curve. If the spline cannot keep the limits in that time (it cannot jump in
acceleration), it is stretched. Clearance is checked on the result; when it fails, the next rung of a
fixed ladder makes obstacles dearer, the flight slower and the spline finer, and from a standing start
ties the curve to the path. All budgets are iterations.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple, Protocol

import numpy as np

from uavexp.arrays import Float
from uavexp.braking import REST_MPS
from uavexp.planner.constraints import Constraints
from uavexp.planner.shape.base import ShapedPath
from uavexp.planner.shape.start import SHORTEST_S, on_path, refusal, state_of
from uavexp.planner.shape.timing import STEP_M, resample, smooth, time_profile
from uavexp.trajectory import Trajectory
from uavexp.types import Limits, PlanRequest, PlanStatus

QP_SHARE = 0.99  # of the limits inside the QPs: room for their linearisation
MOST_POINTS = 40  # control points
_SMOOTHING_ROUNDS = 10  # takes the staircase out of a voxel path
_STRETCH = 1.02  # least factor by which a duration is stretched
_STRETCH_GAIN = 0.99  # stretching ends unless it takes the excess below this share
_HARD_ABOVE_VOXELS = 0.5  # the steep part of the obstacle cost begins this far above the hard limit


class Rung(NamedTuple):
    """One try of the ladder."""

    weight: float  # factor on the obstacle weight
    slower: float  # factor on the duration
    finer: float  # factor on the number of control points
    tether: float  # pull to the path: acceleration² that a deviation of 1 m is worth
    from_rest: bool  # whether it only makes sense from a standing start


LADDER = (
    Rung(1.0, 1.0, 1.0, 0.0, False),
    Rung(2.0, 1.15, 1.5, 0.0, False),
    Rung(4.0, 1.4, 1.5, 50.0, True),
    Rung(8.0, 2.0, 2.0, 400.0, True),
)


class Curve(NamedTuple):
    """A uniform spline."""

    control: Float  # (N, 3)
    h: float  # knot spacing, s


class Route(NamedTuple):
    """A request and the path found for it, prepared."""

    path: Float  # (P, 3) smoothed, STEP_M apart
    raw: Float  # (P, 3) as found, STEP_M apart
    start: Float  # (3, 3) position, velocity, acceleration
    end: Float  # (3, 3)
    bounds: Float  # (2, 3) of the flight, with the search's height band


class Effort(NamedTuple):
    """How long a curve takes, and how much is done for it."""

    duration_margin: float
    first_iterations: int
    final_iterations: int


class Model(Protocol):
    """What is minimised on one rung: a spline between fixed ends, by its local models."""

    spans: int
    retimed_from: float  # relative change of duration that is worth placing the control points anew

    def guess(self, points_m: Float, times_s: Float, duration_s: float) -> Float:
        """Control points (N, 3) along a timed polyline (P, 3), flown in this duration."""

    def pin(self, curve: Curve) -> Curve:
        """Give a curve its end states, in place."""

    def improve(self, curve: Curve, rounds: int) -> tuple[Curve, bool, int]:
        """Solve up to `rounds` QPs: the last iterate, whether the last QP was feasible, and their number."""

    def points(self, curve: Curve) -> Float:
        """Points (P, 3) along it, dense."""

    def excess(self, curve: Curve) -> float:
        """By what factor its duration is too short; <= 1 when the limits are kept."""

    def shortfall(self, curve: Curve) -> str:
        """Where it is not clear; "" when it is."""

    def trajectory(self, curve: Curve) -> Trajectory:
        """As it is flown."""


def route_of(request: PlanRequest, path_m: Float, z_band_m: float) -> Route:
    """Prepare a request with a path (P, 3) that was found for it; it ends at rest."""
    raw, start, end = resample(path_m, STEP_M), state_of(request), np.zeros((3, 3))
    end[0] = request.goal.position_m
    bounds = request.flight_bounds_m.copy()
    heights = (start[0, 2], end[0, 2])
    bounds[0, 2] = max(bounds[0, 2], min(heights) - z_band_m)
    bounds[1, 2] = min(bounds[1, 2], max(heights) + z_band_m)
    return Route(smooth(raw, _SMOOTHING_ROUNDS), raw, start, end, bounds)


def control_points(spacings: float, degree: int) -> int:
    """Number of control points, even, of a spline so many spacings long."""
    count = round(spacings) + 2 * degree
    count = min(max(count, 2 * degree + 4), MOST_POINTS)
    return count + count % 2


def hard_m(constraints: Constraints, voxel_m: float) -> float:
    """Distance below which the steep part of the obstacle cost begins."""
    return constraints.min_clearance_m + _HARD_ABOVE_VOXELS * voxel_m


def climb(route: Route, limits: Limits, effort: Effort, make: Callable[[Rung], Model]) -> ShapedPath:
    """Walk the ladder until a curve keeps the limits and the clearance."""
    reason = refusal(route.start, limits)
    failed = ShapedPath(status=PlanStatus.LIMITS, reason=reason or "no duration keeps the limits")
    if reason:
        return failed
    iterations, moving = 0, float(np.linalg.norm(route.start[1])) > REST_MPS
    for rung in LADDER:
        if rung.from_rest and moving:
            continue
        model = make(rung)
        curve, solved = _shaped(model, route, limits, effort, rung.slower)
        iterations += solved
        if curve is None:
            continue
        if not np.isfinite(curve.control).all():
            failed = ShapedPath(status=PlanStatus.SOLVER, reason="the solver returned NaN")
            continue
        reason = model.shortfall(curve)
        if not reason:
            flown = model.trajectory(curve)
            return ShapedPath(status=PlanStatus.OK, trajectory=flown, iterations=iterations)
        failed = ShapedPath(status=PlanStatus.NOT_CLEAR, reason=reason)
    return replace(failed, iterations=iterations)


def _shaped(
    model: Model, route: Route, limits: Limits, effort: Effort, slower: float
) -> tuple[Curve | None, int]:
    """A curve within the limits, or None when no stretching keeps them; and the number of QPs."""
    strongest = limits.max_acceleration_mps2
    ends = (float(np.linalg.norm(route.end[1])), limits.max_speed_mps, strongest)
    along, late_s = on_path(route.path, route.start[1], strongest)
    times = time_profile(route.path, along, *ends)
    curve = _placed(model, route.path, times, (float(times[-1]) + late_s) * effort.duration_margin * slower)
    curve, _, solved = model.improve(curve, effort.first_iterations)
    points = resample(model.points(curve), STEP_M)
    if not np.isfinite(points).all():
        return curve, solved
    times = time_profile(points, float(np.linalg.norm(route.start[1])), *ends)
    placed = _placed(model, points, times, float(times[-1]) * effort.duration_margin * slower)
    if abs(placed.h / curve.h - 1.0) >= model.retimed_from:
        curve = placed
    worst = math.inf
    while True:
        better, feasible, more = model.improve(curve, effort.final_iterations)
        solved += more
        excess = model.excess(better)
        if feasible and excess <= 1.0:
            return better, solved
        if excess > _STRETCH_GAIN * worst or not math.isfinite(excess):
            return None, solved
        worst = excess
        curve = model.pin(Curve(better.control, max(_STRETCH, min(excess, 1.5)) * better.h))


def _placed(model: Model, points_m: Float, times_s: Float, wanted_s: float) -> Curve:
    """First guess along a timed polyline (P, 3)."""
    duration_s = max(wanted_s, SHORTEST_S)
    return model.pin(Curve(model.guess(points_m, times_s, duration_s), duration_s / model.spans))
