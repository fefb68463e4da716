"""Trajectories: piecewise polynomials, evaluated in batches and joined.

The numba kernels (arrays in and out) may be called from other kernels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba as nb
import numpy as np

from uavexp.arrays import Float, check_shape

_NO_WAIT_S = 1e-6  # a shorter piece may have no length at the times that a flight has


@dataclass(frozen=True, slots=True, kw_only=True)
class Trajectory:
    """Piecewise polynomial r(t), the common form of every planner's result.

    On piece k, with s = t - breaks_s[k]: r(t) = sum_j coefficients[k, j] s**j.
    Before the first break it stays at the start, after the last one it holds the end
    position at rest (the vehicle holds at the end of a trajectory; METHODS.md paper 1).
    """

    breaks_s: Float  # (K+1,) increasing, absolute trial time
    coefficients: Float  # (K, D+1, 3) ascending powers
    at_rest: bool  # whether the end velocity is zero

    def __post_init__(self) -> None:
        pieces = self.breaks_s.shape[0] - 1
        check_shape("coefficients", self.coefficients, (pieces, None, 3))
        if not (np.isfinite(self.breaks_s).all() and np.isfinite(self.coefficients).all()):
            raise ValueError("trajectory must be finite")
        if pieces < 1 or np.any(np.diff(self.breaks_s) <= 0.0):
            raise ValueError("breaks_s must increase")

    @property
    def start_s(self) -> float:
        """Time of the first break, s."""
        return float(self.breaks_s[0])

    @property
    def end_s(self) -> float:
        """Time of the last break, s."""
        return float(self.breaks_s[-1])

    @property
    def duration_s(self) -> float:
        """End minus start, s."""
        return self.end_s - self.start_s


@nb.njit(cache=True)
def evaluate_pieces(breaks_s: Float, coefficients: Float, times_s: Float) -> tuple[Float, Float, Float]:
    """Position, velocity and acceleration (N, 3) of a `Trajectory`'s arrays at times (N,).

    Before the first break: the start at rest; after the last: the end at rest.
    """
    count = times_s.shape[0]
    pieces, terms, _ = coefficients.shape
    position = np.zeros((count, 3))
    velocity = np.zeros((count, 3))
    acceleration = np.zeros((count, 3))
    for n in range(count):
        t = times_s[n]
        clamped = min(max(t, breaks_s[0]), breaks_s[pieces])
        k = min(max(np.searchsorted(breaks_s, clamped, side="right") - 1, 0), pieces - 1)
        s = clamped - breaks_s[k]
        moving = breaks_s[0] <= t <= breaks_s[pieces]
        for axis in range(3):
            p, v, a = 0.0, 0.0, 0.0
            for j in range(terms - 1, -1, -1):  # Horner, with both derivatives
                a = a * s + 2.0 * v
                v = v * s + p
                p = p * s + coefficients[k, j, axis]
            position[n, axis] = p
            if moving:
                velocity[n, axis] = v
                acceleration[n, axis] = a
    return position, velocity, acceleration


def evaluate(trajectory: Trajectory, times_s: Float) -> tuple[Float, Float, Float]:
    """Position m, velocity m/s and acceleration m/s², each (N, 3), at absolute times (N,)."""
    p, v, a = evaluate_pieces(trajectory.breaks_s, trajectory.coefficients, np.atleast_1d(times_s))
    return p, v, a


@nb.njit(cache=True)
def differentiate_pieces(breaks_s: Float, coefficients: Float, times_s: Float, order: int) -> Float:
    """The `order`-th derivative (N, 3) of a `Trajectory`'s arrays at times (N,).

    Outside, as in `evaluate_pieces`: the ends, at rest.
    """
    pieces, terms, _ = coefficients.shape
    out = np.zeros((times_s.shape[0], 3))
    for n in range(times_s.shape[0]):
        t = times_s[n]
        clamped = min(max(t, breaks_s[0]), breaks_s[pieces])
        if order > 0 and t != clamped:
            continue
        k = min(max(np.searchsorted(breaks_s, clamped, side="right") - 1, 0), pieces - 1)
        s = clamped - breaks_s[k]
        for j in range(terms - 1, order - 1, -1):  # Horner on coefficients times j! / (j - order)!
            factor = 1.0
            for i in range(order):
                factor *= j - i
            for axis in range(3):
                out[n, axis] = out[n, axis] * s + factor * coefficients[k, j, axis]
    return out


def derivative(trajectory: Trajectory, times_s: Float, order: int) -> Float:
    """Derivative of the position (N, 3), m/s^order, at absolute times (N,): 3 is jerk, 4 is snap."""
    pieces = (trajectory.breaks_s, trajectory.coefficients)
    value: Float = differentiate_pieces(*pieces, np.atleast_1d(times_s), order)
    return value


def sample_times(trajectory: Trajectory, from_s: float, step_s: float) -> Float:
    """Times from max(from_s, start) to the end, `step_s` apart, the end included."""
    begin = min(max(from_s, trajectory.start_s), trajectory.end_s)
    return np.append(np.arange(begin, trajectory.end_s, step_s), trajectory.end_s)


def join(first: Trajectory, second: Trajectory) -> Trajectory:
    """Fly one trajectory after the other; the second begins where and when the first ends."""
    terms = max(first.coefficients.shape[1], second.coefficients.shape[1])
    pieces = [
        np.pad(part.coefficients, ((0, 0), (0, terms - part.coefficients.shape[1]), (0, 0)))
        for part in (first, second)
    ]
    return Trajectory(
        breaks_s=np.concatenate([first.breaks_s, second.breaks_s[1:]]),
        coefficients=np.concatenate(pieces),
        at_rest=second.at_rest,
    )


def hover_before(trajectory: Trajectory, wait_s: float) -> Trajectory:
    """The trajectory begun `wait_s` later, standing at its start until then; it must start at rest."""
    if wait_s <= _NO_WAIT_S:
        return trajectory
    hover = np.zeros((1, *trajectory.coefficients.shape[1:]))
    hover[0, 0] = trajectory.coefficients[0, 0]
    return Trajectory(
        breaks_s=np.concatenate([trajectory.breaks_s[:1], trajectory.breaks_s + wait_s]),
        coefficients=np.concatenate([hover, trajectory.coefficients]),
        at_rest=trajectory.at_rest,
    )
