"""How fast a curve can be flown: smoothing, resampling and the time-optimal speed profile."""

from __future__ import annotations

import numba as nb
import numpy as np

from uavexp.arrays import Float

STEP_M = 0.1  # spacing at which curves are timed


@nb.njit(cache=True)
def resample(points_m: Float, step_m: float) -> Float:
    """Points (S, 3) at equal arc length along a polyline (P, 3), both ends kept, S >= 2."""
    count = points_m.shape[0]
    along = np.zeros(count)
    for n in range(1, count):
        along[n] = along[n - 1] + np.sqrt(((points_m[n] - points_m[n - 1]) ** 2).sum())
    total = along[count - 1]
    pieces = max(int(np.ceil(total / step_m - 1e-9)), 1)
    out = np.empty((pieces + 1, 3))
    k = 0
    for n in range(pieces + 1):
        s = total * n / pieces
        while k < count - 2 and along[k + 1] < s:
            k += 1
        length = along[k + 1] - along[k]
        share = min(max((s - along[k]) / length, 0.0), 1.0) if length > 0.0 else 0.0
        out[n] = points_m[k] + share * (points_m[k + 1] - points_m[k])
    out[pieces] = points_m[count - 1]
    return out


@nb.njit(cache=True)
def smooth(points_m: Float, rounds: int) -> Float:
    """Move every inner point (P, 3) to the mean of itself and its neighbours, several times."""
    now, then = points_m.copy(), points_m.copy()
    for _ in range(rounds):
        for n in range(1, points_m.shape[0] - 1):
            for axis in range(3):
                then[n, axis] = (now[n - 1, axis] + now[n, axis] + now[n + 1, axis]) / 3.0
        now, then = then, now
    return now


@nb.njit(cache=True)
def time_profile(
    points_m: Float, start_mps: float, end_mps: float, max_speed_mps: float, max_acceleration_mps2: float
) -> Float:
    """Times (P,) at which the points of a curve are passed as early as the limits allow.

    The classical two passes (Bobrow, Dubowsky and Gibson 1985) with ‖v‖ <= v_max and the norm
    of tangential and centripetal acceleration <= a_max. Where start or end speed is beyond
    what the curve allows, the profile has the curve's speed there.

    Args:
        points_m: (P, 3), nearly equally spaced.
        start_mps: speed at the first point.
        end_mps: speed at the last point.
        max_speed_mps: speed limit.
        max_acceleration_mps2: acceleration limit.
    """
    count = points_m.shape[0]
    a2 = max_acceleration_mps2**2
    length = np.empty(count - 1)
    for n in range(count - 1):
        length[n] = max(np.sqrt(((points_m[n + 1] - points_m[n]) ** 2).sum()), 1e-9)
    bend = np.zeros(count)  # curvature, 1/m
    for n in range(1, count - 1):
        into = (points_m[n] - points_m[n - 1]) / length[n - 1]
        out = (points_m[n + 1] - points_m[n]) / length[n]
        bend[n] = np.sqrt(((out - into) ** 2).sum()) / (0.5 * (length[n - 1] + length[n]))
    square = np.empty(count)
    for n in range(count):
        square[n] = min(max_speed_mps**2, max_acceleration_mps2 / max(bend[n], 1e-9))
    square[0] = min(square[0], start_mps**2)
    square[count - 1] = min(square[count - 1], end_mps**2)
    for n in range(count - 1):
        tangential = np.sqrt(max(a2 - (square[n] * bend[n]) ** 2, 0.0))
        square[n + 1] = min(square[n + 1], square[n] + 2.0 * tangential * length[n])
    for n in range(count - 2, -1, -1):
        tangential = np.sqrt(max(a2 - (square[n + 1] * bend[n + 1]) ** 2, 0.0))
        square[n] = min(square[n], square[n + 1] + 2.0 * tangential * length[n])
    times = np.zeros(count)
    for n in range(count - 1):
        mean = 0.5 * (np.sqrt(square[n]) + np.sqrt(square[n + 1]))
        # both ends at rest on one step: half the step with full acceleration, half without
        least = np.sqrt(0.25 * max_acceleration_mps2 * length[n])
        times[n + 1] = times[n] + length[n] / max(mean, least)
    return times


@nb.njit(cache=True)
def place_by_time(points_m: Float, times_s: Float, count: int, h: float, stretch: float) -> Float:
    """First guess of `count` control points: where the profile is at the points' own instants.

    A uniform cubic B-spline nearly passes its control point i at time (i - 1) h.

    Args:
        points_m: (P, 3) timed curve.
        times_s: (P,) increasing.
        count: number of control points.
        h: knot spacing, s.
        stretch: the profile is flown this much slower.
    """
    out = np.empty((count, 3))
    k = 0
    last = points_m.shape[0] - 1
    for n in range(count):
        t = min(max((n - 1) * h / stretch, 0.0), times_s[last])
        while k < last - 1 and times_s[k + 1] < t:
            k += 1
        span = times_s[k + 1] - times_s[k]
        share = min(max((t - times_s[k]) / span, 0.0), 1.0) if span > 0.0 else 0.0
        out[n] = points_m[k] + share * (points_m[k + 1] - points_m[k])
    return out
