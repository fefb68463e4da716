"""Quadratic programmes by daqp: exact, dense, active set."""

from __future__ import annotations

import daqp
import numpy as np

from uavexp.arrays import Float

INFEASIBLE = (-1, -6)  # daqp's flags


def solve_qp(
    hessian: Float, gradient: Float, rows: Float, upper: Float, lower: Float | None = None
) -> tuple[Float, int]:
    """Least xᵀ H x / 2 + gᵀ x with lower <= A x <= upper, and daqp's flag.

    Args:
        hessian: (n, n).
        gradient: (n,).
        rows: A, (R, n).
        upper: (R,), or (n + R,) with the bounds of x itself first.
        lower: the same; None: none.

    Returns:
        x (n,) and the flag: 1 solved, `INFEASIBLE`, others failed; 0 for what is not finite.
    """
    least = np.full(len(upper), -1e30) if lower is None else lower
    x, _, flag, _ = daqp.solve(hessian, gradient, rows, upper, least, np.zeros(len(upper), dtype=np.int32))
    return x, int(flag) if np.isfinite(x).all() else 0
