"""Places that an explorer has set aside."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uavexp.arrays import Bool, Float


def lie_aside(points_m: Float, aside: Sequence[tuple[float, Float]], radius_m: float) -> Bool:
    """Which points (N, 3) lie nearer than the radius to a place set aside; (until when, s, and (3,)) each."""
    if not aside:
        return np.zeros(len(points_m), dtype=np.bool_)
    others = np.array([position_m for _, position_m in aside])
    away_m = np.linalg.norm(points_m[:, None] - others, axis=2)
    return np.asarray((away_m < radius_m).any(axis=1))
