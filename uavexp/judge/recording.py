"""What a file tells of a flight, whatever its format: positions over time, and plans where it has them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from uavexp.arrays import Float, Int
from uavexp.errors import RecordError

_LONG_GAPS = 10.0  # times the usual time between positions: told
_LONGEST_S = 5.0  # usually between positions; beyond it they are no seconds, or no flight
_FARTHEST_M = 1e6
_MOST_ROWS = 2_000_000  # even steps from the first position to the last
_NED_TO_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
_FRD_TO_FLU = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """A plan, or a setpoint, that took over."""

    time_s: float  # of the file's clock
    path_m: Float  # (P, 3)
    cause: str = "plan"


@dataclass(frozen=True, slots=True, kw_only=True)
class Track:
    """A vector over time, of the file's clock."""

    time_s: Float  # (N,)
    values: Float  # (N, D)


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """A flight as its file tells it: m, s, world frame with z up."""

    path: Path
    source: str  # which of the file's topics or columns
    position_m: Track  # D = 3
    velocity_mps: Track | None = None  # D = 3
    quaternion_wxyz: Track | None = None  # D = 4, body to world
    reference_m: Track | None = None  # D = 3
    plans: tuple[Plan, ...] | None = None  # None: the file does not tell
    notes: tuple[str, ...] = ()


def checked(recording: Recording) -> Recording:
    """The recording with the samples that are no position left out, and a note of what is odd.

    Raises:
        RecordError: fewer than two positions, or stamps that do not increase.
    """
    where, track = f"{recording.path}: {recording.source}", recording.position_m
    there = np.isfinite(track.values).all(axis=1) & np.isfinite(track.time_s)
    track = Track(time_s=track.time_s[there], values=track.values[there])
    if len(track.time_s) < 2:
        raise RecordError(f"{where} has {len(track.time_s)} positions, a flight needs at least 2")
    farthest_m = float(np.abs(track.values).max())
    if farthest_m > _FARTHEST_M:
        raise RecordError(f"{where}: a position is {farthest_m:.3g} m from the origin; is it in metres?")
    step_s = np.diff(track.time_s)
    if (step_s <= 0.0).any():
        n = int((step_s <= 0.0).argmax()) + 1
        what = "twice" if step_s[n - 1] == 0.0 else f"after {track.time_s[n - 1]:.6f} s"
        raise RecordError(f"{where}: stamps must increase, position {n} has {track.time_s[n]:.6f} s {what}")
    left_out = int(np.count_nonzero(~there))
    notes = [f"{left_out} samples without a position are left out"] if left_out else []
    usual_s, longest = float(np.median(step_s)), int(step_s.argmax())
    if usual_s > _LONGEST_S:
        raise RecordError(f"{where}: positions are {usual_s:.3g} s apart; are its times seconds?")
    if (track.time_s[-1] - track.time_s[0]) / usual_s > _MOST_ROWS:
        raise RecordError(
            f"{where}: stamps leap by {step_s[longest]:.3g} s at position {longest + 1}, too long for one "
            "flight; cut the recording"
        )
    if step_s[longest] > _LONG_GAPS * usual_s:
        begin_s = track.time_s[longest] - track.time_s[0]
        notes.append(f"no position for {step_s[longest]:.2f} s from {begin_s:.1f} s on, bridged straight")
    return Recording(
        path=recording.path,
        source=recording.source,
        position_m=track,
        velocity_mps=_whole(recording.velocity_mps),
        quaternion_wxyz=_whole(recording.quaternion_wxyz),
        reference_m=_whole(recording.reference_m),
        plans=recording.plans,
        notes=(*recording.notes, *notes),
    )


def at(track: Track, times_s: Float, longest_s: float = np.inf) -> Float:
    """Values (N, D) at times (N,), straight between samples, the ends held.

    NaN where no sample lies within `longest_s`.
    """
    values = np.column_stack([np.interp(times_s, track.time_s, column) for column in track.values.T])
    after = np.searchsorted(track.time_s, times_s)
    around = np.stack([np.maximum(after - 1, 0), np.minimum(after, len(track.time_s) - 1)])
    values[np.abs(track.time_s[around] - times_s).min(axis=0) > longest_s] = np.nan
    return values


def nearest(track: Track, times_s: Float) -> Float:
    """Values (N, D) of the latest sample at times (N,), before the first one that."""
    index: Int = np.clip(
        np.searchsorted(track.time_s, times_s + 1e-9, side="right") - 1, 0, len(track.time_s) - 1
    )
    return np.asarray(track.values[index])


def from_ned(vectors: Float) -> Float:
    """Vectors (N, 3) of north, east, down as x east, y north, z up (REP 103)."""
    return np.asarray(vectors @ _NED_TO_ENU.T)


def from_ned_frd(rotations: Float) -> Float:
    """Rotations (N, 3, 3) of a forward-right-down body to NED as forward-left-up to east-north-up."""
    return np.asarray(_NED_TO_ENU @ rotations @ _FRD_TO_FLU)


def new_paths(plans: list[Plan], least_m: float = 0.1) -> tuple[Plan, ...]:
    """The plans that are new: a path that repeats the one before, or what is left of it, is none.

    Args:
        plans: in the order of time.
        least_m: a new path leaves the one before by more than this, m.
    """
    kept: list[Plan] = []
    before_m: Float | None = None
    for plan in plans:
        if before_m is None or departure_m(before_m, plan.path_m) > least_m:
            kept.append(plan)
        before_m = plan.path_m
    return tuple(kept)


def departure_m(old_m: Float, new_m: Float) -> float:
    """Largest distance of a corner of a new path (N, 3) from the old one (M, 3), m; inf from none."""
    if not len(old_m) or not len(new_m):
        return float("inf") if len(new_m) else 0.0
    if len(old_m) == 1:
        return float(np.linalg.norm(new_m - old_m[0], axis=1).max())
    begin, along = old_m[:-1], np.diff(old_m, axis=0)
    length2 = np.maximum((along**2).sum(axis=1), 1e-12)
    farthest = 0.0
    for point in new_m:
        share = np.clip(((point - begin) * along).sum(axis=1) / length2, 0.0, 1.0)
        gap_m = np.linalg.norm(begin + share[:, None] * along - point, axis=1).min()
        farthest = max(farthest, float(gap_m))
    return farthest


def _whole(track: Track | None) -> Track | None:
    """A track without samples that are no numbers, in the order of time; None where nothing is left."""
    if track is None:
        return None
    there = np.isfinite(track.values).all(axis=1) & np.isfinite(track.time_s)
    order = np.argsort(track.time_s[there], kind="stable")
    return Track(time_s=track.time_s[there][order], values=track.values[there][order]) if len(order) else None
