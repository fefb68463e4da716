"""The fastest rates along a trajectory that keep bounds and still stop where they must.

x = rate² is linear in the trajectory's own time s between two samples, so rate'' is none and
rate' = u = dx/ds / 2 (time-optimal path parameterisation, Bobrow et al. 1985; Pham and Pham 2018).
With T and L the own acceleration along and across the motion, V the own speed, the acceleration
flown is |rate² T + u V| along and rate² L across; a bound a on its norm gives

    u between (-x T ± sqrt(a² - x² L²)) / V

Backwards from where it must rest, that gives the fastest x from which a stop is possible; forwards,
what is flown.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Float

_LEAST_SHARE = 0.3  # of the bound on acceleration, that is left along the motion however sharp the turn
_SLOW_MPS = 1e-3
_CREEP_MPS = 0.2
_SPARE = 1e-9


class Way(NamedTuple):
    """Samples of a trajectory and bounds on how it is flown."""

    step_s: Float  # (N - 1,) of its own time, between two samples
    speed_mps: Float  # (N,)
    along_mps2: Float  # (N,) of the acceleration
    across_mps2: Float  # (N,)


class Effort(NamedTuple):
    """With what it is slowed and sped up."""

    comfort_mps2: float  # acceleration that is used
    most_mps2: float  # acceleration that is used where the rest would be missed otherwise
    jerk_mps3: float  # with which the acceleration changes
    reaction_s: float  # by which slowing begins earlier than the acceleration asks for


def speed_before_person_mps(
    walk_m: Float, person_mps: float, deceleration_mps2: float, reaction_s: float
) -> Float:
    """Fastest speed (N,) from which a stop is over before somebody who comes towards it is there.

    In the stop, t + v / a, both come nearer: v t + v² / 2 a + w (t + v / a) <= d.

    Args:
        walk_m: (N,) free way d between the two, m; negative: none.
        person_mps: speed w of the person, m/s.
        deceleration_mps2: a of the stop.
        reaction_s: t before it begins.
    """
    both_s = reaction_s + person_mps / deceleration_mps2
    left_m = np.maximum(walk_m - person_mps * reaction_s, 0.0)
    return np.asarray(deceleration_mps2 * (np.sqrt(both_s**2 + 2.0 * left_m / deceleration_mps2) - both_s))


def room_before_person_m(
    speed_mps: float, person_mps: float, deceleration_mps2: float, reaction_s: float
) -> float:
    """The free way d from which on that speed is no slower than this one, m."""
    stop_s = reaction_s + speed_mps / deceleration_mps2
    return speed_mps * reaction_s + speed_mps**2 / (2.0 * deceleration_mps2) + person_mps * stop_s


@nb.njit(cache=True)
def _steepest(way: Way, n: int, x: float, most_mps2: float, sign: float) -> float:
    """Least (sign -1) or greatest (1) u at a sample, 1/s; to hold the rate is always allowed."""
    left = max(most_mps2**2 - (x * way.across_mps2[n]) ** 2, (_LEAST_SHARE * most_mps2) ** 2)
    u = (-x * way.along_mps2[n] + sign * math.sqrt(left)) / max(way.speed_mps[n], _SLOW_MPS)
    return float(sign * max(sign * u, 0.0))


@nb.njit(cache=True)
def _backwards(way: Way, most: Float, rest: int, most_mps2: float) -> Float:
    """Greatest x (N,) that keeps these bounds (N,), and reaches the rest at a sample (N: none)."""
    x = most.copy()
    x[rest:] = 0.0
    for n in range(len(x) - 2, -1, -1):
        slower = -2.0 * way.step_s[n] * _steepest(way, n, x[n + 1], most_mps2, -1.0)
        x[n] = min(x[n], x[n + 1] + slower)
    return x


@nb.njit(cache=True)
def _wanted(way: Way, bound: Float, rest: int, effort: Effort) -> Float:
    """Greatest x (N,) in comfort: bounds count a reaction time t earlier.

    Before a rest, v t + v²/2a takes the v²/2a of the fastest stop.
    """
    count = len(bound)
    early = math.ceil(effort.reaction_s / way.step_s.max())
    x: Float = np.empty(count)
    for n in range(count):
        x[n] = bound[n : n + early + 1].min() ** 2
    x = _backwards(way, x, count, effort.comfort_mps2)
    stop = _backwards(way, np.full(count, np.inf), rest, effort.comfort_mps2)
    gained = effort.comfort_mps2 * effort.reaction_s
    for n in range(min(rest, count)):
        speed = max(way.speed_mps[n], _SLOW_MPS)
        if rest < count:
            x[n] = min(x[n], ((math.sqrt(gained**2 + stop[n] * speed**2) - gained) / speed) ** 2)
    x[rest:] = 0.0
    kept = x.copy()
    for n in range(min(rest, count) - 1):  # a plan that speeds up is begun at a rate that will do later
        for later in range(n + 1, min(n + early, (n + min(rest, count)) // 2) + 1):
            if way.speed_mps[later] > way.speed_mps[n]:
                x[n] = min(x[n], kept[later])
    return x


@nb.njit(cache=True)
def _lasts_s(way: Way, n: int, x: float, jerk_mps3: float) -> float:
    """How long the step after a sample takes, s: from standstill, as long as that jerk does for it."""
    speed = max(way.speed_mps[n], _SLOW_MPS)
    from_rest_s = (6.0 * way.step_s[n] * speed / jerk_mps3) ** (1.0 / 3.0)
    return float(min(way.step_s[n] / math.sqrt(x + _SPARE), from_rest_s))


@nb.njit(cache=True)
def fastest_rates(
    way: Way, rate: tuple[float, float], bound: Float, rest: int, effort: Effort
) -> tuple[Float, float, bool]:
    """Rates (N,) along a way, how far before the sample of rest it comes, s, and whether it is kept.

    Args:
        way: the trajectory from now on.
        rate: now, and how it changes, 1/s.
        bound: (N,) on the rates; where the present one is too high already, it is come down to.
        rest: number of the sample at which it must be at rest, or N: nowhere.
        effort: accelerations.
    """
    wanted = _wanted(way, bound, rest, effort)
    needed = _backwards(way, np.ones(len(bound)), rest, effort.most_mps2)
    along_mps2, early_s = rate[1] * way.speed_mps[0], 0.0  # what the change of rate gives
    x: Float = np.zeros(len(bound))
    x[0] = rate[0] ** 2
    kept = x[0] <= needed[0] + _SPARE
    for n in range(len(bound) - 1):
        span, speed = 2.0 * way.step_s[n], max(way.speed_mps[n], _SLOW_MPS)
        turn = effort.jerk_mps3 * _lasts_s(way, n, x[n], effort.jerk_mps3)
        left = max(math.sqrt(wanted[n + 1]) - math.sqrt(x[n]), 0.0)
        gently = math.sqrt(2.0 * left * effort.jerk_mps3 / speed)  # and ends as the rate is there
        faster = min(_steepest(way, n, x[n], effort.comfort_mps2, 1.0), (along_mps2 + turn) / speed, gently)
        slower = max(_steepest(way, n, x[n], effort.comfort_mps2, -1.0), (along_mps2 - turn) / speed)
        hardest = _steepest(way, n, x[n], effort.most_mps2, -1.0)
        if wanted[n + 1] > 0.0 or x[n] * way.speed_mps[n] ** 2 > _CREEP_MPS**2:
            u = max(min((wanted[n + 1] - x[n]) / span, faster), slower)
        else:  # the rest of the sample would take for ever
            u = slower
        u = max(min(u, (needed[n + 1] - x[n]) / span), hardest)
        if x[n] + span * u <= 0.0:
            early_s = way.step_s[n] + x[n] / (2.0 * u) if u < 0.0 else 0.0
            break
        x[n + 1] = x[n] + span * u
        along_mps2 = u * way.speed_mps[n]
    return np.sqrt(x), early_s, kept
