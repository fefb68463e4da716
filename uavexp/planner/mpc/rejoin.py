"""From the horizon back to the static spline: a quintic that meets both up to acceleration."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from uavexp.arrays import Float
from uavexp.trajectory import Trajectory, evaluate, join

BLENDS_S = (0.5, 1.0, 2.0, 3.0)  # durations of the quintic, tried in turn
_LOOKS = 12  # instants of a quintic that are looked at before all else
_PACES = (1.0, 0.6)  # time on the spline that passes in the meantime, as a share of it


def state_at(trajectory: Trajectory, time_s: float) -> Float:
    """Position, velocity and acceleration (3, 3) at a time, its ends included."""
    time_s = min(max(time_s, trajectory.start_s), trajectory.end_s)
    return np.concatenate(evaluate(trajectory, np.array([time_s])))


def blend(start: Float, end: Float, start_s: float, duration_s: float) -> Trajectory:
    """The quintic from one state (3, 3) to another."""
    t = duration_s
    p = end[0] - start[0] - t * start[1] - 0.5 * t * t * start[2]
    v, a = end[1] - start[1] - t * start[2], end[2] - start[2]
    terms = [
        *(start[0], start[1], start[2] / 2.0),
        (10.0 * p - 4.0 * t * v + 0.5 * t * t * a) / t**3,
        (-15.0 * p + 7.0 * t * v - t * t * a) / t**4,
        (6.0 * p - 3.0 * t * v + 0.5 * t * t * a) / t**5,
    ]
    breaks = np.array([start_s, start_s + duration_s])
    return Trajectory(breaks_s=breaks, coefficients=np.stack(terms)[None], at_rest=False)


def rest_of(trajectory: Trajectory, from_s: float, start_s: float) -> Trajectory | None:
    """What is left of a trajectory from a time on, begun at another time; None when that is nothing."""
    if from_s >= trajectory.end_s - 1e-6:
        return None
    first = int(np.searchsorted(trajectory.breaks_s, from_s + 1e-6, side="right")) - 1
    first = max(first, 0)
    breaks = trajectory.breaks_s[first:] + (start_s - from_s)
    coefficients = trajectory.coefficients[first:].copy()
    coefficients[0] = _shifted(coefficients[0], start_s - float(breaks[0]))
    breaks[0] = start_s
    return Trajectory(breaks_s=breaks, coefficients=coefficients, at_rest=trajectory.at_rest)


def _shifted(coefficients: Float, by_s: float) -> Float:
    """Coefficients (D+1, 3) of the same polynomial in s - by_s."""
    out = coefficients.copy()
    for low in range(len(out) - 1):  # Horner's scheme, once per power
        for j in range(len(out) - 2, low - 1, -1):
            out[j] += by_s * out[j + 1]
    return out


def rejoined(
    head: Trajectory | None,
    start: Float,
    spline: Trajectory,
    phase_s: float,
    now_s: float,
    max_acceleration_mps2: float,
) -> Iterator[Trajectory]:
    """Ways to fly on from a state: quintics to the spline, then the rest of it.

    Args:
        head: flown before; None: nothing is.
        start: (3, 3) state at its end.
        spline: to come back to.
        phase_s: time on the spline that belongs to the head's end.
        now_s: absolute time of the head's end.
        max_acceleration_mps2: quintics that need more are left out.
    """
    for pace, duration_s in itertools.product(_PACES, BLENDS_S):
        meet_s = min(phase_s + pace * duration_s, spline.end_s)
        way = blend(start, state_at(spline, meet_s), now_s, duration_s)
        if _strongest_mps2(way) > max_acceleration_mps2:
            continue  # spares the check of the whole
        tail = rest_of(spline, meet_s, way.end_s)
        if tail is not None:
            way = join(way, tail)
        if head is not None:
            way = join(head, way)
        yield Trajectory(breaks_s=way.breaks_s, coefficients=way.coefficients, at_rest=spline.at_rest)


def _strongest_mps2(way: Trajectory) -> float:
    """Largest acceleration at a few instants behind the start."""
    times = np.linspace(way.start_s, way.end_s, _LOOKS + 1)[1:]
    return float(np.linalg.norm(evaluate(way, times)[2], axis=1).max())
