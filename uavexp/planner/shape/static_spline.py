"""Shaper `static_spline`: a B-spline of any order among static obstacles (Jin, Xu et al., eqs. 1 and 2).

    min over the N - 2 (k - 1) inner control points of
        α_control ∫ ‖r''‖² dt + α_smooth ∫ ‖r'''‖² dt + α_static ∫ c(r) dt
    ‖r'‖ <= v_max, ‖r''‖ <= a_max; the first and last k - 1 control points say how it begins and ends

The paper leaves the three costs to its reference [19]; effort is here what its eq. 3a calls effort, the
squared acceleration, smoothness the squared jerk, c the obstacle cost of `scp_step`. Each
step of the sequential convex programme is a QP (`static_step`) solved by daqp; a line search on the
true cost follows. The limits [ours] are half spaces, renewed each step. The rest: `successive`.
"""

from __future__ import annotations

from functools import partial
from typing import Annotated, ClassVar

import numpy as np

from uavexp.arrays import Float
from uavexp.parameters import Count, NonNegative, Positive, between, option
from uavexp.planner.constraints import Constraints
from uavexp.planner.find.base import FoundPath
from uavexp.planner.movers.moving import MovingObstacles
from uavexp.planner.shape.base import ShapedPath
from uavexp.planner.shape.excess import instants, limit_excess
from uavexp.planner.shape.qp import solve_qp
from uavexp.planner.shape.start import TANGENT_M, end_velocity
from uavexp.planner.shape.static_step import Cost, limit_rows, line_search, local_model
from uavexp.planner.shape.successive import (
    Curve,
    Effort,
    Route,
    Rung,
    climb,
    control_points,
    hard_m,
    route_of,
)
from uavexp.planner.shape.timing import STEP_M
from uavexp.planner.spline.uniform import make_uniform, pin_ends, to_trajectory
from uavexp.trajectory import Trajectory, evaluate
from uavexp.types import PlanRequest, PlanStatus

_TOLERANCE = 0.01  # a smaller relative gain in cost ends the iteration
_AHEAD_M = 0.05  # spacing at which the way beyond a moving end is checked


@option
class StaticSpline:
    """Paper 3's static planner; see the module."""

    sees_movers: ClassVar[bool] = False

    order: Annotated[int, between(4, 8)] = 4  # k of the spline, degree k - 1; the first and last k - 1
    # control points are fixed (paper 3); 4 is the least with continuous acceleration
    stop_at_ends: bool = False  # true: repeated control points, a stop at every goal (paper 3); false:
    # continuous with the present motion [ours]
    control_weight: Positive = 1.0  # 1, alpha_control of the integral of squared acceleration; the paper
    # gives no number
    smooth_weight: NonNegative = 0.01  # s², alpha_smooth of the integral of squared jerk [ours]
    static_weight: NonNegative = 60.0  # m²/s⁴, alpha_static: what a surface's touch is worth as a squared
    # acceleration [ours]
    end_speed_mps: NonNegative = 1.5  # m/s, speed at a goal that is not the target, if there is room to
    # stop behind it [ours]
    duration_margin: Annotated[float, between(1, 10)] = 1.1  # 1, factor on the time-optimal traversal of
    # the curve [ours]
    control_spacing_m: Positive = 0.6  # m, path length per control point [ours]
    first_iterations: Count = 3  # QPs of the spline before the curve is timed anew [ours]
    final_iterations: Count = 4  # QPs at most after that, and after each stretching of the duration [ours]

    def shape(
        self, request: PlanRequest, found: FoundPath, constraints: Constraints, movers: MovingObstacles
    ) -> ShapedPath:
        """Return a trajectory or the reason why there is none (`Shaper.shape`)."""
        del movers
        if self.stop_at_ends and (np.any(request.velocity_mps) or np.any(request.acceleration_mps2)):
            return ShapedPath(status=PlanStatus.LIMITS, reason="it begins at rest only")
        route = route_of(request, found.path_m, constraints.z_band_m)
        route.end[1] = self._end_velocity(request, found.path_m, constraints)
        effort = Effort(self.duration_margin, self.first_iterations, self.final_iterations)
        make = partial(_AnyOrder, self, request, route, constraints)
        return climb(route, constraints.limits, effort, make)

    def _end_velocity(self, request: PlanRequest, path_m: Float, constraints: Constraints) -> Float:
        """Velocity (3,) along the path's end that can be reached, and stopped from on clear ground."""
        if request.goal.is_target or self.stop_at_ends or self.end_speed_mps == 0.0:
            return np.zeros(3)
        goal_m = path_m[-1]
        back_m = np.cumsum(np.linalg.norm(np.diff(path_m[::-1], axis=0), axis=1))
        near = min(int(np.searchsorted(back_m, TANGENT_M)) + 1, len(path_m) - 1)
        along = goal_m - path_m[-1 - near]
        length = float(np.linalg.norm(along))

        def clear(stop_m: float) -> bool:
            ahead = np.arange(0.0, stop_m + _AHEAD_M, _AHEAD_M)[:, None] * along / length
            return not constraints.shortfall(request, goal_m + ahead)

        travel_m, start_mps = float(back_m[-1]), request.velocity_mps
        return end_velocity(along, travel_m, start_mps, constraints.limits, self.end_speed_mps, clear)


class _AnyOrder:
    """`Model` of one rung: a spline of order k, eq. 2 and the limits."""

    retimed_from = 0.0

    def __init__(
        self, shaper: StaticSpline, request: PlanRequest, route: Route, constraints: Constraints, rung: Rung
    ) -> None:
        self.request, self.route, self.constraints = request, route, constraints
        degree, limits = shaper.order - 1, constraints.limits
        spacings = rung.finer * STEP_M * (len(route.raw) - 1) / shaper.control_spacing_m
        self.count = control_points(spacings, degree)
        self.spans = self.count - degree
        self.basis = make_uniform(degree, self.count)
        self.cost = Cost(
            basis=self.basis,
            effort_weight=shaper.control_weight,
            jerk_weight=shaper.smooth_weight,
            obstacle_weight=shaper.static_weight * rung.weight,
            tether=rung.tether,
            field=request.field,
            safe_m=constraints.safe_clearance_m,
            hard_m=hard_m(constraints, request.field.voxel_size_m),
            limits=(limits.max_speed_mps, limits.max_acceleration_mps2),
            bounds=route.bounds,
        )

    def guess(self, points_m: Float, times_s: Float, duration_s: float) -> Float:
        """A control point lies where its basis function peaks."""
        h = duration_s / self.spans
        peaks = (np.arange(self.count) - 0.5 * (self.basis.degree - 1)) * h * float(times_s[-1]) / duration_s
        return np.stack([np.interp(peaks, times_s, points_m[:, axis]) for axis in range(3)], axis=1)

    def pin(self, curve: Curve) -> Curve:
        pin_ends(self.basis, curve.control, curve.h, self.route.start, self.route.end)
        return curve

    def improve(self, curve: Curve, rounds: int) -> tuple[Curve, bool, int]:
        control, h = curve
        points, raw = self.basis.samples @ control, self.route.raw
        apart = ((points[:, None, :] - raw[None, :, :]) ** 2).sum(axis=2)
        tied = raw[np.argmin(apart, axis=1)]
        for count in range(1, rounds + 1):
            step, flag = solve_qp(
                *local_model(self.cost, control, h, tied), *limit_rows(self.cost, control, h)
            )
            if flag < 1:
                return Curve(control, h), False, count
            control, gained = line_search(self.cost, control, step.reshape(-1, 3), h, tied)
            if gained < _TOLERANCE:
                break
        return Curve(control, h), True, count

    def points(self, curve: Curve) -> Float:
        flown = self.trajectory(curve)
        return evaluate(flown, instants(flown))[0]

    def excess(self, curve: Curve) -> float:
        """At `instants`."""
        return limit_excess(self.trajectory(curve), self.constraints.limits, curve.h)

    def shortfall(self, curve: Curve) -> str:
        """At `instants`."""
        return self.constraints.shortfall(self.request, self.points(curve))

    def trajectory(self, curve: Curve) -> Trajectory:
        at_rest = self.request.goal.is_target
        return to_trajectory(self.basis.power, curve.control, curve.h, self.request.time_s, at_rest)
