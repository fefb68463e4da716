"""Moving obstacles for planners: each predicted body is an obstacle at its own time only.

A mover is the upright box around it, carried along as predicted and grown by the
uncertainty of its centre, k sigma up to a cap. Where that leads to a mapped obstacle it will
turn, and nobody knows where to: from then on it stays there, unless its turn is predicted, too
(`Tracks.swerve_m`), and grows at its speed, up to another cap. What a plan must keep from it is
the body's radius and a margin, for all times within the
horizon; beyond that a prediction says nothing, and nothing is asked. Any planner can use it:
`clearance_m` judges a timed curve, `stamped` writes the movers into a copy of the map for searches
that know no time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field

import numba as nb
import numpy as np

from uavexp.arrays import Float, Float32
from uavexp.errors import require_non_negative
from uavexp.field import DistanceField
from uavexp.types import SWERVE_STEP_S, PlanRequest, Tracks

# of a row: position 3, velocity 3, half size 3, variance 3, inset, cap, horizon, turn, speed, time of
# standing, and then its swerve at every `SWERVE_STEP_S`, three columns each, if that is predicted
COLUMNS = 18
INSET, CAP, HORIZON, TURN, SPEED, STANDS = 12, 13, 14, 15, 16, 17
_LEAST_M = 0.05  # a stamped cell is closed, but no place that nothing can leave
_SIGMAS = 1.0  # k
_CAP_M = 0.3  # of the growth
_TURN_CAP_M = 0.6  # of the growth after a turn
_TURN_M = 0.15  # an obstacle so near to a mover's side makes it turn
_TURN_STEP_S = 0.1


@nb.njit(cache=True, inline="always")
def box_gap(half_x: float, half_y: float, half_z: float, x: float, y: float, z: float) -> float:
    """Signed distance of a point, seen from a box's centre, to the box; negative inside."""
    qx, qy, qz = abs(x) - half_x, abs(y) - half_y, abs(z) - half_z
    outside = math.sqrt(max(qx, 0.0) ** 2 + max(qy, 0.0) ** 2 + max(qz, 0.0) ** 2)
    return float(outside + min(max(qx, max(qy, qz)), 0.0))


@nb.njit(cache=True, inline="always")
def moved_s(row: Float, ahead_s: float) -> float:
    """For how long a mover has moved on after a time: until it stands at what it turns at."""
    return float(min(ahead_s, max(row[STANDS], 0.0)))


@nb.njit(cache=True)
def swerved_m(row: Float, first: int, ahead_s: float) -> tuple[float, float, float]:
    """A mover's swerve (3,) after a time >= 0; the row's columns from `first` on have its places."""
    steps = (row.shape[0] - first) // 3
    if steps == 0:
        return 0.0, 0.0, 0.0
    at = max(ahead_s, 0.0) / SWERVE_STEP_S
    before = min(int(at), steps - 1)
    share, a, b = at - before, first + 3 * (before - 1), first + 3 * before
    kept = 1.0 - share if before > 0 else 0.0  # of the place before, which is 0 at first
    a = max(a, first)
    return (
        kept * row[a] + share * row[b],
        kept * row[a + 1] + share * row[b + 1],
        kept * row[a + 2] + share * row[b + 2],
    )


@nb.njit(cache=True, inline="always")
def grown_m(row: Float, ahead_s: float) -> float:
    """By how much a mover's box has grown after a time."""
    variance = row[9] + ahead_s * (row[10] + ahead_s * row[11])
    turned = min(row[SPEED] * max(ahead_s - row[TURN], 0.0), _TURN_CAP_M)
    return float(min(math.sqrt(max(variance, 0.0)), row[CAP]) + turned)


@nb.njit(cache=True)
def clearance_after(movers: Float, x: float, y: float, z: float, ahead_s: float) -> float:
    """Clearance of one point at one time, m: below 0 is too near; inf when no mover is predicted so far.

    Args:
        movers: (B, COLUMNS), see `MovingObstacles.table`.
        x: of the body's centre, m.
        y: of the body's centre, m.
        z: of the body's centre, m.
        ahead_s: time since the table's.
    """
    least = np.inf
    for b in range(movers.shape[0]):
        row = movers[b]
        if ahead_s > row[HORIZON]:
            continue
        on_s = moved_s(row, ahead_s)
        aside = swerved_m(row, COLUMNS, ahead_s)
        gap = box_gap(
            row[6], row[7], row[8],
            x - row[0] - on_s * row[3] - aside[0],
            y - row[1] - on_s * row[4] - aside[1],
            z - row[2] - on_s * row[5] - aside[2],
        )  # fmt: skip
        least = min(least, gap - grown_m(row, ahead_s) - row[INSET])
    return float(least)


@nb.njit(cache=True)
def _clearances(movers: Float, points_m: Float, ahead_s: Float) -> Float:
    clearance = np.empty(points_m.shape[0])
    for n in range(points_m.shape[0]):
        clearance[n] = clearance_after(movers, points_m[n, 0], points_m[n, 1], points_m[n, 2], ahead_s[n])
    return clearance


@nb.njit(cache=True, inline="always")
def _arrival_s(length_m: float, start_mps: float, speed_mps: float, acceleration_mps2: float) -> float:
    """Time to fly a length from a start speed, speeding up to the nominal one."""
    start = min(start_mps, speed_mps)
    rising_m = (speed_mps**2 - start**2) / (2.0 * acceleration_mps2)
    if length_m >= rising_m:
        return (speed_mps - start) / acceleration_mps2 + (length_m - rising_m) / speed_mps
    return (math.sqrt(start**2 + 2.0 * acceleration_mps2 * length_m) - start) / acceleration_mps2


@nb.njit(cache=True)
def _stamp(
    distance: Float32, origin_m: Float, voxel_m: float, movers: Float, low: Float, high: Float,
    start_m: Float, pace: Float, above_m: float, floor_m: float,
) -> None:  # fmt: skip
    """Lower the distances of cells within a box that a mover is near when the vehicle gets there."""
    first, last = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    for axis in range(3):
        first[axis] = max(int(np.floor((low[axis] - origin_m[axis]) / voxel_m)), 0)
        last[axis] = min(int(np.floor((high[axis] - origin_m[axis]) / voxel_m)), distance.shape[axis] - 1)
    for i in range(first[0], last[0] + 1):
        x = origin_m[0] + (i + 0.5) * voxel_m
        for j in range(first[1], last[1] + 1):
            y = origin_m[1] + (j + 0.5) * voxel_m
            for k in range(first[2], last[2] + 1):
                if distance[i, j, k] <= floor_m:
                    continue
                z = origin_m[2] + (k + 0.5) * voxel_m
                away = math.sqrt((x - start_m[0]) ** 2 + (y - start_m[1]) ** 2 + (z - start_m[2]) ** 2)
                ahead_s = _arrival_s(away, pace[0], pace[1], pace[2])
                clearance = clearance_after(movers, x, y, z, ahead_s) + above_m
                distance[i, j, k] = min(distance[i, j, k], max(clearance, floor_m))


def turns_s(tracks: Tracks, field: DistanceField, horizon_s: float) -> Float:
    """Time (B,) until each mover comes to a mapped obstacle, s; inf: not within the horizon."""
    ahead_s: Float = _TURN_STEP_S * np.arange(max(math.ceil(horizon_s / _TURN_STEP_S), 1) + 1.0)
    places_m = tracks.predicted_m(tracks.time_s + ahead_s)
    places_m[..., 2] = tracks.position_m[:, None, 2]  # the floor is in nobody's way
    free_m = field.distance_m(places_m.reshape(-1, 3)).reshape(places_m.shape[:2])
    near = free_m[:, 1:] < tracks.half_size_m[:, :2].max(axis=1)[:, None] + _TURN_M
    coming = near & (np.diff(free_m, axis=1) < -0.1 * _TURN_STEP_S)  # not what it is walking away from
    return np.where(coming.any(axis=1), ahead_s[1:][np.argmax(coming, axis=1)], np.inf)


def _way_m(row: Float) -> Float:
    """Places (P, 3) between which a mover's centre is within its horizon."""
    last_s = max(row[HORIZON], 0.0)
    steps = (len(row) - COLUMNS) // 3
    if not steps:
        return np.asarray(row[:3] + np.array([[0.0], [last_s]]) * row[3:6])
    ahead_s = np.append(np.arange(0.0, last_s, SWERVE_STEP_S), last_s)
    return np.array([row[:3] + s * row[3:6] + swerved_m(row, COLUMNS, s) for s in ahead_s.tolist()])


@dataclass(frozen=True, slots=True, kw_only=True)
class MovingObstacles:
    """The movers that a plan must keep away from, and by how much."""

    tracks: Tracks
    body_radius_m: float
    margin_m: float
    horizon_s: float  # predictions count for so long after the tracks' time
    field: DistanceField | None = None  # of what they turn at; None: of nothing
    _turn_s: Float = dataclass_field(init=False, repr=False)  # (B,) after the tracks' time

    def __post_init__(self) -> None:
        require_non_negative(
            body_radius_m=self.body_radius_m, margin_m=self.margin_m, horizon_s=self.horizon_s
        )
        turn_s = np.full(len(self.tracks), np.inf)
        if self.field is not None and len(self):
            turn_s = turns_s(self.tracks, self.field, self.horizon_s)
        object.__setattr__(self, "_turn_s", turn_s)  # asked for by every table

    def __len__(self) -> int:
        return len(self.tracks)

    def table(self, from_s: float) -> Float:
        """Rows (B, COLUMNS) for kernels, with times counted from this absolute time."""
        tracks, ahead_s = self.tracks, from_s - self.tracks.time_s
        swerve_m = tracks.swerved_m(from_s + SWERVE_STEP_S * np.arange(tracks.swerve_m.shape[1] + 1.0))
        rows = np.empty((len(tracks), COLUMNS + 3 * tracks.swerve_m.shape[1]))
        if not len(tracks):
            return rows
        stands_s = np.full(len(tracks), np.inf) if tracks.swerve_m.size else self._turn_s
        rows[:, 0:3] = tracks.position_m + np.minimum(ahead_s, stands_s)[:, None] * tracks.velocity_mps
        rows[:, 3:6], rows[:, 6:9] = tracks.velocity_mps, tracks.half_size_m
        if tracks.swerve_m.size:  # what has been swerved by then is in the place
            rows[:, 0:3] += swerve_m[:, 0]
            rows[:, COLUMNS:] = (swerve_m[:, 1:] - swerve_m[:, :1]).reshape(len(tracks), -1)
        diagonal = np.einsum("nii->ni", tracks.covariance)
        mixed = np.einsum("nii->ni", tracks.covariance[:, :3, 3:])
        # variance of p + t v on the least certain level axis: a polynomial of t, from `from_s` on
        place, both, speed = (
            _SIGMAS**2 * part[:, :2].max(axis=1, initial=0.0)
            for part in (diagonal[:, :3], 2.0 * mixed, diagonal[:, 3:])
        )
        rows[:, 9] = place + ahead_s * (both + ahead_s * speed)
        rows[:, 10], rows[:, 11] = both + 2.0 * ahead_s * speed, speed
        rows[:, INSET], rows[:, CAP] = self.body_radius_m + self.margin_m, _CAP_M
        rows[:, HORIZON], rows[:, TURN] = self.horizon_s - ahead_s, self._turn_s - ahead_s
        rows[:, SPEED], rows[:, STANDS] = np.linalg.norm(tracks.velocity_mps, axis=1), stands_s - ahead_s
        return rows

    def clearance_m(self, points_m: Float, times_s: Float) -> Float:
        """How much farther the body is from every mover than it must be (N,), m; inf beyond the horizon.

        Args:
            points_m: (N, 3) of the body's centre.
            times_s: (N,) absolute, when it is there.
        """
        ahead_s = np.asarray(times_s, dtype=np.float64) - self.tracks.time_s
        clearance: Float = _clearances(self.table(self.tracks.time_s), points_m, ahead_s)
        return clearance

    def stamped(
        self,
        request: PlanRequest,
        *,
        speed_mps: float,
        acceleration_mps2: float,
        least_m: float,
        safe_m: float,
        solid: bool = False,
    ) -> DistanceField:
        """The request's map with every mover where the vehicle would meet it.

        A cell is judged at the instant at which the vehicle gets there in a straight line. Where
        the movers' clearance is c, the distance is at most `least_m` + c: exactly the cells that
        are too near to a mover fall below the limit `least_m` of the search.

        Args:
            request: its start, start speed and field.
            speed_mps: nominal speed.
            acceleration_mps2: with which it is reached.
            least_m: clearance limit of the search.
            safe_m: clearance from which on the search does not care.
            solid: whether they have an inside, as what stands has: for planners that go by surfaces; a
                start within is then blocked.
        """
        field, table = request.field, self.table(request.time_s)
        distance = field.distance.copy()
        pace = np.array([np.linalg.norm(request.velocity_mps), speed_mps, acceleration_mps2])
        for row in table:
            ends_m = _way_m(row)
            turned_m = _TURN_CAP_M if row[TURN] < row[HORIZON] else 0.0
            reach_m = row[6:9] + row[INSET] + row[CAP] + turned_m + safe_m - least_m
            low_m, high_m = ends_m.min(axis=0) - reach_m, ends_m.max(axis=0) + reach_m
            _stamp(
                distance, field.origin_m, field.voxel_size_m, row[None], low_m, high_m,
                request.position_m, pace, least_m, -np.inf if solid else _LEAST_M,
            )  # fmt: skip
        return replace(field, distance=distance)

    def shortfall(self, points_m: Float, times_s: Float, acceleration_mps2: float) -> str:
        """Say where a timed curve is too near to a mover; empty when it is not.

        A start that is too near already may come no closer than the speed of approach makes
        unavoidable; once away it stays away.

        Args:
            points_m: (N, 3), from the start on.
            times_s: (N,) absolute, increasing.
            acceleration_mps2: that the vehicle can use to get away.
        """
        if not len(self):
            return ""
        clearance = self.clearance_m(points_m, times_s)
        enough = clearance >= 0.0
        if not enough[0]:
            escaped = int(np.argmax(enough)) if enough.any() else len(enough)
            closing = (clearance[0] - clearance[1]) / (times_s[1] - times_s[0]) if len(times_s) > 1 else 0.0
            stop_m = max(closing, 0.0) ** 2 / (2.0 * acceleration_mps2)
            enough[:escaped] = clearance[:escaped] >= clearance[0] - stop_m - _LEAST_M
        if enough.all():
            return ""
        worst = int(np.argmin(np.where(enough, np.inf, clearance)))
        return f"{-clearance[worst]:.2f} m too near to a mover {times_s[worst] - times_s[0]:.1f} s ahead"
