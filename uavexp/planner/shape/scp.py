"""Shaper `scp`: least acceleration among obstacles and predicted movers (METHODS.md, paper 1).

    min over r(t) of ∫₀ᵀ ‖r''‖² + τ² ‖r'''‖² + λ c(r) dt
    r, r', r'' at 0 as requested; r(T) = goal; ‖r'‖ <= v_max, ‖r''‖ <= a_max on [0, T]

r is a uniform cubic B-spline. The energy and the sampling of the curve are written in CasADi
(`spline`) and its matrices taken once. Each step builds the convex local model of the obstacle cost
in numba (`scp_step`) and solves a QP (`band_qp`); a line search on the true cost follows. Limits are
rows of the QP, checked exactly after it. Duration, stretching and ladder: `successive`. The jerk is
ours (τ = 0: the paper's): at the same duration a smoother curve is tracked better and flown faster.

Clearance: hard, checked every half voxel on the result. Movers are obstacles at their predicted
places, each at its own instant (`moving`): at the samples' instants, and hard on the result.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Annotated, ClassVar

import numpy as np

from uavexp.arrays import Float
from uavexp.braking import jerk_mps3
from uavexp.field import DistanceField
from uavexp.parameters import Count, NonNegative, Positive, between, option
from uavexp.planner.constraints import Constraints
from uavexp.planner.find.base import FoundPath
from uavexp.planner.movers.moving import MovingObstacles
from uavexp.planner.shape.base import ShapedPath
from uavexp.planner.shape.excess import unavoidable
from uavexp.planner.shape.scp_step import Merit, advance
from uavexp.planner.shape.start import TANGENT_M
from uavexp.planner.shape.successive import (
    MOST_POINTS,
    QP_SHARE,
    Curve,
    Effort,
    Route,
    Rung,
    climb,
    control_points,
    hard_m,
    route_of,
)
from uavexp.planner.shape.timing import STEP_M, place_by_time
from uavexp.planner.spline.cubic import (
    make_cubic,
    peak_acceleration,
    peak_speed,
    pin_ends,
    sample_spline,
)
from uavexp.planner.spline.uniform import SAMPLES, to_trajectory
from uavexp.trajectory import Trajectory
from uavexp.types import PlanRequest

_UNKNOWN_TETHER = 400.0  # of samples within a voxel of unknown space, when that is not to be entered
_AROUND = np.vstack([np.zeros(3), np.eye(3), -np.eye(3)])


@option
class Scp:
    """Least acceleration by sequential convex programming; see the module."""

    sees_movers: ClassVar[bool] = True

    obstacle_weight: Positive = 270.0  # m²/s⁴, lambda: what a surface's touch is worth as a squared
    # acceleration [ours]
    end_speed_mps: NonNegative = 1.5  # m/s, speed at a goal that is not the target, if there is room to
    # stop behind it [ours]
    duration_margin: Annotated[float, between(1, 10)] = 1.1  # 1, factor on the time-optimal traversal of
    # the curve [ours]
    control_spacing_m: Positive = 0.6  # m, path length per control point [ours]
    first_iterations: Count = 1  # QPs before the curve is timed anew [ours]
    final_iterations: Count = 2  # QPs at most after that, and after each stretching of the duration [ours]
    tolerance: Positive = 0.01  # 1, a smaller relative gain in cost ends the iteration [ours]
    jerk_s: NonNegative = 0.7  # s, tau: a jerk j counts as an acceleration of tau j; 0: as in the paper
    # [ours]

    def __post_init__(self) -> None:
        for count in range(10, MOST_POINTS + 1, 2):
            make_cubic(count)  # cached: no request pays for it

    def shape(
        self, request: PlanRequest, found: FoundPath, constraints: Constraints, movers: MovingObstacles
    ) -> ShapedPath:
        """Return a trajectory or the reason why there is none (`Shaper.shape`)."""
        route = route_of(request, found.path_m, constraints.z_band_m)
        if not request.goal.is_target:
            end_speed = min(self.end_speed_mps, constraints.limits.max_speed_mps)
            route.end[1] = _end_velocity(route, request.field, constraints, end_speed)
        effort = Effort(self.duration_margin, self.first_iterations, self.final_iterations)
        make = partial(_Cubic, self, request, route, constraints, movers)
        return climb(route, constraints.limits, effort, make)


def _end_velocity(route: Route, field: DistanceField, constraints: Constraints, end_speed: float) -> Float:
    """Velocity (3,) along the path's end, no more than can be reached, and stopped from beyond it."""
    path, goal, limits = route.path, route.end[0], constraints.limits
    along = goal - path[max(len(path) - 1 - round(TANGENT_M / STEP_M), 0)]
    length = float(np.linalg.norm(along))
    if length < 1e-6 or end_speed == 0.0:
        return np.zeros(3)
    along /= length
    travel = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
    reachable = float(route.start[1] @ route.start[1]) + limits.max_acceleration_mps2 * travel
    # Stop as flown: jerk-limited, v²/(2a) + v a/(2j) (`brake`)
    ramp = limits.max_acceleration_mps2 / (2.0 * jerk_mps3(limits))
    stop_m = end_speed**2 / (2.0 * limits.max_acceleration_mps2) + end_speed * ramp
    ahead = np.arange(1, math.ceil(stop_m / STEP_M) + 1) * STEP_M
    beyond = goal + ahead[:, None] * along
    free = field.distance_m(beyond) >= constraints.min_clearance_m
    free &= ((beyond >= route.bounds[0]) & (beyond <= route.bounds[1])).all(axis=1)
    if constraints.known_only:
        free &= field.observed(beyond)
    room = ahead[-1] if free.all() else ahead[np.argmin(free)] - STEP_M
    stoppable = limits.max_acceleration_mps2 * (
        math.sqrt(ramp**2 + 2.0 * room / limits.max_acceleration_mps2) - ramp
    )
    velocity: Float = min(end_speed, math.sqrt(reachable), stoppable) * along
    return velocity


class _Cubic:
    """`Model` of one rung: a cubic spline, its merit and limits."""

    retimed_from = 0.03

    def __init__(
        self,
        shaper: Scp,
        request: PlanRequest,
        route: Route,
        constraints: Constraints,
        movers: MovingObstacles,
        rung: Rung,
    ) -> None:
        self.shaper, self.request, self.route, self.rung = shaper, request, route, rung
        self.constraints, self.movers = constraints, movers
        length = STEP_M * (len(route.raw) - 1)
        self.spline = spline = make_cubic(control_points(rung.finer * length / shaper.control_spacing_m, 3))
        self.spans = len(spline.velocity) - 2
        limits, field = constraints.limits, request.field
        samples = len(spline.samples)
        self.merit = Merit(
            h=0.0,
            energy=spline.effort,
            position=spline.samples,
            distance=field.distance,
            origin_m=field.origin_m,
            voxel_m=field.voxel_size_m,
            obstacle_weight=shaper.obstacle_weight * rung.weight,
            safe_m=constraints.safe_clearance_m,
            hard_m=hard_m(constraints, field.voxel_size_m),
            least_m=constraints.min_clearance_m,
            tether_m=np.zeros((samples, 3)),
            tether_weight=np.zeros(samples),
            limits=QP_SHARE * np.array([limits.max_speed_mps, limits.max_acceleration_mps2]),
            movers=movers.table(request.time_s),
        )

    def guess(self, points_m: Float, times_s: Float, duration_s: float) -> Float:
        h, stretch = duration_s / self.spans, duration_s / float(times_s[-1])
        control: Float = place_by_time(points_m, times_s, self.spans + 3, h, stretch)
        return control

    def pin(self, curve: Curve) -> Curve:
        pin_ends(curve.control, curve.h, self.route.start, self.route.end)
        return curve

    def improve(self, curve: Curve, rounds: int) -> tuple[Curve, bool, int]:
        control, h = curve
        self.merit = self.merit._replace(
            h=h, energy=self.spline.effort + (self.shaper.jerk_s / h) ** 2 * self.spline.jerk
        )
        for count in range(1, rounds + 1):
            by = self._tethered(control)
            control, gained, solved = advance(control, by, self.route.bounds)
            if not solved:
                return Curve(control, h), False, count
            if gained < self.shaper.tolerance:
                break
        return Curve(control, h), True, count

    def _tethered(self, control: Float) -> Merit:
        """Samples tied to the nearest points of the path as found, where this rung or the unknown asks."""
        known_only, raw, field = self.constraints.known_only, self.route.raw, self.request.field
        if self.rung.tether == 0.0 and not known_only:
            return self.merit
        points = self.merit.position @ control
        apart = ((points[:, None, :] - raw[None, :, :]) ** 2).sum(axis=2)
        weight = np.full(len(points), self.rung.tether)
        if known_only:
            around = (points[:, None, :] + field.voxel_size_m * _AROUND).reshape(-1, 3)
            known = field.observed(around).reshape(-1, len(_AROUND)).all(axis=1)
            weight[~known] += _UNKNOWN_TETHER
        return self.merit._replace(tether_m=raw[np.argmin(apart, axis=1)], tether_weight=weight)

    def points(self, curve: Curve) -> Float:
        points: Float = sample_spline(curve.control, 2 * SAMPLES)
        return points

    def excess(self, curve: Curve) -> float:
        """Exact."""
        limits = self.constraints.limits
        _, velocity, acceleration = self.route.start
        fast, strong = unavoidable(velocity, acceleration, limits.max_acceleration_mps2, curve.h)
        top = max(limits.max_speed_mps, fast) * (1.0 + 1e-9)
        most = max(limits.max_acceleration_mps2, strong) * (1.0 + 1e-9)
        too_strong: float = peak_acceleration(curve.control, curve.h) / most
        too_fast: float = peak_speed(curve.control, curve.h) / top
        return max(too_fast, math.sqrt(too_strong))

    def shortfall(self, curve: Curve) -> str:
        """Every half voxel."""
        request, constraints = self.request, self.constraints
        longest = peak_speed(curve.control, curve.h) * curve.h  # segment
        per_segment = max(math.ceil(longest / (0.5 * request.field.voxel_size_m)), 1)
        points = sample_spline(curve.control, per_segment)
        fixed = constraints.shortfall(request, points)
        if fixed or not len(self.movers):
            return fixed
        times = request.time_s + np.arange(len(points), dtype=np.float64) * (curve.h / per_segment)
        return self.movers.shortfall(points, times, constraints.limits.max_acceleration_mps2)

    def trajectory(self, curve: Curve) -> Trajectory:
        request = self.request
        return to_trajectory(
            self.spline.power, curve.control, curve.h, request.time_s, request.goal.is_target
        )
