"""Shaper `corridor_qp`: time any path, grow a corridor, solve the QP, stretch, check.

    path -> straight ways where they are free -> time-optimal traversal within the limits -> spans of
    equal duration -> a convex free region around each span's piece of the path -> QP (`cone_program`)

The derivative k whose square is minimised decides the degree: k + 1, the least at which the k-th
derivative is continuous (and at which acceleration is, for every k). So acceleration has the
paper's cubic, jerk degree 4, snap degree 5.

Duration: the time-optimal traversal of the timed path, times a margin; while the limits cannot be
kept, it is stretched. Clearance holds by construction (`flight_corridor`) and is checked on the result
by the map's interpolated distance, every quarter voxel.

When that fails, the next rung takes more and shorter spans, the last one follows the searched
path itself. When a moving start defeats them all, the vehicle is braked first and the rest begins
where it stands; brake and flight are one trajectory.

All budgets are iterations; the answer depends on the request and nothing else.
"""

from __future__ import annotations

import math
from dataclasses import replace
from enum import StrEnum
from typing import Annotated, ClassVar, NamedTuple

import numpy as np

from uavexp.arrays import Float
from uavexp.braking import REST_MPS
from uavexp.parameters import NonNegative, Positive, between, option
from uavexp.planner.constraints import Constraints
from uavexp.planner.find.base import FoundPath
from uavexp.planner.find.free_space import straight_is_free
from uavexp.planner.movers.moving import MovingObstacles
from uavexp.planner.shape.base import ShapedPath
from uavexp.planner.shape.cone_program import NO_CUTS, Problem, solve
from uavexp.planner.shape.course import Given, at_shares, course, space_of
from uavexp.planner.shape.excess import unavoidable
from uavexp.planner.shape.flight_corridor import make_corridor
from uavexp.planner.shape.start import SHORTEST_S, TANGENT_M, end_velocity, refusal, state_of
from uavexp.planner.shape.stop_first import braking, standing
from uavexp.planner.shape.timing import STEP_M, resample
from uavexp.planner.spline.clamped import Basis, make_basis, to_trajectory
from uavexp.trajectory import evaluate, join
from uavexp.types import Limits, PlanRequest, PlanStatus

FEWEST_SPANS, MOST_SPANS = 6, 60
_STRETCH = 1.08  # of a duration that is too short
_STRETCHES_AT_REST = 14  # tried at most
_STRETCHES_MOVING = 5  # braking first helps a moving start more than a long duration
_ROUNDS = 12  # QPs at most for one duration
_CHECK_VOXELS = 0.25
_ROUNDING = 1.0 + 1e-9


class Derivative(StrEnum):
    """Whose square is minimised."""

    ACCELERATION = "acceleration"
    JERK = "jerk"
    SNAP = "snap"

    @property
    def order(self) -> int:
        """k: 2, 3 or 4."""
        return list(Derivative).index(self) + 2


class Rung(NamedTuple):
    """One try."""

    finer: float  # factor on the number of spans
    straight: bool  # along straight ways, not the searched path
    moving_end: bool  # at a goal that is not the target


LADDER = (Rung(1.0, True, True), Rung(1.6, True, False), Rung(2.0, False, False))


@option
class CorridorQp:
    """Least acceleration, jerk or snap in a corridor; see the module."""

    sees_movers: ClassVar[bool] = False

    derivative: Derivative = Derivative.ACCELERATION  # whose square is minimised: acceleration (cubic;
    # paper 4) | jerk (degree 4) | snap (degree 5)
    span_s: Positive = 0.3  # s, duration of a polynomial piece, unless that makes more than 60 [ours]
    duration_margin: Annotated[float, between(1, 10)] = 1.05  # 1, factor on the time-optimal traversal of
    # the path [ours]
    end_speed_mps: NonNegative = 1.5  # m/s, speed at a goal that is not the target, if there is room to
    # stop behind it [ours]

    def shape(
        self, request: PlanRequest, found: FoundPath, constraints: Constraints, movers: MovingObstacles
    ) -> ShapedPath:
        """Return a trajectory or the reason why there is none (`Shaper.shape`)."""
        del movers
        given = Given(request, found.path_m, found.times_s, constraints)
        refused = _refusal(given)
        if refused is not None:
            return refused
        result = self._climb(given)
        if result.status is PlanStatus.OK or float(np.linalg.norm(request.velocity_mps)) <= REST_MPS:
            return result
        return self._brake_first(given, result)

    def _climb(self, given: Given) -> ShapedPath:
        """Walk the ladder until a curve keeps the limits and the clearance."""
        result = ShapedPath(status=PlanStatus.LIMITS, reason=_REASON_OF["limits"])
        for rung in LADDER:
            tried = self._attempt(given, rung)
            result = replace(tried, iterations=result.iterations + tried.iterations)
            if result.status is PlanStatus.OK:
                break
        return result

    def _attempt(self, given: Given, rung: Rung) -> ShapedPath:
        """One rung: corridor once, QP and stretching, check."""
        problem, h = self._problem(given, rung)
        if not problem.corridor.whole:
            return ShapedPath(status=PlanStatus.NOT_CLEAR, reason="the path meets an obstacle")
        cuts, solves = NO_CUTS, 0
        moving = float(np.linalg.norm(given.request.velocity_mps)) > REST_MPS
        for _ in range(_STRETCHES_MOVING if moving else _STRETCHES_AT_REST):
            answer = solve(problem, h, cuts, _ROUNDS)
            solves, cuts = solves + answer.solves, answer.cuts
            if answer.control is not None:
                return _checked(given, problem.basis, answer.control, h, solves)
            if answer.reason != "limits":
                break
            h *= _STRETCH
        status = _STATUS_OF[answer.reason]
        return ShapedPath(status=status, reason=_REASON_OF[answer.reason], iterations=solves)

    def _problem(self, given: Given, rung: Rung) -> tuple[Problem, float]:
        """The QP of a rung, and the first duration of its spans, s."""
        request, kept = given.request, given.constraints
        start, end = state_of(request), np.zeros((3, 3))
        end[0] = request.goal.position_m
        if rung.moving_end and not request.goal.is_target:
            end[1] = self._end_velocity(given)
        way = course(given, float(np.linalg.norm(end[1])), rung.straight)
        duration = max(self.duration_margin * float(way.times[-1]), SHORTEST_S)
        spans = min(max(round(rung.finer * duration / self.span_s), FEWEST_SPANS), MOST_SPANS)
        basis = make_basis(self.derivative.order + 1, spans, self.derivative.order)
        at_knots = at_shares(way, np.linspace(0.0, 1.0, spans + 1))
        bounds, clearance = request.flight_bounds_m, kept.min_clearance_m
        corridor = make_corridor(request.field, at_knots, bounds, clearance, kept.known_only)
        h, guess = duration / spans, at_shares(way, _greville(basis))
        return Problem(basis, corridor, guess, start, end, *_allowed(start, kept.limits, h)), h

    def _end_velocity(self, given: Given) -> Float:
        """Velocity (3,) along the path's end that can be stopped from on clear ground, else zero."""
        request, limits = given.request, given.constraints.limits
        path = resample(given.path, STEP_M)
        along = path[-1] - path[max(len(path) - 1 - round(TANGENT_M / STEP_M), 0)]
        length, space = float(np.linalg.norm(along)), space_of(given, 0.0)

        def clear(stop_m: float) -> bool:
            return bool(straight_is_free(space, path[-1], path[-1] + stop_m / length * along)[0])

        travel_m, start_mps = STEP_M * (len(path) - 1), request.velocity_mps
        return end_velocity(along, travel_m, start_mps, limits, self.end_speed_mps, clear)

    def _brake_first(self, given: Given, failed: ShapedPath) -> ShapedPath:
        """Stop, then fly from there; the failure of the direct attempt when that fails, too."""
        brake, way, blocked = braking(given.request, given.constraints)
        if blocked:
            reason = f"{failed.reason}; braking: {blocked}"
            return replace(failed, status=PlanStatus.NOT_CLEAR, reason=reason)
        back = np.concatenate([way[::-1], given.path[1:]])
        asked = standing(given.request, brake.end_s, way[-1])
        onward = self._climb(given._replace(request=asked, path=back, times=None))
        iterations = failed.iterations + onward.iterations
        if onward.trajectory is None:
            return replace(failed, iterations=iterations)
        joined = join(brake, onward.trajectory)
        return replace(onward, trajectory=joined, reason="brakes first", iterations=iterations)


_STATUS_OF = {
    "corridor": PlanStatus.NOT_CLEAR,
    "limits": PlanStatus.LIMITS,
    "solver": PlanStatus.SOLVER,
}
_REASON_OF = {
    "corridor": "no curve from this start stays in the corridor",
    "limits": "no duration keeps the limits",
    "solver": "the solver failed",
}


def _checked(given: Given, basis: Basis, control: Float, h: float, solves: int) -> ShapedPath:
    """The curve as a trajectory if it keeps limits and clearance on a fine grid."""
    request, kept = given.request, given.constraints
    trajectory = to_trajectory(basis, control, h, request.time_s, request.goal.is_target)
    longest = float(np.linalg.norm(np.diff(basis.bezier @ control, axis=1), axis=2).sum(axis=1).max())
    per_span = max(math.ceil(longest / (_CHECK_VOXELS * request.field.voxel_size_m)), 4)
    times = request.time_s + np.linspace(0.0, h * len(basis.bezier), per_span * len(basis.bezier) + 1)
    points, velocities, accelerations = evaluate(trajectory, times)
    top, most = _allowed(state_of(request), kept.limits, h)
    speed = float(np.linalg.norm(velocities, axis=1).max())
    strength = float(np.linalg.norm(accelerations, axis=1).max())
    if speed > top * _ROUNDING or strength > most * _ROUNDING:
        reason = f"reaches {speed:.2f} m/s and {strength:.2f} m/s²"
        return ShapedPath(status=PlanStatus.LIMITS, reason=reason, iterations=solves)
    reason = kept.shortfall(request, points)
    if reason:
        return ShapedPath(status=PlanStatus.NOT_CLEAR, reason=reason, iterations=solves)
    return ShapedPath(status=PlanStatus.OK, trajectory=trajectory, iterations=solves)


def _refusal(given: Given) -> ShapedPath | None:
    """Why there is nothing to shape, or None."""
    start, limits = state_of(given.request), given.constraints.limits
    timed = given.times is None or np.isfinite(given.times).all()
    if len(given.path) < 2 or not timed or not all(np.isfinite(part).all() for part in (given.path, start)):
        return ShapedPath(status=PlanStatus.SOLVER, reason="path or start is not finite")
    top, most = limits.max_speed_mps, limits.max_acceleration_mps2
    if not (top > 0.0 and most > 0.0 and limits.max_body_rate_radps > 0.0):
        return ShapedPath(status=PlanStatus.LIMITS, reason=f"limits of {top:g} m/s and {most:g} m/s²")
    reason = refusal(start, limits)
    return ShapedPath(status=PlanStatus.LIMITS, reason=reason) if reason else None


def _allowed(start: Float, limits: Limits, h: float) -> tuple[float, float]:
    """Speed and acceleration that may be reached: the limits, or what this start makes unavoidable."""
    fast, strong = unavoidable(start[1], start[2], limits.max_acceleration_mps2, h)
    return max(limits.max_speed_mps, fast), max(limits.max_acceleration_mps2, strong)


def _greville(basis: Basis) -> Float:
    """Share (N,) of the duration at which each control point acts: the mean of its inner knots."""
    spans, degree = len(basis.bezier), basis.degree
    knots = np.clip(np.arange(1 - degree, spans + degree), 0, spans)
    return np.convolve(knots, np.full(degree, 1.0 / degree), mode="valid") / spans
