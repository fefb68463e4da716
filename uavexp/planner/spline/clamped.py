"""Clamped uniform B-splines in Bezier form: everything the QP needs, exact.

N control points c_i, degree d, M = N - d spans of equal duration h, end knots of multiplicity
d + 1, so that the curve begins at c_0 and ends at c_{N-1}. On span m the curve is the Bezier
curve of b_m = E_m c (E: Bezier extraction, Borden et al. 2011), with Bernstein polynomials
of u = t / h - m. From E follow, by differences of Bezier points and the closed-form Gram matrix of
Bernstein polynomials, the exact Q_ij = ∫ N_i⁽ᵏ⁾ N_j⁽ᵏ⁾ dt, and the power coefficients of a
`Trajectory`. Matrices are for h = 1: r⁽ᵏ⁾ scales with h⁻ᵏ, Q with h¹⁻²ᵏ.
"""

from __future__ import annotations

from functools import cache
from math import comb, factorial
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline

from uavexp.arrays import Float
from uavexp.trajectory import Trajectory


class Basis(NamedTuple):
    """Matrices of one axis of a spline of degree d with N control points and M = N - d spans."""

    degree: int
    bezier: Float  # (M, d+1, N) Bezier points of each span = bezier @ c
    energy: Float  # (N, N) Q of the derivative that is minimised
    velocity: Float  # (N-1, N) control points of r'
    acceleration: Float  # (N-2, N) control points of r''
    first: Float  # (3, 3) [r, r', r''] at the start = first @ c[:3]
    last: Float  # (3, 3) the same at the end = last @ c[-3:]


def bernstein_gram(degree: int) -> Float:
    """Integrals (degree+1, degree+1) over [0, 1] of products of two Bernstein polynomials."""
    n = degree
    return np.array(
        [
            [comb(n, i) * comb(n, j) / ((2 * n + 1) * comb(2 * n, i + j)) for j in range(n + 1)]
            for i in range(n + 1)
        ]
    )


def derivative_points(bezier: Float, order: int) -> Float:
    """Bezier points (M, d+1-order, ...) of a derivative with respect to u, of points (M, d+1, ...)."""
    for _ in range(order):
        bezier = (bezier.shape[1] - 1) * np.diff(bezier, axis=1)
    return bezier


@cache
def make_basis(degree: int, spans: int, derivative: int) -> Basis:
    """Matrices of a clamped uniform spline, h = 1; built once per size and process.

    Args:
        degree: d >= 3.
        spans: M >= 1.
        derivative: k of the energy ∫ ‖r⁽ᵏ⁾‖², k <= d.
    """
    count = spans + degree
    knots = np.concatenate([np.zeros(degree), np.arange(spans + 1.0), np.full(degree, float(spans))])
    spline, starts = BSpline(knots, np.eye(count), degree), np.arange(float(spans))
    power = np.stack([spline(starts, nu=j) / factorial(j) for j in range(degree + 1)])  # (d+1, M, N)
    to_bezier = np.array(
        [[comb(i, j) / comb(degree, j) for j in range(degree + 1)] for i in range(degree + 1)]
    )
    bezier = np.ascontiguousarray(np.einsum("ij,jmn->min", to_bezier, power))
    high = derivative_points(bezier, derivative)
    energy = np.einsum("mia,ij,mjb->ab", high, bernstein_gram(degree - derivative), high)
    velocity = _difference(knots, degree, np.eye(count))
    acceleration = _difference(knots[1:-1], degree - 1, velocity)
    ends = [np.stack([derivative_points(bezier, k)[m, m] for k in range(3)]) for m in (0, -1)]
    return Basis(
        degree, bezier, 0.5 * (energy + energy.T), velocity, acceleration, ends[0][:, :3], ends[1][:, -3:]
    )


def _difference(knots: Float, degree: int, points: Float) -> Float:
    """Control points of the derivative of a spline with these control points (N, ...)."""
    count = len(points)
    apart = knots[degree + 1 : degree + count] - knots[1:count]
    return degree * np.diff(points, axis=0) / apart[:, None]


def end_points(basis: Basis, h: float, start: Float, end: Float) -> Float:
    """The three first and three last control points (6, 3) that give these end states.

    Args:
        basis: of the spline.
        h: duration of a span, s.
        start: (3, 3) position, velocity, acceleration.
        end: (3, 3) the same.
    """
    scale = h ** np.arange(3)[:, None]
    return np.concatenate(
        [np.linalg.solve(basis.first, scale * start), np.linalg.solve(basis.last, scale * end)]
    )


def to_trajectory(basis: Basis, control: Float, h: float, start_s: float, at_rest: bool) -> Trajectory:
    """Trajectory of one polynomial per span, of control points (N, 3)."""
    points = basis.bezier @ control  # (M, d+1, 3)
    terms = [derivative_points(points, k)[:, 0] / (factorial(k) * h**k) for k in range(basis.degree + 1)]
    breaks: Float = start_s + h * np.arange(len(points) + 1.0)
    return Trajectory(breaks_s=breaks, coefficients=np.stack(terms, axis=1), at_rest=at_rest)
