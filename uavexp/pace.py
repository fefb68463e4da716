"""Pace: how fast a trajectory's own time runs while it is flown, at a rate from 0 to 1.

    r(t) = p(tau(t)),  dtau/dt = rate
    v = rate p'    a = rate² p'' + rate' p'    j = rate³ p''' + 3 rate rate' p'' + rate'' p'

The way stays the trajectory's, only slower. Between two knots the rate changes linearly in time.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numba as nb
import numpy as np

from uavexp.arrays import Float, check_shape
from uavexp.trajectory import Trajectory, differentiate_pieces, evaluate_pieces


@dataclass(frozen=True, slots=True, kw_only=True)
class Pace:
    """Rates over time; before the first knot, and without any, as planned; after the last at its rate."""

    times_s: Float  # (K,) trial time
    own_s: Float  # (K,) the trajectory's own time then; the first is that of the trial
    rate: Float  # (K,) of the own time

    def __post_init__(self) -> None:
        for name in ("own_s", "rate"):
            check_shape(name, getattr(self, name), self.times_s.shape)

    def at(self, time_s: float) -> tuple[float, float, float]:
        """The trajectory's own time, s, its rate, and how that changes, 1/s."""
        own_s, rate, change, _ = own_time(self.times_s, self.own_s, self.rate, time_s)
        return float(own_s), float(rate), float(change)

    @property
    def rests_s(self) -> float:
        """When the way is stood still on, s; inf: at its own end only."""
        return float(self.times_s[-1]) if len(self.rate) and self.rate[-1] == 0.0 else np.inf


AS_PLANNED = Pace(times_s=np.zeros(0), own_s=np.zeros(0), rate=np.zeros(0))


def pace_over(start_s: float, own_s: Float, rate: Float, early_s: float = 0.0) -> Pace:
    """The pace with these rates (K,) at these own times (K,).

    It ends where the rate is 0 from then on, so much before that own time.
    """
    knots = min(int(np.count_nonzero(np.cumsum(rate[::-1]) > 0.0)) + 1, len(rate))
    own_s, rate = own_s[:knots].copy(), rate[:knots]
    if knots > 1 and rate[-1] == 0.0:
        own_s[-1] -= early_s
        if own_s[-1] <= own_s[-2]:  # it rests at the knot before, where all that is left is rounding
            own_s, rate = own_s[:-1], np.append(rate[:-2], 0.0)
    spans_s = 2.0 * np.diff(own_s) / (rate[1:] + rate[:-1])
    return Pace(times_s=start_s + np.append(0.0, np.cumsum(spans_s)), own_s=own_s, rate=rate)


def delayed(trajectory: Trajectory, by_s: float) -> Trajectory:
    """The same curve, flown later."""
    return dataclasses.replace(trajectory, breaks_s=trajectory.breaks_s + by_s)


@nb.njit(cache=True)
def own_time(times_s: Float, own_s: Float, rate: Float, time_s: float) -> tuple[float, float, float, float]:
    """Own time at a trial time, its rate, and the rate's first and second derivative; arrays of a `Pace`.

    The derivatives are smoothed: they run linearly from the middle of one span to that of the next.
    """
    last = len(times_s) - 1
    if last < 0 or time_s < times_s[0]:
        return time_s, 1.0, 0.0, 0.0
    if time_s >= times_s[last]:
        since = time_s - times_s[last] if rate[last] > 0.0 else 0.0
        return own_s[last] + rate[last] * since, rate[last], 0.0, 0.0
    k = np.searchsorted(times_s, time_s, side="right") - 1
    change = (rate[k + 1] - rate[k]) / (times_s[k + 1] - times_s[k])
    since, middle_s = time_s - times_s[k], 0.5 * (times_s[k] + times_s[k + 1])
    own, now = own_s[k] + since * (rate[k] + 0.5 * change * since), rate[k] + change * since
    other = k + 1 if time_s >= middle_s else k - 1
    if not 0 <= other < last:
        return own, now, change, 0.0
    other_change = (rate[other + 1] - rate[other]) / (times_s[other + 1] - times_s[other])
    bend = (other_change - change) / (0.5 * (times_s[other] + times_s[other + 1]) - middle_s)
    return own, now, change + bend * (time_s - middle_s), bend


@nb.njit(cache=True)
def evaluate_paced(
    breaks_s: Float, coefficients: Float, pace: tuple[Float, Float, Float], times_s: Float
) -> tuple[Float, Float, Float, Float, Float]:
    """Own times (N,), position, velocity, acceleration and jerk (N, 3) at trial times (N,).

    Args:
        breaks_s: of the `Trajectory`.
        coefficients: of the same.
        pace: times, own times and rates of the `Pace`.
        times_s: (N,)
    """
    count = len(times_s)
    own_s, flow = np.empty(count), np.empty((count, 3))
    for n in range(count):
        own_s[n], flow[n, 0], flow[n, 1], flow[n, 2] = own_time(pace[0], pace[1], pace[2], times_s[n])
    # A plan may be adopted a rounding before it starts, where it would stand still.
    own_s = np.maximum(own_s, breaks_s[0])
    position, velocity, acceleration = evaluate_pieces(breaks_s, coefficients, own_s)
    jerk = differentiate_pieces(breaks_s, coefficients, own_s, 3)
    for n in range(count):
        rate, change, bend = flow[n]
        if rate == 1.0 and change == 0.0 and bend == 0.0:
            continue
        for axis in range(3):
            v, a, j = velocity[n, axis], acceleration[n, axis], jerk[n, axis]
            velocity[n, axis] = rate * v
            acceleration[n, axis] = rate**2 * a + change * v
            jerk[n, axis] = rate**3 * j + 3.0 * rate * change * a + bend * v
    return own_s, position, velocity, acceleration, jerk
