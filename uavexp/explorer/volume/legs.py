"""The next leg of a way: as far as straight flight keeps to places that were seen and are clear.

A planner that is told of a goal behind a corner or above a floor takes its own way there, along what was
not seen all around, and the safety holds it. On a straight leg there is nothing to choose.
"""

from __future__ import annotations

import numpy as np

from uavexp.arrays import Float
from uavexp.explorer.volume.cells import Body
from uavexp.field import DistanceField
from uavexp.safety.looked_at import look_at

_SAMPLE_M = 0.1
_LOOKS = 16  # along a way
_START_M = 0.3  # so near to the vehicle nothing is asked: it is there


def is_straight(field: DistanceField, body: Body, from_m: Float, to_m: Float) -> bool:
    """Whether a straight flight between points (3,) keeps to places that were seen and keep `narrow_m`."""
    length_m = float(np.linalg.norm(to_m - from_m))
    along_m = np.append(np.arange(_START_M, length_m, _SAMPLE_M), length_m)
    points_m = from_m + (along_m / max(length_m, 1e-6))[:, None] * (to_m - from_m)
    clearance_m, seen, _ = look_at(
        points_m, field.distance, field.state, field.origin_m, field.voxel_size_m, body.radius_m,
        body.half_height_m,
    )  # fmt: skip
    return bool(seen.all() and (clearance_m > body.narrow_m).all())


def next_leg(field: DistanceField, body: Body, from_m: Float, way_m: Float, least_m: float) -> int:
    """Number of the point at which the next leg ends.

    Args:
        field: the map.
        body: what flies.
        from_m: (3,) the vehicle.
        way_m: (P, 3) the way ahead, its end last.
        least_m: a leg goes so far along the way, though it may not be straight.
    """
    stride = -(-len(way_m) // _LOOKS)
    for last in range(len(way_m) - 1, -1, -stride):
        if is_straight(field, body, from_m, way_m[last]):
            break
    along_m = np.cumsum(np.linalg.norm(np.diff(way_m, axis=0, prepend=from_m[None]), axis=1))
    return max(last, min(int(np.searchsorted(along_m, least_m)), len(way_m) - 1))
