"""Static planner: a B-spline around an A* path, static obstacles only (Jin, Xu et al., eqs. 1 and 2).

    min over the N - 2 (k - 1) inner control points of
        α_control ∫ ‖r''‖² dt + α_smooth ∫ ‖r'''‖² dt + α_static ∫ c(r) dt
    ‖r'‖ <= v_max, ‖r''‖ <= a_max; the first and last k - 1 control points say how it begins and ends

The paper leaves the three costs to its reference [19]; effort is here what its eq. 3a calls effort, the
squared acceleration, smoothness the squared jerk, c the obstacle cost of `static_cost`. Each
step of the sequential convex programme is a QP solved by daqp (exact, dense, active set); a line
search on the true cost follows. The limits [ours] are half spaces, renewed each step.

Duration: the time-optimal traversal of the path within the limits (`timing`), times a margin, taken
again from the optimised curve; stretched while the limits are not kept. Clearance is checked
on the result; when it fails, the next rung of a fixed ladder makes obstacles dearer, the flight
slower, the spline finer, and at last ties the curve to the path. All budgets are iterations.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uavexp.arrays import Float
from uavexp.planner.clearance import shortfall
from uavexp.planner.shape.optimise import LADDER, Rung
from uavexp.planner.shape.static_problem import Curve, Problem, Settings, minimise
from uavexp.planner.shape.timing import STEP_M, resample, smooth, time_profile
from uavexp.planner.spline.uniform import make_uniform, pin_ends, to_trajectory
from uavexp.trajectory import Trajectory, evaluate
from uavexp.types import Limits, PlanRequest, PlanStatus

MOST_POINTS = 40
START_EXCESS = 1.1  # a start beyond a limit by more than this factor is refused
CHECK_S = 0.01
_SMOOTHING_ROUNDS = 10  # takes the staircase out of a voxel path
_TANGENT_M = 1.0  # length over which the path's first direction is taken
_CHECKED_SHARE = 0.999  # of the limits: room for what lies between two checked instants
_STRETCH, _STRETCHES, _STRETCH_GAIN = 1.06, 12, 0.99
_SHORTEST_S = 0.2  # of a trajectory to where the vehicle is
_REST_MPS = 0.05  # a slower start counts as standing


class Shaped(NamedTuple):
    """Answer of the static planner."""

    status: PlanStatus
    reason: str
    trajectory: Trajectory | None
    iterations: int  # QPs solved


def shape_spline(request: PlanRequest, path_m: Float, end_velocity_mps: Float, settings: Settings) -> Shaped:
    """Walk the ladder until a spline keeps the limits and the clearance.

    Args:
        request: what was asked; its movers do not count here.
        path_m: (P, 3) collision-free polyline from start to goal.
        end_velocity_mps: (3,) at the goal.
        settings: parameters and limits.
    """
    speed = float(np.linalg.norm(request.velocity_mps))
    status, reason, iterations = PlanStatus.LIMITS, "no duration keeps the limits", 0
    for rung in LADDER:
        if rung.from_rest and speed > _REST_MPS:
            continue
        shaper = _Shaper(request, path_m, end_velocity_mps, settings, rung)
        curve = shaper.shape()
        iterations += shaper.iterations
        if curve is None:
            continue
        if not np.isfinite(curve.control).all():
            status, reason = PlanStatus.SOLVER, "the solver returned NaN"
            continue
        trajectory = shaper.trajectory(curve)
        points = evaluate(trajectory, instants(trajectory))[0]
        strongest = settings.limits.max_acceleration_mps2
        reason = shortfall(request, points, settings.min_clearance_m, strongest, settings.known_only)
        if not reason:
            return Shaped(PlanStatus.OK, "", trajectory, iterations)
        status = PlanStatus.NOT_CLEAR
    return Shaped(status, reason, None, iterations)


def instants(trajectory: Trajectory) -> Float:
    """Times (T,) at which a trajectory is checked: evenly, at most `CHECK_S` apart, and its breaks."""
    count = max(math.ceil(trajectory.duration_s / CHECK_S), 1) + 1
    even = np.linspace(trajectory.start_s, trajectory.end_s, count)
    return np.union1d(even, trajectory.breaks_s)


def limit_excess(trajectory: Trajectory, limits: Limits, turn_s: float) -> float:
    """By what factor a trajectory is too fast for the limits; <= 1 when it keeps them.

    What no continuation of its start with continuous acceleration can avoid is allowed.

    Args:
        trajectory: from the requested start.
        limits: of the vehicle.
        turn_s: time that the acceleration has to turn against the motion.
    """
    _, velocity, acceleration = evaluate(trajectory, instants(trajectory))
    fast, strong = float(np.linalg.norm(velocity[0])), float(np.linalg.norm(acceleration[0]))
    rising = max(float(velocity[0] @ acceleration[0]) / fast, 0.0) if fast > 0.0 else 0.0
    most = limits.max_acceleration_mps2
    unavoidable = fast + rising**2 * turn_s / (2.0 * (rising + most))
    top = max(_CHECKED_SHARE * limits.max_speed_mps, unavoidable * (1.0 + 1e-9))
    most = max(_CHECKED_SHARE * most, strong * (1.0 + 1e-9))
    too_fast = float(np.linalg.norm(velocity, axis=1).max()) / top
    too_strong = float(np.linalg.norm(acceleration, axis=1).max()) / most
    return max(too_fast, math.sqrt(too_strong))


class _Shaper:
    """Shapes one curve for one rung of the ladder."""

    def __init__(
        self, request: PlanRequest, path_m: Float, end_velocity_mps: Float, settings: Settings, rung: Rung
    ) -> None:
        self.request, self.settings, self.rung, self.iterations = request, settings, rung, 0
        raw = resample(path_m, STEP_M)
        self.path = smooth(raw, _SMOOTHING_ROUNDS)
        self.start = np.stack([request.position_m, request.velocity_mps, request.acceleration_mps2])
        self.end = np.stack([request.goal.position_m, end_velocity_mps, np.zeros(3)])
        bounds = request.flight_bounds_m.copy()  # and the search's height band
        heights = (self.start[0, 2], self.end[0, 2])
        bounds[0, 2] = max(bounds[0, 2], min(heights) - settings.z_band_m)
        bounds[1, 2] = min(bounds[1, 2], max(heights) + settings.z_band_m)
        degree = settings.order - 1
        count = round(rung.finer * STEP_M * (len(raw) - 1) / settings.control_spacing_m) + 2 * degree
        count = min(max(count, 2 * degree + 4), MOST_POINTS)
        self.basis = make_uniform(degree, count + count % 2)
        weight = settings.static_weight * rung.weight
        self.problem = Problem(self.basis, settings, request.field, bounds, raw, weight, rung.tether)

    def trajectory(self, curve: Curve) -> Trajectory:
        """The curve as it is flown."""
        at_rest = self.request.goal.is_target
        return to_trajectory(self.basis, curve.control, curve.h, self.request.time_s, at_rest)

    def shape(self) -> Curve | None:
        """Return a curve within the limits, or None when no stretching keeps them."""
        limits = self.settings.limits
        along, late_s = self._start_on_path()
        ends = (float(np.linalg.norm(self.end[1])), limits.max_speed_mps, limits.max_acceleration_mps2)
        curve = self._place(self.path, time_profile(self.path, along, *ends), late_s)
        curve = self._minimise(curve, self.settings.first_iterations)[0]
        points = evaluate(self.trajectory(curve), instants(self.trajectory(curve)))[0]
        shape = resample(points, STEP_M)
        times = time_profile(shape, float(np.linalg.norm(self.start[1])), *ends)
        curve = self._place(shape, times, 0.0)
        worst = math.inf
        for _ in range(_STRETCHES):
            better, feasible = self._minimise(curve, self.settings.final_iterations)
            excess = limit_excess(self.trajectory(better), limits, better.h)
            if feasible and excess <= 1.0:
                return better
            if excess > _STRETCH_GAIN * worst:
                return None
            worst = excess
            curve = Curve(better.control.copy(), max(_STRETCH, min(excess, 1.5)) * better.h)
            pin_ends(self.basis, curve.control, curve.h, self.start, self.end)
        return None

    def _start_on_path(self) -> tuple[float, float]:
        """Start speed along the path, m/s, and the time lost to the part of it that is not, s."""
        ahead = self.path[min(round(_TANGENT_M / STEP_M), len(self.path) - 1)] - self.path[0]
        length, velocity = float(np.linalg.norm(ahead)), self.start[1]
        along = float(velocity @ ahead) / length if length > 1e-9 else 0.0
        across = math.sqrt(max(float(velocity @ velocity) - along**2, 0.0))
        # a vehicle moving away needs v/a to stop and sqrt(2) v/a to come back
        lost = across + (1.0 + math.sqrt(2.0)) * max(-along, 0.0)
        return max(along, 0.0), lost / self.settings.limits.max_acceleration_mps2

    def _place(self, points: Float, times: Float, late_s: float) -> Curve:
        """First guess along a timed polyline: a control point lies where its basis function peaks."""
        degree, count = self.basis.degree, len(self.basis.velocity) + 1
        fastest = float(times[-1])
        duration = (fastest + late_s) * self.settings.duration_margin * self.rung.slower
        h = max(duration, _SHORTEST_S) / (count - degree)
        peaks = (np.arange(count) - 0.5 * (degree - 1)) * h * fastest / max(duration, _SHORTEST_S)
        control = np.stack([np.interp(peaks, times, points[:, axis]) for axis in range(3)], axis=1)
        pin_ends(self.basis, control, h, self.start, self.end)
        return Curve(control, h)

    def _minimise(self, curve: Curve, rounds: int) -> tuple[Curve, bool]:
        better, feasible, solved = minimise(self.problem, curve, rounds)
        self.iterations += solved
        return better, feasible
