"""From an A* path to a trajectory: duration, sequential convex programming, checks, ladder."""

from __future__ import annotations

import math
from typing import NamedTuple

import daqp
import numpy as np

from uavexp.arrays import Float
from uavexp.field import DistanceField
from uavexp.planner.clearance import shortfall
from uavexp.planner.movers.moving import MovingObstacles
from uavexp.planner.shape.scp import limit_rows, line_search, quadratic_model
from uavexp.planner.shape.timing import STEP_M, place_by_time, resample, smooth, time_profile
from uavexp.planner.spline.cubic import (
    SAMPLES,
    SplineModel,
    peak_acceleration,
    peak_speed,
    pin_ends,
    sample_spline,
    spline_model,
)
from uavexp.types import PlanRequest, PlanStatus, Tracks

CONTROL_POINTS = range(10, 41, 2)  # the numbers that are used
_SMOOTHING_ROUNDS = 10  # takes the staircase out of a voxel path
_TANGENT_M = 1.0  # length over which the path's first and last direction is taken
_START_EXCESS = 1.1  # a start beyond a limit by more than this factor is refused
_QP_SHARE = 0.96  # of the limits inside the QP: room for its linearisation
_STRETCH = 1.06  # least factor by which a duration is stretched
_STRETCH_GAIN = 0.99  # stretching ends unless it takes the excess below this share
_SHORTEST_S = 0.2  # of a trajectory to where the vehicle is: h² of a shorter one drowns in rounding
_RETIME = 0.03  # relative change of duration that is worth placing the control points anew
_HARD_ABOVE_VOXELS = 0.5  # the steep part of the obstacle cost begins this far above the hard limit
_REST_MPS = 0.05  # a slower start counts as standing
_UNKNOWN_TETHER = 400.0  # of samples within a voxel of unknown space, when that is not to be entered
_AROUND = np.vstack([np.zeros(3), np.eye(3), -np.eye(3)])


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


class Settings(NamedTuple):
    """Parameters of `min_acc` and limits of the vehicle, SI."""

    min_clearance: float
    safe_clearance: float
    obstacle_weight: float
    end_speed: float
    duration_margin: float
    control_spacing: float
    first_iterations: int
    final_iterations: int
    tolerance: float
    z_band: float
    known_only: bool
    max_speed: float
    max_acceleration: float
    max_jerk: float  # of the stop that follows a moving end
    body_radius: float = 0.0
    mover_margin: float = 0.0  # kept from predicted movers beyond the body's radius
    mover_horizon: float = 0.0  # so long a prediction counts


class Problem(NamedTuple):
    """One request, prepared."""

    path: Float  # (P, 3) smoothed, STEP_M apart
    raw: Float  # (P, 3) as searched, STEP_M apart
    start: Float  # (3, 3) position, velocity, acceleration
    end: Float  # (3, 3)
    field: DistanceField
    bounds: Float  # (2, 3)
    movers: Float  # (B, COLUMNS) table of `moving`


class Curve(NamedTuple):
    """A candidate."""

    control: Float  # (N, 3)
    h: float  # knot spacing, s


class Outcome(NamedTuple):
    """Answer of `optimise`."""

    status: PlanStatus
    reason: str
    curve: Curve | None
    iterations: int  # QPs solved


def optimise(request: PlanRequest, path_m: Float, settings: Settings) -> Outcome:
    """Walk the ladder until a curve keeps the limits and the clearance.

    Args:
        request: what was asked.
        path_m: (P, 3) collision-free polyline from start to goal.
        settings: parameters and limits.
    """
    speed = float(np.linalg.norm(request.velocity_mps))
    acceleration = float(np.linalg.norm(request.acceleration_mps2))
    if speed > _START_EXCESS * settings.max_speed or acceleration > _START_EXCESS * settings.max_acceleration:
        reason = f"the start has {speed:.2f} m/s and {acceleration:.2f} m/s²"
        return Outcome(PlanStatus.LIMITS, reason, None, 0)
    problem = _prepare(request, path_m, settings)
    status, reason, iterations = PlanStatus.LIMITS, "no duration keeps the limits", 0
    for rung in LADDER:
        if rung.from_rest and speed > _REST_MPS:
            continue
        shaper = _Shaper(problem, settings, rung)
        curve = shaper.shape()
        iterations += shaper.iterations
        if curve is None:
            continue
        if not np.isfinite(curve.control).all():
            status, reason = PlanStatus.SOLVER, "the solver returned NaN"
            continue
        reason = curve_shortfall(request, settings, curve)
        if not reason:
            return Outcome(PlanStatus.OK, "", curve, iterations)
        status = PlanStatus.NOT_CLEAR
    return Outcome(status, reason, None, iterations)


def _prepare(request: PlanRequest, path_m: Float, settings: Settings) -> Problem:
    raw = resample(path_m, STEP_M)
    path = smooth(raw, _SMOOTHING_ROUNDS)
    start = np.stack([request.position_m, request.velocity_mps, request.acceleration_mps2])
    end = np.zeros((3, 3))
    end[0] = request.goal.position_m
    bounds = request.flight_bounds_m.copy()  # and the search's height band
    heights = (start[0, 2], end[0, 2])
    bounds[0, 2] = max(bounds[0, 2], min(heights) - settings.z_band)
    bounds[1, 2] = min(bounds[1, 2], max(heights) + settings.z_band)
    movers = moving_obstacles(request, settings).table(request.time_s)
    problem = Problem(path, raw, start, end, request.field, bounds, movers)
    if not request.goal.is_target:
        end[1] = _end_velocity(problem, settings)
    return problem


def _end_velocity(problem: Problem, settings: Settings) -> Float:
    """Velocity (3,) along the path's end, no more than can be reached, and stopped from beyond it."""
    path, goal = problem.path, problem.end[0]
    along = goal - path[max(len(path) - 1 - round(_TANGENT_M / STEP_M), 0)]
    length = float(np.linalg.norm(along))
    if length < 1e-6 or settings.end_speed == 0.0:
        return np.zeros(3)
    along /= length
    travel = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
    reachable = float(problem.start[1] @ problem.start[1]) + settings.max_acceleration * travel
    # Stop as flown: jerk-limited, v²/(2a) + v a/(2j) (`brake`)
    ramp = settings.max_acceleration / (2.0 * settings.max_jerk)
    stop_m = settings.end_speed**2 / (2.0 * settings.max_acceleration) + settings.end_speed * ramp
    ahead = np.arange(1, math.ceil(stop_m / STEP_M) + 1) * STEP_M
    beyond = goal + ahead[:, None] * along
    free = problem.field.distance_m(beyond) >= settings.min_clearance
    free &= ((beyond >= problem.bounds[0]) & (beyond <= problem.bounds[1])).all(axis=1)
    if settings.known_only:
        free &= problem.field.observed(beyond)
    room = ahead[-1] if free.all() else ahead[np.argmin(free)] - STEP_M
    stoppable = settings.max_acceleration * (
        math.sqrt(ramp**2 + 2.0 * room / settings.max_acceleration) - ramp
    )
    velocity: Float = min(settings.end_speed, math.sqrt(reachable), stoppable) * along
    return velocity


class _Shaper:
    """Shapes one curve for one rung of the ladder."""

    def __init__(self, problem: Problem, settings: Settings, rung: Rung) -> None:
        self.problem, self.settings, self.rung = problem, settings, rung
        self.iterations = 0
        length = STEP_M * (len(problem.path) - 1)
        count = round(rung.finer * length / settings.control_spacing) + 6
        count = min(max(count, CONTROL_POINTS.start), CONTROL_POINTS[-1])
        self.model: SplineModel = spline_model(count + count % 2)
        hard = settings.min_clearance + _HARD_ABOVE_VOXELS * problem.field.voxel_size_m
        weight, least = settings.obstacle_weight * rung.weight, settings.min_clearance
        self.weights = np.array([weight, settings.safe_clearance, hard, least])
        self.limits = _QP_SHARE * np.array([settings.max_speed, settings.max_acceleration])
        samples = len(self.model.position)
        self.tether = np.zeros((samples, 3))
        self.tether_weight = np.zeros(samples)

    def shape(self) -> Curve | None:
        """Return a curve within the limits, or None when no stretching keeps them."""
        problem, settings = self.problem, self.settings
        along, late_s = _start_on_path(problem, settings)
        speeds = (float(np.linalg.norm(problem.end[1])), settings.max_speed, settings.max_acceleration)
        times = time_profile(problem.path, along, *speeds)
        curve = self._place(problem.path, times, late_s)
        curve = self._iterate(curve, settings.first_iterations)[0]
        shape = resample(sample_spline(curve.control, 2 * SAMPLES), STEP_M)
        if not np.isfinite(shape).all():
            return curve
        times = time_profile(shape, float(np.linalg.norm(problem.start[1])), *speeds)
        placed = self._place(shape, times, 0.0)
        if abs(placed.h / curve.h - 1.0) > _RETIME:
            curve = placed
        worst = math.inf
        while True:
            better, feasible = self._iterate(curve, settings.final_iterations)
            excess = self._excess(better)
            if feasible and excess <= 1.0:
                return better
            if excess > _STRETCH_GAIN * worst or not math.isfinite(excess):
                return None
            worst = excess
            curve = Curve(better.control, max(_STRETCH, min(excess, 1.5)) * better.h)
            pin_ends(curve.control, curve.h, problem.start, problem.end)

    def _place(self, points: Float, times: Float, late_s: float) -> Curve:
        """First guess along a timed polyline."""
        count = self.model.control_points
        fastest = float(times[-1])
        duration = (fastest + late_s) * self.settings.duration_margin * self.rung.slower
        duration = max(duration, _SHORTEST_S)
        h = duration / (count - 3)
        control = place_by_time(points, times, count, h, duration / fastest)
        pin_ends(control, h, self.problem.start, self.problem.end)
        return Curve(control, h)

    def _iterate(self, curve: Curve, rounds: int) -> tuple[Curve, bool]:
        """Solve up to `rounds` QPs; returns the last iterate and whether the last QP was feasible."""
        control, h = curve
        model, field = self.model, self.problem.field
        for _ in range(rounds):
            self._set_tether(control)
            grid = (field.distance, field.origin_m, field.voxel_size_m)
            pull = (self.weights, self.tether, self.tether_weight, self.limits, self.problem.movers)
            local = (h, model.energy, model.position, *grid, *pull)
            hessian, gradient = quadratic_model(control, *local)
            rows, sides = limit_rows(control, h, self.limits, self.problem.bounds)
            none = np.zeros(len(sides), dtype=np.int32)
            step, _, flag, _ = daqp.solve(hessian, gradient, rows, sides, np.full(len(sides), -1e30), none)
            self.iterations += 1
            if flag < 1 or not np.isfinite(step).all():
                return Curve(control, h), False
            control, gained = line_search(control, step.reshape(-1, 3), *local)
            if gained < self.settings.tolerance:
                break
        return Curve(control, h), True

    def _set_tether(self, control: Float) -> None:
        """Tie samples to the nearest points of the searched path, where this rung or the unknown asks."""
        if self.rung.tether == 0.0 and not self.settings.known_only:
            return
        points = self.model.position @ control
        apart = ((points[:, None, :] - self.problem.raw[None, :, :]) ** 2).sum(axis=2)
        self.tether = self.problem.raw[np.argmin(apart, axis=1)]
        self.tether_weight = np.full(len(points), self.rung.tether)
        if self.settings.known_only:
            reach = self.problem.field.voxel_size_m * _AROUND
            around = (points[:, None, :] + reach).reshape(-1, 3)
            known = self.problem.field.observed(around).reshape(-1, len(_AROUND)).all(axis=1)
            self.tether_weight[~known] += _UNKNOWN_TETHER

    def _excess(self, curve: Curve) -> float:
        """By what factor the duration is too short; <= 1 when the limits are kept."""
        settings = self.settings
        speed, acceleration = self.problem.start[1], self.problem.start[2]
        fast, strong = float(np.linalg.norm(speed)), float(np.linalg.norm(acceleration))
        # what no continuation with continuous acceleration can avoid from this start
        rising = max(float(speed @ acceleration) / fast, 0.0) if fast > 0.0 else 0.0
        unavoidable = fast + rising**2 * curve.h / (2.0 * (rising + settings.max_acceleration))
        top = max(settings.max_speed, unavoidable) * (1.0 + 1e-9)
        most = max(settings.max_acceleration, strong) * (1.0 + 1e-9)
        too_strong: float = peak_acceleration(curve.control, curve.h) / most
        too_fast: float = peak_speed(curve.control, curve.h) / top
        return max(too_fast, math.sqrt(too_strong))


def _start_on_path(problem: Problem, settings: Settings) -> tuple[float, float]:
    """Start speed along the path, m/s, and the time lost to the part of it that is not, s."""
    path, velocity = problem.path, problem.start[1]
    ahead = path[min(round(_TANGENT_M / STEP_M), len(path) - 1)] - path[0]
    length = float(np.linalg.norm(ahead))
    along = float(velocity @ ahead) / length if length > 1e-9 else 0.0
    across = math.sqrt(max(float(velocity @ velocity) - along**2, 0.0))
    # a vehicle moving away needs v/a to stop and sqrt(2) v/a to come back
    lost = across + (1.0 + math.sqrt(2.0)) * max(-along, 0.0)
    return max(along, 0.0), lost / settings.max_acceleration


def curve_shortfall(request: PlanRequest, settings: Settings, curve: Curve) -> str:
    """Say where a curve is not clear, checked every half voxel; empty when it is."""
    longest = float(np.linalg.norm(np.diff(curve.control, axis=0), axis=1).max())
    per_segment = max(math.ceil(longest / (0.5 * request.field.voxel_size_m)), 1)
    points = sample_spline(curve.control, per_segment)
    times = request.time_s + np.arange(len(points), dtype=np.float64) * (curve.h / per_segment)
    return fixed_shortfall(request, settings, points) or mover_shortfall(request, settings, points, times)


def fixed_shortfall(request: PlanRequest, settings: Settings, points: Float) -> str:
    """Say where a curve through points (P, 3) is not clear of the map (`clearance.shortfall`)."""
    limits = (settings.min_clearance, settings.max_acceleration)
    return shortfall(request, points, *limits, settings.known_only)


def moving_obstacles(request: PlanRequest, settings: Settings) -> MovingObstacles:
    """The believed movers with what these settings keep from them; none when they do not count at all."""
    return MovingObstacles(
        tracks=request.tracks if settings.mover_horizon > 0.0 else Tracks.none(request.time_s),
        field=request.field,
        body_radius_m=settings.body_radius,
        margin_m=settings.mover_margin,
        horizon_s=settings.mover_horizon,
    )


def mover_shortfall(request: PlanRequest, settings: Settings, points: Float, times: Float) -> str:
    """Say where a curve through points (P, 3) at times (P,) is too near to a mover; empty when it is not."""
    return moving_obstacles(request, settings).shortfall(points, times, settings.max_acceleration)
