"""How near a flown trajectory comes to what is mapped, from now on."""

from __future__ import annotations

import math

import numpy as np

from uavexp.arrays import Float
from uavexp.field import DistanceField
from uavexp.trajectory import Trajectory, evaluate

_SAMPLE_S = 0.05  # at 2.5 m/s about one voxel apart


def clearance_ahead_m(
    trajectory: Trajectory, field: DistanceField, now_s: float, horizon_s: float = math.inf
) -> Float:
    """Mapped distance (N,) at samples of the trajectory from now on.

    Args:
        trajectory: the one flown.
        field: the map as it is now; unknown space is no obstacle in it.
        now_s: trial time, s.
        horizon_s: how far to look ahead, s.

    Returns:
        Signed distances, m, at most 0.05 s apart; the vehicle's own place first, the horizon or the end last.
    """
    begin_s = min(max(now_s, trajectory.start_s), trajectory.end_s)
    end_s = min(trajectory.end_s, begin_s + horizon_s)
    times_s = np.linspace(begin_s, end_s, 1 + math.ceil((end_s - begin_s) / _SAMPLE_S))
    return field.distance_m(evaluate(trajectory, times_s)[0])
