"""Motions between two states that keep ‖v‖ <= v_max and ‖a‖ <= a_max, and bounds on their time.

The motion is the cubic that joins position and velocity at both ends in time T, the one of least
∫‖a‖² (Webb and van den Berg 2013). Of the edges that METHODS.md allows it is the one on which the
norm limits can be had exactly: acceleration is linear in time, so its norm is greatest at an end,
and velocity is a quadratic inside the hull of its Bezier points. Bang-bang motions need bounds per
axis, a/√3 and v/√3, which cost up to 32 % of the time and depend on how the axes lie; the cubic's
time is 22 % above the bang-bang one from rest to rest, in every direction.

Lower bound: a motion projected on any fixed direction keeps the scalar limits, so the scalar
minimum time along the line from one end to the other, which has a closed form, bounds every motion
between the two states (the dynamic reachability of paper 4); so does ‖Δv‖ / a_max.

States are (6,): position m, velocity m/s.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from uavexp.arrays import Float

_SCAN = 16  # durations tried between the lower bound and the longest
_BISECTIONS = 6  # take the first that fits to 1/64 of a scanning step
_PARTS = 4  # pieces of the velocity's Bezier hull
_ROUNDING = 1.0 + 1e-9


@nb.njit(cache=True)
def scalar_time(distance: float, start: float, end: float, top: float, strongest: float) -> float:
    """Least time over a distance in one dimension, with |v| <= top and |a| <= strongest.

    Args:
        distance: m, either sign.
        start: velocity at the start, m/s.
        end: velocity at the end, m/s.
        top: m/s.
        strongest: m/s².
    """
    direct = 0.5 * (start + end) * abs(end - start) / strongest
    sign = 1.0 if distance >= direct else -1.0
    peak = np.sqrt(max(sign * distance * strongest + 0.5 * (start * start + end * end), 0.0))
    if peak <= top:
        return float((abs(sign * peak - start) + abs(sign * peak - end)) / strongest)
    cruise = sign * top
    first, last = abs(cruise - start) / strongest, abs(cruise - end) / strongest
    left = distance - 0.5 * (start + cruise) * first - 0.5 * (end + cruise) * last
    return float(first + last + max(left / cruise, 0.0))


@nb.njit(cache=True)
def least_time(start: Float, end: Float, top: float, strongest: float) -> float:
    """Lower bound on the time of every motion from one state (6,) to another within the limits."""
    dx, dy, dz = end[0] - start[0], end[1] - start[1], end[2] - start[2]
    away = np.sqrt(dx * dx + dy * dy + dz * dz)
    ux, uy, uz = end[3] - start[3], end[4] - start[4], end[5] - start[5]
    turn = np.sqrt(ux * ux + uy * uy + uz * uz) / strongest
    if away < 1e-12:
        return float(turn)
    v0 = (start[3] * dx + start[4] * dy + start[5] * dz) / away
    v1 = (end[3] * dx + end[4] * dy + end[5] * dz) / away
    return float(max(turn, scalar_time(away, v0, v1, top, strongest)))


@nb.njit(cache=True)
def keeps_limits(start: Float, end: Float, duration_s: float, top: float, strongest: float) -> bool:
    """Whether the cubic between two states (6,) keeps both norm limits on the whole of it.

    Exact in acceleration; in speed a bound from above, 1/64 of the velocity's bend at most too strict.
    """
    t = duration_s
    a0 = a1 = 0.0
    for k in range(3):
        step, u, w = end[k] - start[k], start[3 + k], end[3 + k]
        a0 += (6.0 * step / t - 4.0 * u - 2.0 * w) ** 2
        a1 += (6.0 * step / t - 2.0 * u - 4.0 * w) ** 2
    if max(a0, a1) > (strongest * t * _ROUNDING) ** 2:
        return False
    limit = (top * _ROUNDING) ** 2
    for part in range(_PARTS):
        s, wide = part / _PARTS, 1.0 / _PARTS
        at_start = at_middle = at_end = 0.0
        for k in range(3):
            u, w = start[3 + k], end[3 + k]
            b = 3.0 * (end[k] - start[k]) / t - u - w  # the middle Bezier point
            v = (1 - s) * (1 - s) * u + 2.0 * s * (1 - s) * b + s * s * w
            slope, bend = 2.0 * ((1 - s) * (b - u) + s * (w - b)), 2.0 * (u - 2.0 * b + w)
            at_start += v * v
            at_middle += (v + 0.5 * wide * slope) ** 2
            at_end += (v + wide * slope + 0.5 * wide * wide * bend) ** 2
        if max(at_start, at_middle, at_end) > limit:
            return False
    return True


@nb.njit(cache=True)
def cubic_time(start: Float, end: Float, longest_s: float, top: float, strongest: float) -> float:
    """Least time, of those scanned, of a cubic between two states (6,) within the limits; inf if none.

    The times that fit are a union of intervals (a slow arrival needs no more of the limits than a fast
    one, one in between may), so they are scanned upwards from the lower bound, then bisected.

    Args:
        start: (6,).
        end: (6,).
        longest_s: no longer motion is an edge, s.
        top: m/s.
        strongest: m/s².
    """
    low = max(least_time(start, end, top, strongest), 1e-3)
    if low > longest_s:
        return np.inf
    ratio = min(longest_s / low, 4.0) ** (1.0 / _SCAN)
    high = low
    if keeps_limits(start, end, low, top, strongest):
        return float(low)
    for _ in range(_SCAN):
        high = low * ratio
        if keeps_limits(start, end, high, top, strongest):
            for _ in range(_BISECTIONS):
                middle = 0.5 * (low + high)
                if keeps_limits(start, end, middle, top, strongest):
                    high = middle
                else:
                    low = middle
            return float(high)
        low = high
    return np.inf


@nb.njit(cache=True)
def cubic_coefficients(start: Float, end: Float, duration_s: float) -> Float:
    """Coefficients (4, 3), ascending powers of time, of the cubic between two states (6,)."""
    out = np.empty((4, 3))
    t = duration_s
    for k in range(3):
        step = end[k] - start[k]
        out[0, k], out[1, k] = start[k], start[3 + k]
        out[2, k] = (3.0 * step / t - 2.0 * start[3 + k] - end[3 + k]) / t
        out[3, k] = (start[3 + k] + end[3 + k] - 2.0 * step / t) / (t * t)
    return out
