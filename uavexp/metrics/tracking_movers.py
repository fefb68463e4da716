"""How well the movers were tracked and predicted, against the truth in the log.

Matching is that of the CLEAR MOT metrics (Bernardin and Stiefelhagen 2008): a pair of the
previous instant is kept while it stays within the gate, the rest is assigned with the
least total distance. A track is taken to be of the ESDF update that it was logged at.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from uavexp.arrays import Float, Int
from uavexp.bodies import present
from uavexp.log import Contact, TrialLog
from uavexp.metrics.metric import Flight, Measure, Metric, Metrics
from uavexp.types import Tracks

HORIZONS_S = (0.3, 0.6, 0.9, 1.2)
MEAN_HORIZONS_S = tuple(0.1 * step for step in range(1, 13))  # the mean is taken over these
GATE_M = 1.0
WITHIN_M = 6.0


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackQuality:
    """Errors of one flight's tracks; NaN where there is nothing to average."""

    position_error_m: float  # mean over matched pairs and instants
    prediction_error_m: tuple[float, ...]  # mean at each of `HORIZONS_S`
    mean_prediction_error_m: float  # mean over the horizon, 0.1 to 1.2 s
    missed_share: float  # of mover instants within `within_m` of the vehicle, in sight or not
    false_share: float  # of track instants that match no mover
    identity_switches: int  # matches of a mover to another track than its last


def nearest_m(log: TrialLog) -> float:
    """Least distance to a mover; NaN when none was ever there."""
    least_m = float(log.movers.clearance_m.min())
    return least_m if math.isfinite(least_m) else math.nan


def predicted_errors_m(
    track: Tracks,
    times_s: Float,
    truth_m: Float,
    ahead_s: Sequence[float],
) -> Float:
    """Distances (H,) of predictions from the truth; NaN after its last row and where it is.

    Args:
        track: one, as believed when the prediction is made.
        times_s: (T,) increasing times of the truth.
        truth_m: (T, 3) true positions.
        ahead_s: horizons (H,).
    """
    later_s = track.time_s + np.asarray(ahead_s)
    true_m = np.stack([np.interp(later_s, times_s, truth_m[:, axis]) for axis in range(3)], axis=1)
    error_m: Float = np.linalg.norm(track.predicted_m(later_s)[0] - true_m, axis=1)
    return np.where(later_s <= times_s[-1] + 1e-9, error_m, np.nan)


def match(apart_m: Float, previous: dict[int, int], identity: Int, gate_m: float) -> dict[int, int]:
    """Track index of each matched mover at one instant.

    Args:
        apart_m: (B, N) distances of movers from tracks.
        previous: identity of the track that each mover was last matched with.
        identity: (N,) of the tracks.
        gate_m: farther pairs do not match.
    """
    from scipy.optimize import linear_sum_assignment

    index = {int(one): n for n, one in enumerate(identity)}
    kept = {
        mover: index[track]
        for mover, track in previous.items()
        if track in index and apart_m[mover, index[track]] <= gate_m
    }
    movers = [mover for mover in range(len(apart_m)) if mover not in kept]
    tracks = [n for n in range(apart_m.shape[1]) if n not in kept.values()]
    cost = np.minimum(apart_m[np.ix_(movers, tracks)], 1e6)
    row, column = linear_sum_assignment(np.where(cost <= gate_m, cost, 1e6))
    new = {movers[r]: tracks[c] for r, c in zip(row, column, strict=True) if cost[r, c] <= gate_m}
    return kept | new


def quality(log: TrialLog, *, gate_m: float = GATE_M, within_m: float = WITHIN_M) -> TrackQuality:
    """Compare the tracks of a flight with the movers.

    Args:
        log: of a flight with movers.
        gate_m: a track farther from a mover is not of it.
        within_m: only movers so near to the vehicle can be missed.
    """
    ends = np.cumsum(log.tracks.count)
    truth_m = log.movers.position_m.astype(np.float64)
    truth_m[~present(truth_m)] = np.nan  # whoever is not there cannot be predicted
    previous: dict[int, int] = {}
    apart: list[float] = []
    ahead: list[Float] = []
    near = missed = matched = switches = 0
    for tick, (now_s, end) in enumerate(zip(log.ticks.tick_s, ends, strict=True)):
        mine = slice(end - log.tracks.count[tick], end)
        step = min(round(now_s / log.step_s), len(log.steps.time_s) - 1)
        movers_m = log.movers.position_m[step].astype(np.float64)
        there = present(movers_m)
        apart_m = np.linalg.norm(movers_m[:, None] - log.tracks.position_m[mine][None], axis=2)
        apart_m[~there] = np.inf
        identity = log.tracks.identity[mine]
        pairs = match(apart_m, previous, identity, gate_m)
        matched += len(pairs)
        close = there & (np.linalg.norm(movers_m - log.steps.position_m[step], axis=1) <= within_m)
        near += int(close.sum())
        missed += sum(mover not in pairs for mover in np.flatnonzero(close))
        for mover, n in pairs.items():
            switches += previous.get(mover, int(identity[n])) != identity[n]
            previous[mover] = int(identity[n])
            apart.append(float(apart_m[mover, n]))
            ahead.append(
                predicted_errors_m(
                    _track(log, now_s, mine.start + n), log.steps.time_s, truth_m[:, mover],
                    (*HORIZONS_S, *MEAN_HORIZONS_S),
                )
            )  # fmt: skip
    errors_m = np.array(ahead).reshape(-1, len(HORIZONS_S) + len(MEAN_HORIZONS_S))
    full_m = errors_m[np.isfinite(errors_m).all(axis=1)]
    tracks = int(log.tracks.count.sum())
    return TrackQuality(
        position_error_m=_mean(np.array(apart)),
        prediction_error_m=tuple(_mean(full_m[:, h]) for h in range(len(HORIZONS_S))),
        mean_prediction_error_m=_mean(full_m[:, len(HORIZONS_S) :]),
        missed_share=missed / near if near else math.nan,
        false_share=(tracks - matched) / tracks if tracks else math.nan,
        identity_switches=switches,
    )


def _track(log: TrialLog, now_s: float, row: int) -> Tracks:
    """One row of the logged tracks."""
    rows = log.tracks
    return Tracks(
        time_s=now_s,
        identity=rows.identity[row : row + 1],
        position_m=rows.position_m[row : row + 1],
        velocity_mps=rows.velocity_mps[row : row + 1],
        covariance=np.zeros((1, 6, 6)),
        half_size_m=np.zeros((1, 3)),
        swerve_m=rows.swerve_m[row : row + 1].astype(np.float64),
    )


def near_misses(time_s: Float, mover_clearance_m: Float, contacts: Sequence[Contact], near_m: float) -> int:
    """Number of times that a mover came nearer than `near_m` to the body's centre and did not touch it.

    One from the step at which the clearance falls below until it is above again; one in which
    a mover was touched is a contact and no near miss.

    Args:
        time_s: (T,).
        mover_clearance_m: (T,) distance of the body's centre to the nearest mover.
        contacts: of the flight.
        near_m: limit, m.
    """
    return len(near_miss_spans(time_s, mover_clearance_m, contacts, near_m))


def near_miss_spans(
    time_s: Float, mover_clearance_m: Float, contacts: Sequence[Contact], near_m: float
) -> list[tuple[int, int]]:
    """First and last row of each of the `near_misses`, in order of time."""
    near = np.concatenate([[False], mover_clearance_m < near_m, [False]])
    first, last = np.flatnonzero(near[1:] & ~near[:-1]), np.flatnonzero(near[:-1] & ~near[1:]) - 1
    touched = [contact for contact in contacts if contact.mover >= 0]
    return [
        (int(begin), int(end))
        for begin, end in zip(first, last, strict=True)
        if not any(one.start_s <= time_s[end] and one.end_s >= time_s[begin] for one in touched)
    ]


def _mean(values: Float) -> float:
    return float(values.mean()) if values.size else math.nan


@lru_cache(maxsize=1)
def _quality(flight: Flight) -> TrackQuality:
    return quality(flight.log)


def _among_movers(measure: Measure) -> Measure:
    """The measure of a flight with movers; no column without."""
    return lambda flight: measure(flight) if flight.log.movers.clearance_m.size else None


def _of_tracks(figure: Callable[[TrackQuality], float]) -> Measure:
    return _among_movers(lambda flight: figure(_quality(flight)))


def _prediction_error(horizon: int) -> Measure:
    return _of_tracks(lambda tracks: tracks.prediction_error_m[horizon])


METRICS: Metrics = {
    Metric(column="mover_contacts", title="Contacts with movers", better=-1, is_count=True): _among_movers(
        lambda flight: sum(contact.mover >= 0 for contact in flight.log.contacts)
    ),
    Metric(
        column="min_mover_clearance_m",
        title="Min. distance to a mover",
        unit="m",
        better=1,
        missing="none was ever there",
    ): _among_movers(lambda flight: nearest_m(flight.log)),
    Metric(column="near_miss_distance_m", title="Distance of a near miss", unit="m"): _among_movers(
        lambda flight: flight.near_miss_m
    ),
    Metric(column="near_misses", title="Near misses of movers", better=-1, is_count=True): _among_movers(
        lambda flight: near_misses(
            flight.log.steps.time_s, flight.log.movers.clearance_m, flight.log.contacts, flight.near_miss_m
        )
    ),
    Metric(
        column="track_error_m",
        title="Position error of tracks",
        unit="m",
        digits=3,
        better=-1,
        missing="no track matched a mover",
    ): _of_tracks(lambda tracks: tracks.position_error_m),
    **{
        Metric(
            column=f"prediction_error_{ahead_s:g}s_m",
            title=f"Prediction error after {ahead_s:g} s",
            unit="m",
            digits=3,
            better=-1,
            missing="no track matched a mover so long before the end",
        ): _prediction_error(n)
        for n, ahead_s in enumerate(HORIZONS_S)
    },
    Metric(
        column="prediction_error_mean_m",
        title=f"Prediction error, mean over {MEAN_HORIZONS_S[-1]:g} s",
        unit="m",
        digits=3,
        better=-1,
        missing="no track matched a mover so long before the end",
    ): _of_tracks(lambda tracks: tracks.mean_prediction_error_m),
    Metric(
        column="missed_track_share",
        title=f"Movers within {WITHIN_M:g} m not tracked",
        unit="%",
        digits=1,
        better=-1,
        scale=100.0,
        missing="no mover came so near",
    ): _of_tracks(lambda tracks: tracks.missed_share),
    Metric(
        column="false_track_share",
        title="False tracks",
        unit="%",
        digits=1,
        better=-1,
        scale=100.0,
        missing="there was no track",
    ): _of_tracks(lambda tracks: tracks.false_share),
    Metric(column="identity_switches", title="Identity switches", better=-1, is_count=True): _of_tracks(
        lambda tracks: tracks.identity_switches
    ),
}
