"""Where no mover comes: which places are free for a while, and where to step aside.

A mover is the upright box around it, carried along as predicted. Where that leads to an
obstacle of the live map it will turn, and nobody knows where to: from then on it may be anywhere
that its speed takes it from there, or from its predicted way. The vehicle gets to a place from rest to
rest in a straight line. Nothing is asked of predictions beyond `HORIZON_S`. [ours: the
paper's people only walk by]
"""

from __future__ import annotations

import numba as nb
import numpy as np

from uavexp.arrays import Bool, Float
from uavexp.field import DistanceField
from uavexp.planner.movers.moving import box_gap, swerved_m, turns_s
from uavexp.trajectory import Trajectory, evaluate
from uavexp.types import Limits, Tracks

HORIZON_S = 1.8  # predictions count for so long
STEP_S = 0.1
_SPREAD_MPS = 0.1  # by which a mover grows even where nothing is in its way
_ASIDE_M = 2.5  # a step aside goes no farther
_FAR_WORTH = 0.05  # m of room that a metre of way must bring
_ENOUGH_M = 0.3  # room beyond what must be kept is worth nothing
_SAME_M = 0.25  # places so near to each other are one
_HELD_WORTH_M = 0.15  # by which another place must be better, room on the way and there added up
_COLUMNS = 11  # of a mover's row before its swerve
_ALONG = 6  # samples of the way to a place, for its clearance


def rooms_m(tracks: Tracks, turn_s: Float, from_m: Float, place_m: Float, limits: Limits, way: bool) -> Float:
    """Least distance of the body's centre to every mover's surface, for each place (N,), m; inf: none comes.

    Args:
        tracks: the movers.
        turn_s: (B,) of `moving.turns_s`.
        from_m: (3,) where the vehicle is.
        place_m: (N, 3) where it goes and stays.
        limits: of the vehicle.
        way: whether the way there counts, too, not only the stay.
    """
    pace = np.array([limits.max_speed_mps, limits.max_acceleration_mps2])
    return np.asarray(_rooms(_rows(tracks, turn_s), from_m, place_m, pace, way))


def room_along_m(tracks: Tracks, turn_s: Float, trajectory: Trajectory, time_s: float) -> float:
    """The same for what is flown from a time on, with the hold at its end."""
    ahead_s = np.arange(0.0, HORIZON_S, STEP_S)
    points_m = evaluate(trajectory, np.minimum(time_s + ahead_s, trajectory.end_s))[0]
    return float(_along(_rows(tracks, turn_s), points_m, ahead_s))


def _rows(tracks: Tracks, turn_s: Float) -> Float:
    """Movers as rows (B, 11 + 3 K): centre, velocity, half size, speed, time of the turn, swerve."""
    speed_mps = np.linalg.norm(tracks.velocity_mps, axis=1)[:, None]
    parts = (tracks.position_m, tracks.velocity_mps, tracks.half_size_m, speed_mps, turn_s[:, None])
    if not tracks.swerve_m.size:
        return np.concatenate(parts, axis=1)
    return np.concatenate([*parts, tracks.swerve_m.reshape(len(tracks), -1)], axis=1)


def aside_m(
    tracks: Tracks,
    field: DistanceField,
    from_m: Float,
    places_m: Float,
    keep_m: float,
    limits: Limits,
    under_way_m: Float | None = None,
) -> Float:
    """The place (3,) to go to, or to stay at, that leaves the movers the most room.

    Args:
        tracks: the movers.
        field: the live map.
        from_m: (3,) where the vehicle is meant to be: a hold that follows its own error runs away with it.
        places_m: (N, 3) that may be gone to.
        keep_m: room that is wanted.
        limits: of the vehicle.
        under_way_m: (3,) the place chosen last, which is not left for one that is hardly better.
    """
    away_m = np.linalg.norm(places_m - from_m, axis=1)
    near_m = np.concatenate([from_m[None], places_m[away_m <= _ASIDE_M]])
    near_m = near_m[_straight(field, from_m, near_m, limits.body_radius_m)]
    turn_s, worth = turns_s(tracks, field, HORIZON_S), -_FAR_WORTH * np.linalg.norm(near_m - from_m, axis=1)
    for way in (True, False):  # both: where the way begins too near already, the stay still decides
        worth += np.minimum(rooms_m(tracks, turn_s, from_m, near_m, limits, way), keep_m + _ENOUGH_M)
    if under_way_m is not None:
        worth[np.linalg.norm(near_m - under_way_m, axis=1) < _SAME_M] += _HELD_WORTH_M
    return np.asarray(near_m[int(np.argmax(worth))])


def _straight(field: DistanceField, from_m: Float, place_m: Float, radius_m: float) -> Bool:
    """Whether the straight way to each place (N,) is clear; staying, the first, always is."""
    share = np.linspace(0.0, 1.0, _ALONG)[1:, None, None]
    points_m = from_m + share * (place_m - from_m)
    free_m = field.distance_m(points_m.reshape(-1, 3)).reshape(points_m.shape[:2])
    clear: Bool = np.asarray((free_m > 1.5 * radius_m).all(axis=0))
    clear[0] = True
    return clear


@nb.njit(cache=True)
def _gap_m(rows: Float, x: float, y: float, z: float, ahead_s: float) -> float:
    """Distance of a point to the nearest place at which a mover may be."""
    least = np.inf
    for row in rows:
        before_s = min(ahead_s, row[10])
        on_s = ahead_s if row.shape[0] > _COLUMNS else before_s
        aside = swerved_m(row, _COLUMNS, ahead_s)
        gap = box_gap(
            row[6], row[7], row[8],
            x - row[0] - on_s * row[3] - aside[0],
            y - row[1] - on_s * row[4] - aside[1],
            z - row[2] - on_s * row[5] - aside[2],
        )  # fmt: skip
        least = min(least, gap - _SPREAD_MPS * ahead_s - row[9] * (ahead_s - before_s))
    return float(least)


@nb.njit(cache=True)
def _along(rows: Float, points: Float, ahead_s: Float) -> float:
    least = np.inf
    for k in range(points.shape[0]):
        least = min(least, _gap_m(rows, points[k, 0], points[k, 1], points[k, 2], ahead_s[k]))
    return float(least)


@nb.njit(cache=True)
def _rooms(rows: Float, start: Float, place: Float, pace: Float, way: bool) -> Float:
    rooms = np.full(place.shape[0], np.inf)
    for n in range(place.shape[0]):
        dx, dy, dz = place[n, 0] - start[0], place[n, 1] - start[1], place[n, 2] - start[2]
        there_s = arrival_s(np.sqrt(dx * dx + dy * dy + dz * dz), pace[0], pace[1])
        t = 0.0 if way else there_s
        while t <= HORIZON_S:
            s = 1.0 if t >= there_s else t / there_s
            share = s * s * (3.0 - 2.0 * s)
            gap = _gap_m(rows, start[0] + share * dx, start[1] + share * dy, start[2] + share * dz, t)
            rooms[n] = min(rooms[n], gap)
            t += STEP_S
    return rooms


@nb.njit(cache=True)
def arrival_s(length_m: float, speed_mps: float, acceleration_mps2: float) -> float:
    """Time from rest to rest over a length."""
    rising_m = speed_mps**2 / acceleration_mps2
    if length_m < rising_m:
        return float(2.0 * np.sqrt(length_m / acceleration_mps2))
    return float(length_m / speed_mps + speed_mps / acceleration_mps2)
