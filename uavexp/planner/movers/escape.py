"""Coming to rest where no mover comes: by braking, or by stepping aside first."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from uavexp.arrays import Float
from uavexp.braking import braking_trajectory
from uavexp.planner.movers.moving import MovingObstacles
from uavexp.trajectory import Trajectory, evaluate, join
from uavexp.types import Limits, PlanRequest

_DIRECTIONS = 8  # level ones that are tried
_ASIDE_MPS = 1.2  # speed of a side step; half of it is tried as well
_WAIT_S = 0.5  # held after it: time for movers to pass
_CHECK_S = 0.05


def safest_stop(
    request: PlanRequest, moving: MovingObstacles, blocked: Callable[[Float], str], limits: Limits
) -> tuple[Trajectory, bool]:
    """The way to come to rest that stays farthest from the movers, and whether it steps aside.

    Braking when that keeps the margin; movers do not look out, so where it does not, the side
    step with the largest clearance over the prediction horizon, the wait at its end included.

    Args:
        request: where and how fast the vehicle is.
        moving: the movers.
        blocked: says where a curve through points (P, 3) meets what is fixed; "" where it does not.
        limits: of the vehicle.
    """
    times_s = request.time_s + np.arange(0.0, moving.horizon_s, _CHECK_S)
    ways = stops(request, limits)
    best, best_m = 0, -np.inf
    for index, way in enumerate(ways):
        points_m = evaluate(way, times_s)[0]
        if blocked(points_m):
            continue
        clearance_m = float(moving.clearance_m(points_m, times_s).min())
        if index == 0 and clearance_m >= 0.0:
            break
        if clearance_m > best_m:
            best, best_m = index, clearance_m
    return ways[best], best > 0


def stops(request: PlanRequest, limits: Limits) -> list[Trajectory]:
    """Ways to come to rest and wait: braking first, then side steps, level, up and down.

    A side step first takes on its own velocity and then brakes from that: both by
    `braking_trajectory`, the former in the frame that moves with the side step, so acceleration
    and jerk keep their limits and the speed stays between those of start and side step.
    """
    zero = np.zeros(3)
    angles = np.arange(_DIRECTIONS) * (2.0 * np.pi / _DIRECTIONS)
    level = np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
    upright = np.array([[0.0, 0.0, 0.5], [0.0, 0.0, -0.5]])
    ways = []
    for velocity in [zero, *(_ASIDE_MPS * np.concatenate([level, 0.5 * level, upright]))]:
        turning = _taking_on(velocity, request, limits)
        end_m = evaluate(turning, np.array([turning.end_s]))[0][0]
        if velocity.any():
            braking = braking_trajectory(turning.end_s, end_m, velocity, zero, limits)
            turning = join(turning, braking)
            end_m = evaluate(turning, np.array([turning.end_s]))[0][0]
        wait = Trajectory(
            breaks_s=turning.end_s + np.array([0.0, _WAIT_S]), coefficients=end_m[None, None], at_rest=True
        )
        ways.append(join(turning, wait))
    return ways


def _taking_on(velocity_mps: np.ndarray, request: PlanRequest, limits: Limits) -> Trajectory:
    """From the request's state to a velocity, as fast as acceleration and jerk allow."""
    relative = braking_trajectory(
        request.time_s,
        request.position_m,
        request.velocity_mps - velocity_mps,
        request.acceleration_mps2,
        limits,
    )
    coefficients = relative.coefficients.copy()
    coefficients[:, 0] += (relative.breaks_s[:-1, None] - request.time_s) * velocity_mps
    coefficients[:, 1] += velocity_mps
    return replace(relative, coefficients=coefficients, at_rest=not velocity_mps.any())
