"""Quadratic programmes with a band, against daqp."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from uavexp.planner.shape.band_qp import Rows, dense, solve_band_qp
from uavexp.planner.shape.qp import solve_qp

BAND, WIDTH = 5, 6


def programme(seed: int, n: int, count: int) -> tuple[np.ndarray, np.ndarray, Rows]:
    """A random one; every third row repeats the one before it, a little looser or tighter."""
    rng = np.random.default_rng(seed)
    lower = np.tril(rng.normal(size=(n, n))) * (np.subtract.outer(np.arange(n), np.arange(n)) <= BAND)
    hessian = lower @ lower.T + 0.1 * np.eye(n)
    first = rng.integers(0, max(n - WIDTH, 1), count)
    width = np.minimum(rng.integers(1, WIDTH + 1, count), n - first)
    entries = rng.normal(size=(count, WIDTH))
    for again in range(2, count, 3):
        first[again], width[again], entries[again] = first[again - 1], width[again - 1], entries[again - 1]
    return hessian, rng.normal(size=n) * 5.0, Rows(entries, first, width, rng.uniform(-0.5, 1.0, count))


@given(st.integers(0, 10**6), st.integers(3, 40), st.integers(0, 60))
def test_optimum_and_infeasibility_are_those_of_daqp(seed: int, n: int, count: int) -> None:
    hessian, gradient, rows = programme(seed, n, count)
    full = np.array([dense(rows, r, n) for r in range(count)]).reshape(count, n)
    x, solved = solve_band_qp(hessian, gradient, rows, BAND)
    other, flag = solve_qp(hessian, gradient, full, rows.upper)
    assert solved == (flag > 0)
    if solved:
        assert (full @ x <= rows.upper + 1e-7).all()
        assert np.abs(x - other).max() <= 1e-5 * max(np.abs(other).max(), 1.0)


def test_no_row_leaves_the_unconstrained_optimum() -> None:
    hessian, gradient, rows = programme(1, 12, 0)
    x, solved = solve_band_qp(hessian, gradient, rows, BAND)
    assert solved
    np.testing.assert_allclose(hessian @ x, -gradient, atol=1e-9)
