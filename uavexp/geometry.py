"""Rotations and polylines as small pure functions on arrays.

Quaternions are (w, x, y, z), body to world. The numba kernels (names with a leading
verb, arrays in and out) may be called from other kernels.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from uavexp.arrays import Float

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


def polyline_length_m(points_m: Float) -> float:
    """Length of a polyline (N, 3)."""
    return float(np.linalg.norm(np.diff(points_m, axis=0), axis=1).sum())
