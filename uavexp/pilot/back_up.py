"""Backing up: the way that was flown, backwards, to the last place with room."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from uavexp.arrays import Float
from uavexp.field import DistanceField
from uavexp.trajectory import Trajectory

_APART_M = 0.1  # places that are remembered
_LEAST_M = 0.3  # a place nearer than this is here
_SAME_M = 1e-3
_GENTLE_MPS2 = 0.5
_SMOOTHINGS = 4  # of the way: a spline through places as they were noted would turn sharply at each
_WORSE_M = 0.02  # by which the clearance may fall on the way out of a narrow place


def remembered(way_m: Float, here_m: Float, most_m: float) -> Float:
    """The last so many metres of the places flown through (N, 3), with this one at their end."""
    if len(way_m) and float(np.linalg.norm(way_m[-1] - here_m)) < _APART_M:
        return way_m
    return np.concatenate([way_m, here_m[None]])[-max(2, round(most_m / _APART_M)) :]


def way_back(way_m: Float, here_m: Float, field: DistanceField, clearance_m: float) -> Float:
    """Places (N, 3) from here back to the last one with so much mapped clearance; none: there is no such one.

    The clearance on the way falls nowhere below the one here: what was flown through may be closed by now.
    """
    back_m = np.concatenate([here_m[None], way_m[::-1]])
    room_m = field.distance_m(back_m)
    far = np.linalg.norm(back_m - here_m, axis=1) >= _LEAST_M
    end = int(np.argmax(far & (room_m >= clearance_m)))
    least_m = min(room_m[0], clearance_m) - _WORSE_M
    return back_m[: end + 1] if end > 0 and (room_m[: end + 1] >= least_m).all() else np.zeros((0, 3))


def back_up(back_m: Float, start_s: float, speed_mps: float) -> Trajectory:
    """Flight through places (N, 3) from rest to rest, from a time on, at about this speed.

    Each place has the time at which a steady acceleration, that speed and a steady deceleration bring the
    vehicle there; a cubic spline leads through them, smoothed but for both ends.
    """
    back_m = back_m.copy()
    for _ in range(_SMOOTHINGS):
        back_m[1:-1] = 0.25 * back_m[:-2] + 0.5 * back_m[1:-1] + 0.25 * back_m[2:]
    steps_m = np.linalg.norm(np.diff(back_m, axis=0), axis=1)
    keep = np.append(True, steps_m > _SAME_M)
    along_m = np.append(0.0, np.cumsum(steps_m))[keep]
    ramp_m = min(0.5 * speed_mps**2 / _GENTLE_MPS2, 0.5 * along_m[-1])
    top_mps = np.sqrt(2.0 * _GENTLE_MPS2 * ramp_m)
    sped_up_s, left_m = np.sqrt(2.0 * np.minimum(along_m, ramp_m) / _GENTLE_MPS2), along_m[-1] - along_m
    slowed_s = (top_mps - np.sqrt(2.0 * _GENTLE_MPS2 * np.minimum(left_m, ramp_m))) / _GENTLE_MPS2
    steady_s = np.clip(along_m - ramp_m, 0.0, along_m[-1] - 2.0 * ramp_m) / top_mps
    times_s = start_s + sped_up_s + steady_s + slowed_s
    spline = CubicSpline(times_s, back_m[keep], bc_type="clamped")
    return Trajectory(
        breaks_s=times_s, coefficients=np.ascontiguousarray(spline.c[::-1].transpose(1, 0, 2)), at_rest=True
    )
