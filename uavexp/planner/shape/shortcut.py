"""Shortcuts through free space."""

from __future__ import annotations

import numpy as np

from uavexp.arrays import Float
from uavexp.planner.find.free_space import FreeSpace, straight_is_free


def shortcut(points_m: Float, space: FreeSpace) -> Float:
    """The polyline (P, 3) without the points that straight free ways skip; both ends kept.

    Greedy from the start: each way reaches on as long as it stays free. The given segments are
    taken as free, so a path that is nowhere free enough comes back as it is.
    """
    kept, at = [0], 0
    while at < len(points_m) - 1:
        reached = at + 1
        stride = 1
        while stride:  # gallop ahead while it is free, then halve
            there = min(reached + stride, len(points_m) - 1)
            free = there > reached and straight_is_free(space, points_m[at], points_m[there])[0]
            if free:
                reached, stride = there, 2 * stride
            else:
                stride = stride // 2
        kept.append(reached)
        at = reached
    return np.asarray(points_m[kept])
