"""Small quadratic programmes with a banded Hessian, in microseconds: a dual active set in one kernel.

    least xᵀ H x / 2 + gᵀ x with A x <= u

Goldfarb and Idnani (1983): from the unconstrained optimum the most violated row is made active, along the
path on which the multipliers stay non-negative; rows whose multiplier falls to zero leave. In y = Lᵀ x,
H = L Lᵀ, steps are least squares over the active rows. A library that knows no band (`qp`) spends nine
tenths of such a problem on setting up.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Float, Int

_TOLERANCE = 1e-9  # of a row's violation
_MOST_ACTIVE = 40
_ROUNDS = 120


class Rows(NamedTuple):
    """A x <= u whose rows have their entries side by side."""

    entries: Float  # (R, W)
    first: Int  # (R,) of which variable the first entry is
    width: Int  # (R,) so many entries count
    upper: Float  # (R,) u


@nb.njit(cache=True)
def solve_band_qp(hessian: Float, gradient: Float, rows: Rows, band: int) -> tuple[Float, bool]:
    """The optimum x (n,), and whether it was reached; False says nothing about the programme.

    Args:
        hessian: (n, n) positive definite, zero farther than `band` from its diagonal.
        gradient: (n,).
        rows: A and u.
        band: half the bandwidth.
    """
    factor = _factored(hessian, band)
    x = -_up(factor, _down(factor, gradient, band), band)
    turned = np.empty((_MOST_ACTIVE + 1, len(x)))  # L⁻¹ a of each active row, then of the one that enters
    force = np.zeros(_MOST_ACTIVE + 1)  # their multipliers
    size, worst = 0, -1
    for _ in range(_ROUNDS):
        if worst < 0:
            worst = _most_violated(rows, x)
            if worst < 0:
                return x, True
            if size == _MOST_ACTIVE:
                return x, False
            turned[size] = _down(factor, dense(rows, worst, len(x)), band)
            force[size] = 0.0
        share, rest = _projected(turned[:size], turned[size])
        free = (rest * rest).sum()
        full = np.inf
        if free > 1e-12 * (turned[size] * turned[size]).sum():
            full = _violation(rows, worst, x) / free
        leaving, least = -1, full
        for i in range(size):
            if share[i] > 0.0 and force[i] < least * share[i]:
                leaving, least = i, force[i] / share[i]
        if not np.isfinite(least):
            return x, False
        if np.isfinite(full):
            x -= least * _up(factor, rest, band)
        force[:size] -= least * share
        force[size] += least
        if leaving < 0:
            size, worst = size + 1, -1
        else:
            for i in range(leaving, size):
                force[i], turned[i] = force[i + 1], turned[i + 1]
            size -= 1
    return x, False


@nb.njit(cache=True)
def _factored(hessian: Float, band: int) -> Float:
    """L (n, band + 1) of H = L Lᵀ: row i holds its entries i - band .. i."""
    n = len(hessian)
    factor = np.zeros((n, band + 1))
    for i in range(n):
        for j in range(max(i - band, 0), i + 1):
            left = hessian[i, j]
            for k in range(max(i - band, 0), j):
                left -= factor[i, k - i + band] * factor[j, k - j + band]
            factor[i, j - i + band] = np.sqrt(left) if i == j else left / factor[j, band]
    return factor


@nb.njit(cache=True)
def _down(factor: Float, of: Float, band: int) -> Float:
    """L⁻¹ b."""
    out = np.empty(len(of))
    for i in range(len(of)):
        left = of[i]
        for k in range(max(i - band, 0), i):
            left -= factor[i, k - i + band] * out[k]
        out[i] = left / factor[i, band]
    return out


@nb.njit(cache=True)
def _up(factor: Float, of: Float, band: int) -> Float:
    """L⁻ᵀ b."""
    out = of.copy()
    for i in range(len(of) - 1, -1, -1):
        out[i] /= factor[i, band]
        for k in range(max(i - band, 0), i):
            out[k] -= factor[i, k - i + band] * out[i]
    return out


@nb.njit(cache=True)
def dense(rows: Rows, r: int, size: int) -> Float:
    """Row r (size,) of A."""
    row = np.zeros(size)
    for i in range(rows.width[r]):
        row[rows.first[r] + i] = rows.entries[r, i]
    return row


@nb.njit(cache=True, inline="always")
def _violation(rows: Rows, r: int, x: Float) -> float:
    """By how much a row exceeds its side, a x - u."""
    value = -rows.upper[r]
    for i in range(rows.width[r]):
        value += rows.entries[r, i] * x[rows.first[r] + i]
    return float(value)


@nb.njit(cache=True)
def _most_violated(rows: Rows, x: Float) -> int:
    """The row that x violates most; -1: none."""
    worst, most = -1, _TOLERANCE
    for r in range(len(rows.upper)):
        value = _violation(rows, r, x)
        if value > most:
            worst, most = r, value
    return worst


@nb.njit(cache=True)
def _projected(turned: Float, new: Float) -> tuple[Float, Float]:
    """Least squares of `new` (n,) over the active rows (k, n): shares (k,), and what is left (n,)."""
    k = len(turned)
    rest = new.copy()
    if k == 0:
        return np.empty(0), rest
    gram, share = np.empty((k, k)), np.empty(k)
    for i in range(k):
        for j in range(i + 1):
            gram[i, j] = (turned[i] * turned[j]).sum()
        share[i] = (turned[i] * new).sum()
    factor = _factored(gram, k - 1)
    share = _up(factor, _down(factor, share, k - 1), k - 1)
    for i in range(k):
        rest -= share[i] * turned[i]
    return share, rest
