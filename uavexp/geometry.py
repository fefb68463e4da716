"""Rotations and trajectories as small pure functions on arrays.

Quaternions are (w, x, y, z), body to world. The numba kernels (names with a leading
verb, arrays in and out) may be called from other kernels.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from uavexp.types import Float, Trajectory

GRAVITY_MPS2 = 9.81


def quaternion_from_yaw(yaw_rad: float) -> Float:
    """Quaternion (4,) of a rotation about z."""
    return np.array([math.cos(0.5 * yaw_rad), 0.0, 0.0, math.sin(0.5 * yaw_rad)])


@nb.njit(cache=True)
def rotation_from_quaternion(q: Float) -> Float:
    """Rotation matrix (3, 3), body to world, of a unit quaternion (4,)."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    rotation = np.empty((3, 3))
    rotation[0, 0] = 1 - 2 * (y * y + z * z)
    rotation[0, 1] = 2 * (x * y - w * z)
    rotation[0, 2] = 2 * (x * z + w * y)
    rotation[1, 0] = 2 * (x * y + w * z)
    rotation[1, 1] = 1 - 2 * (x * x + z * z)
    rotation[1, 2] = 2 * (y * z - w * x)
    rotation[2, 0] = 2 * (x * z - w * y)
    rotation[2, 1] = 2 * (y * z + w * x)
    rotation[2, 2] = 1 - 2 * (x * x + y * y)
    return rotation


@nb.njit(cache=True)
def quaternion_from_rotation(rotation: Float) -> Float:
    """Unit quaternion (4,) with w >= 0 of a rotation matrix (3, 3); Shepperd's method."""
    q = np.empty(4)
    trace = rotation[0, 0] + rotation[1, 1] + rotation[2, 2]
    if trace > 0.0:
        s = 2.0 * math.sqrt(trace + 1.0)
        q[0] = 0.25 * s
        q[1] = (rotation[2, 1] - rotation[1, 2]) / s
        q[2] = (rotation[0, 2] - rotation[2, 0]) / s
        q[3] = (rotation[1, 0] - rotation[0, 1]) / s
    else:
        i = 0
        if rotation[1, 1] > rotation[0, 0]:
            i = 1
        if rotation[2, 2] > rotation[i, i]:
            i = 2
        j, k = (i + 1) % 3, (i + 2) % 3
        s = 2.0 * math.sqrt(max(0.0, 1.0 + rotation[i, i] - rotation[j, j] - rotation[k, k]))
        q[0] = (rotation[k, j] - rotation[j, k]) / s
        q[1 + i] = 0.25 * s
        q[1 + j] = (rotation[j, i] + rotation[i, j]) / s
        q[1 + k] = (rotation[k, i] + rotation[i, k]) / s
    if q[0] < 0.0:
        q = -q
    return q / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])


@nb.njit(cache=True)
def multiply_quaternions(a: Float, b: Float) -> Float:
    """Hamilton product a ⊗ b of quaternions (4,)."""
    out = np.empty(4)
    out[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3]
    out[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2]
    out[2] = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1]
    out[3] = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]
    return out


@nb.njit(cache=True)
def yaw_of(q: Float) -> float:
    """Yaw of a quaternion (4,), rad in (-pi, pi]."""
    return math.atan2(2.0 * (q[0] * q[3] + q[1] * q[2]), 1.0 - 2.0 * (q[2] * q[2] + q[3] * q[3]))


@nb.njit(cache=True)
def wrap_angle(angle_rad: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


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


def polyline_length_m(points_m: Float) -> float:
    """Length of a polyline (N, 3)."""
    return float(np.linalg.norm(np.diff(points_m, axis=0), axis=1).sum())
