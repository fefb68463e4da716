"""Uniform B-splines of any order: matrices for h = 1.

Order k is degree d = k - 1. N control points c_0 .. c_{N-1} make M = N - d spans of equal
duration h; on span m, with u = t / h - m in [0, 1], r = [1 u .. u^d] P [c_m .. c_{m+d}].
The first d control points say position and the first d - 1 derivatives at the start; the same d
points d times over are a stop there (Jin, Xu et al., eq. 1). r⁽ʲ⁾ scales with h⁻ʲ, ∫ ‖r⁽ʲ⁾‖² with h¹⁻²ʲ.
"""

from __future__ import annotations

from functools import cache
from math import factorial
from typing import NamedTuple

import numba as nb
import numpy as np
from scipy.interpolate import BSpline

from uavexp.arrays import Float
from uavexp.trajectory import Trajectory

SAMPLES = 4  # points per span at which obstacles are felt, in the middle of equal parts


class Uniform(NamedTuple):
    """Matrices of one axis of a spline of degree d with N control points."""

    degree: int
    power: Float  # (d+1, d+1) coefficients of a span = power @ its control points
    samples: Float  # (S, N) points = samples @ c
    tangents: Float  # (S, N) r' at the samples
    effort: Float  # (N, N) of ∫ r''²
    jerk: Float  # (N, N) of ∫ r'''²
    velocity: Float  # (N-1, N) control points of r'
    acceleration: Float  # (N-2, N) control points of r''
    first: Float  # (d, d) derivatives 0 .. d-1 at the start = first @ c[:d]
    last: Float  # (d, d) at the end = last @ c[-d:]


def _piece(degree: int) -> BSpline:
    """The degree + 1 basis functions that are not zero on the span [0, 1]."""
    return BSpline(np.arange(-degree, degree + 2.0), np.eye(degree + 1), degree)


@cache
def power_matrix(degree: int) -> Float:
    """P (d+1, d+1): coefficients of a span's polynomial = P @ its control points."""
    piece = _piece(degree)
    return np.stack([piece(0.0, nu=j) / factorial(j) for j in range(degree + 1)])


@cache
def make_uniform(degree: int, count: int) -> Uniform:
    """Matrices of a spline; built once per size and process.

    Args:
        degree: d >= 3, so that acceleration is continuous.
        count: N >= 2 d + 1 control points.
    """
    piece, power, spans = _piece(degree), power_matrix(degree), count - degree
    u = (np.arange(SAMPLES) + 0.5) / SAMPLES
    samples, tangents = np.zeros((SAMPLES * spans, count)), np.zeros((SAMPLES * spans, count))
    effort, jerk = np.zeros((count, count)), np.zeros((count, count))
    for m in range(spans):
        there, here = slice(SAMPLES * m, SAMPLES * (m + 1)), slice(m, m + degree + 1)
        samples[there, here] = piece(u)
        tangents[there, here] = piece(u, nu=1)
        effort[here, here] += _gram(power, 2)
        jerk[here, here] += _gram(power, 3)
    ends = [np.stack([piece(at, nu=j) for j in range(degree)]) for at in (0.0, 1.0)]
    velocity = np.diff(np.eye(count), axis=0)
    acceleration = np.diff(velocity, axis=0)
    first, last = ends[0][:, :degree], ends[1][:, 1:]
    return Uniform(degree, power, samples, tangents, effort, jerk, velocity, acceleration, first, last)


def _gram(power: Float, order: int) -> Float:
    """Integrals (d+1, d+1) over a span of products of two basis functions' derivatives of this order."""
    terms = np.arange(order, len(power))
    falling = np.array([factorial(j) / factorial(j - order) for j in terms])
    high = falling[:, None] * power[order:]
    powers = terms - order
    return np.asarray(high.T @ (1.0 / (powers[:, None] + powers[None] + 1.0)) @ high)


def pin_ends(basis: Uniform, control: Float, h: float, start: Float, end: Float) -> None:
    """Set the first and last d control points (N, 3) to these end states, in place; higher derivatives 0.

    Args:
        basis: of the spline.
        control: (N, 3), m.
        h: knot spacing, s.
        start: position, velocity and acceleration at the start, (3, 3).
        end: the same at the end, (3, 3).
    """
    d = basis.degree
    wanted = np.zeros((2, d, 3))
    wanted[:, :3] = h ** np.arange(3)[:, None] * np.stack([start, end])
    control[:d] = np.linalg.solve(basis.first, wanted[0])
    control[-d:] = np.linalg.solve(basis.last, wanted[1])


def to_trajectory(power: Float, control: Float, h: float, start_s: float, at_rest: bool) -> Trajectory:
    """Trajectory of one polynomial per span.

    Args:
        power: P of the spline's degree.
        control: (N, 3), m.
        h: knot spacing, s.
        start_s: absolute time of the first knot.
        at_rest: whether it ends at rest.
    """
    coefficients: Float = _pieces(power, control, h)
    breaks: Float = start_s + h * np.arange(len(coefficients) + 1.0)
    return Trajectory(breaks_s=breaks, coefficients=coefficients, at_rest=at_rest)


@nb.njit(cache=True)
def _pieces(power: Float, control: Float, h: float) -> Float:
    """Coefficients (M, d+1, 3) of the spans, of t in seconds."""
    terms = len(power)
    out = np.zeros((len(control) - terms + 1, terms, 3))
    for m in range(len(out)):
        for i in range(terms):
            for j in range(terms):
                out[m, i] += power[i, j] * control[m + j]
            out[m, i] /= h**i
    return out
