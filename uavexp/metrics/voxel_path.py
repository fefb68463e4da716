"""How long, how straight and how level a path is (Liao et al., table 1, which gives no formulas).

Paths are polylines (P, 3) in any unit of length; repeated points are left out.
"""

from __future__ import annotations

import numpy as np

from uavexp.arrays import Float

_LEVEL = 1e-6  # share of the path's extent below which a height difference is rounding


def _steps(path: Float) -> Float:
    steps = np.diff(np.asarray(path, dtype=np.float64), axis=0)
    return np.asarray(steps[np.linalg.norm(steps, axis=1) > 0.0])


def height_reversals(path: Float, least: float = 0.0) -> int:
    """How often climbing turns into sinking or back: sign changes of Δz, level steps left out.

    Args:
        path: (P, 3).
        least: smaller swings of height are no climb, as where the ends lie off their voxels' centres.
    """
    height = np.asarray(path, dtype=np.float64)[:, 2]
    least = max(least, _LEVEL * (1.0 + np.ptp(height) if len(height) else 1.0))
    way, turn, count = 0, height[0] if len(height) else 0.0, 0
    for z in height:
        if way * (z - turn) > 0.0 or (way == 0 and abs(z - turn) <= least):
            turn = z if way else turn
        elif abs(z - turn) > least:
            count += way != 0
            way, turn = (1 if z > turn else -1), z
    return count


def excess_climb(path: Float) -> float:
    """Σ|Δz| − |z_goal − z_start|: height gained and lost for nothing, in the path's unit, >= 0."""
    rise = _steps(path)[:, 2]
    return max(float(np.abs(rise).sum() - abs(rise.sum())), 0.0)


def _turns_rad(path: Float) -> Float:
    """Angle between each segment and the next."""
    steps = _steps(path)
    unit = steps / np.linalg.norm(steps, axis=1, keepdims=True)
    cosine = np.einsum("nd,nd->n", unit[:-1], unit[1:])
    sine = np.linalg.norm(np.cross(unit[:-1], unit[1:]), axis=1)
    return np.asarray(np.arctan2(sine, cosine))


def cumulative_heading_change_rad(path: Float) -> float:
    """Sum of the angles between each segment and the next, over the whole path, rad."""
    return float(_turns_rad(path).sum())


def mean_heading_change_rad(path: Float) -> float:
    """Mean angle of the places where the direction changes at all, rad; 0 for a straight path."""
    turns = _turns_rad(path)
    turns = turns[turns > _LEVEL]
    return float(turns.mean()) if turns.size else 0.0
