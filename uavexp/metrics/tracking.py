"""How well the vehicle followed its reference, and how well it knew where it was."""

from __future__ import annotations

import numpy as np

from uavexp.arrays import Float


def distances_m(position_m: Float, other_m: Float) -> Float:
    """Distance (T,) between two paths (T, 3) at equal times, m."""
    return np.asarray(np.linalg.norm(position_m - other_m, axis=1))


def rmse_m(distance_m: Float) -> float:
    """Root of the mean of squares of distances (T,), m; NaN of an empty series.

    With the distances between flown (true) and reference position it is the tracking
    error TE of Chen et al. 2026.
    """
    return float(np.sqrt(np.mean(distance_m**2))) if distance_m.size else float("nan")
