"""Uniform cubic B-splines: their energy and samples written in CasADi, and the kernels of the flown loop.

Control points c_0 .. c_{N-1}, M = N - 3 segments of equal duration h (`uniform`). Acceleration is
linear on a segment, so its norm is greatest at a knot: the limit at the knots is exact.
Velocity is a quadratic, bounded by its Bezier points.
"""

from __future__ import annotations

from functools import cache

import casadi as ca
import numba as nb
import numpy as np

from uavexp.arrays import Float
from uavexp.planner.spline.uniform import SAMPLES, Uniform, make_uniform, power_matrix


@cache
def segment_model() -> ca.Function:
    """CasADi function of one segment's control points (4,): its energy and its SAMPLES points."""
    control, u = ca.SX.sym("c", 4), ca.SX.sym("u")
    position = ca.dot(ca.vertcat(1, u, u**2, u**3), ca.DM(power_matrix(3)) @ control)
    acceleration = ca.jacobian(ca.jacobian(position, u), u)
    curve = ca.Function("curve", [control, u], [position, acceleration])
    first, last = curve(control, 0)[1], curve(control, 1)[1]
    energy = (first * first + first * last + last * last) / 3  # ∫ of a linear function squared
    samples = [curve(control, (k + 0.5) / SAMPLES)[0] for k in range(SAMPLES)]
    return ca.Function("segment", [control], [energy, ca.vertcat(*samples)])


@cache
def make_cubic(count: int) -> Uniform:
    """Write the minimum-acceleration problem of one axis in CasADi and take its matrices.

    Built once per number of control points and process; every request reuses it.

    Args:
        count: N >= 7 control points.
    """
    control, segment = ca.SX.sym("c", count), segment_model()
    parts = [segment(control[m : m + 4]) for m in range(count - 3)]
    energy = sum((part[0] for part in parts), ca.SX(0))
    samples = ca.vertcat(*[part[1] for part in parts])
    hessian, position = ca.hessian(energy, control)[0], ca.jacobian(samples, control)
    matrices = ca.Function("matrices", [], [hessian, position])()
    return make_uniform(3, count)._replace(
        effort=np.ascontiguousarray(0.5 * matrices["o0"].full()),
        samples=np.ascontiguousarray(matrices["o1"].full()),
    )


@nb.njit(cache=True)
def pin_ends(control: Float, h: float, start: Float, end: Float) -> None:
    """Set the first and last three control points (N, 3) to these end states, in place.

    Args:
        control: (N, 3), m.
        h: knot spacing, s.
        start: position, velocity and acceleration at the start, (3, 3).
        end: the same at the end, (3, 3).
    """
    n = control.shape[0]
    for axis in range(3):
        for base, state in ((0, start), (n - 3, end)):
            bend = h * h * state[2, axis]
            middle = state[0, axis] - bend / 6.0
            control[base, axis] = middle + 0.5 * bend - h * state[1, axis]
            control[base + 1, axis] = middle
            control[base + 2, axis] = middle + 0.5 * bend + h * state[1, axis]


@nb.njit(cache=True)
def peak_acceleration(control: Float, h: float) -> float:
    """Greatest norm of the acceleration along the spline, m/s²; exact."""
    peak = 0.0
    for i in range(control.shape[0] - 2):
        square = 0.0
        for axis in range(3):
            square += (control[i, axis] - 2.0 * control[i + 1, axis] + control[i + 2, axis]) ** 2
        peak = max(peak, square)
    return float(np.sqrt(peak) / (h * h))


@nb.njit(cache=True)
def peak_speed(control: Float, h: float) -> float:
    """Bound on the speed along the spline, m/s: exact from above, by less than 1/64 of its bend.

    Each segment's velocity, a quadratic, is cut into four; a piece lies in the hull of its
    Bezier points.
    """
    peak = 0.0
    parts = 4
    for m in range(control.shape[0] - 3):
        for part in range(parts):
            u, w = part / parts, 1.0 / parts
            at_start, at_middle, at_end = 0.0, 0.0, 0.0
            for axis in range(3):
                d0 = control[m + 1, axis] - control[m, axis]
                d1 = control[m + 2, axis] - control[m + 1, axis]
                d2 = control[m + 3, axis] - control[m + 2, axis]
                v = 0.5 * (1 - u) * (1 - u) * d0 + (0.5 + u - u * u) * d1 + 0.5 * u * u * d2
                slope = (1 - u) * (d1 - d0) + u * (d2 - d1)
                bend = d2 - 2.0 * d1 + d0
                at_start += v * v
                at_middle += (v + 0.5 * w * slope) ** 2
                at_end += (v + w * slope + 0.5 * w * w * bend) ** 2
            peak = max(peak, at_start, at_middle, at_end)
    return float(np.sqrt(peak) / h)


@nb.njit(cache=True)
def sample_spline(control: Float, per_segment: int) -> Float:
    """Points (per_segment * M + 1, 3) at equal steps of the parameter, both ends included, m."""
    segments = control.shape[0] - 3
    points = np.empty((per_segment * segments + 1, 3))
    for n in range(points.shape[0]):
        m = min(n // per_segment, segments - 1)
        u = (n - m * per_segment) / per_segment
        b0 = (1 - u) ** 3 / 6.0
        b1 = (4.0 - 6.0 * u * u + 3.0 * u**3) / 6.0
        b3 = u**3 / 6.0
        b2 = 1.0 - b0 - b1 - b3
        for axis in range(3):
            points[n, axis] = (
                b0 * control[m, axis]
                + b1 * control[m + 1, axis]
                + b2 * control[m + 2, axis]
                + b3 * control[m + 3, axis]
            )
    return points
