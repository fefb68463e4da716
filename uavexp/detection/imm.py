"""Interacting multiple models of how one mover moves (Blom and Bar-Shalom 1988).

State (8,): position 3, velocity 3, turn rate ω of the level velocity, acceleration a along it. Four models
share it, each an extended Kalman filter with the position observed (Bar-Shalom, Li and Kirubarajan 2001,
§11.6 and §11.7):

steady: constant velocity (ω = a = 0).
turning: coordinated turn, ω walks at random, a = 0.
accelerating: straight on, the level speed changes by a that fades with `_FADES_S` (Singer 1970), ω = 0.
manoeuvring: constant velocity with much process noise: what none of the others knows.

A mapped obstacle reverses the part of the velocity that leads into it, `_KEPT` of it, and mirrors the
turn, in the filters' time step as in predictions. What a model does not use keeps its prior variance, so that
mixing gives the others no false certainty.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Float, Float32
from uavexp.field import DistanceField, value_at

STEADY, TURNING, ACCELERATING, MANOEUVRING = range(4)
MODELS, STATE = 4, 8
TURN, ALONG = 6, 7  # columns of the state
_FADES_S = 1.0  # of an acceleration
_KEPT = 0.9  # share of the speed into an obstacle that is kept
_SLOW_MPS = 0.1  # slower has no direction
_STRAIGHT_RADPS = 1e-4
_MOST_RADPS = 3.0
_MOST_MPS2 = 2.0
_ROOM_M = 0.02  # beyond half its width, at which a mover meets an obstacle
_LEAST_SHARE = 1e-4  # of any model: none is ever given up


class Habits(NamedTuple):
    """What is assumed of how movers move."""

    # spectral density of the process noise of each model (M, 4): of level and upright acceleration, m²/s³,
    # of the turn rate, rad²/s³, and of the acceleration along, m²/s⁵
    density: Float
    prior: Float  # (2,) variance of turn rate and acceleration along where nothing is known, rad²/s², m²/s⁴
    leaves_hz: float  # rate at which a mover leaves one model for another


HABITS = Habits(
    density=np.array([
        [0.009, 0.0003, 0.0, 0.0],
        [0.0013, 0.0003, 0.024, 0.0],
        [0.0013, 0.0003, 0.0, 0.005],
        [1.25, 0.1, 0.0, 0.0],
    ]),
    prior=np.array([1.0, 0.1]),
    leaves_hz=0.075,
)  # fmt: skip


class Walls(NamedTuple):
    """The mapped distance, and how near the mover's centre can come."""

    distance: Float32
    origin_m: Float
    voxel_size_m: float
    reach_m: float


def walls(field: DistanceField | None, half_size_m: Float) -> Walls:
    """Of a map; None: there are no walls."""
    if field is None:
        return Walls(np.full((1, 1, 1), np.inf, np.float32), np.zeros(3), 1.0, 0.0)
    reach_m = float(max(half_size_m[0], half_size_m[1])) + _ROOM_M
    return Walls(field.distance, field.origin_m, field.voxel_size_m, reach_m)


@nb.njit(cache=True)
def moved(model: int, state: Float, step_s: float) -> tuple[Float, Float]:
    """State (8,) of one model after a time step without walls, and the transition's Jacobian (8, 8)."""
    x, f = state.copy(), np.eye(8)
    for axis in range(3):
        x[axis] = state[axis] + step_s * state[3 + axis]
        f[axis, 3 + axis] = step_s
    vx, vy, rate, along = state[3], state[4], state[6], state[7]
    if model == TURNING and abs(rate) > _STRAIGHT_RADPS:
        s, c = math.sin(rate * step_s), math.cos(rate * step_s)
        a, b = s / rate, (1.0 - c) / rate
        x[0], x[1] = state[0] + a * vx - b * vy, state[1] + b * vx + a * vy
        x[3], x[4] = c * vx - s * vy, s * vx + c * vy
        f[0, 3], f[0, 4], f[1, 3], f[1, 4] = a, -b, b, a
        f[3, 3], f[3, 4], f[4, 3], f[4, 4] = c, -s, s, c
        da, db = (step_s * c - a) / rate, (step_s * s - b) / rate
        f[0, 6], f[1, 6] = da * vx - db * vy, db * vx + da * vy
        f[3, 6], f[4, 6] = -step_s * x[4], step_s * x[3]
    elif model == TURNING:
        f[0, 6], f[1, 6] = -0.5 * step_s**2 * vy, 0.5 * step_s**2 * vx
        f[3, 6], f[4, 6] = -step_s * vy, step_s * vx
    elif model == ACCELERATING:
        speed = math.sqrt(vx * vx + vy * vy)
        fades = math.exp(-step_s / _FADES_S)
        gain = _FADES_S * (1.0 - fades)  # of speed
        way = _FADES_S * (step_s - gain)  # of place
        x[7], f[7, 7] = along * fades, fades
        if speed > _SLOW_MPS:
            gain_s, way_s = max(along * gain, -speed), max(along * way, -0.5 * speed * step_s)
            ux, uy = vx / speed, vy / speed
            x[0], x[1] = x[0] + way_s * ux, x[1] + way_s * uy
            x[3], x[4] = vx + gain_s * ux, vy + gain_s * uy
            across = ((uy * uy, -ux * uy), (-ux * uy, ux * ux))
            for i in range(2):
                for j in range(2):
                    f[i, 3 + j] += way_s / speed * across[i][j]
                    f[3 + i, 3 + j] += gain_s / speed * across[i][j]
            f[0, 7], f[1, 7], f[3, 7], f[4, 7] = way * ux, way * uy, gain * ux, gain * uy
    return x, f


@nb.njit(cache=True)
def rebound(before: Float, after: Float, walls: Walls) -> Float:
    """Unit normal (3,) of the obstacle that a step ran into; zero where there is none."""
    normal = np.zeros(3)
    there = value_at(walls.distance, walls.origin_m, walls.voxel_size_m, after[0], after[1], after[2])
    if there >= walls.reach_m:
        return normal
    here = value_at(walls.distance, walls.origin_m, walls.voxel_size_m, before[0], before[1], before[2])
    if there >= here:
        return normal
    for axis in range(3):
        point, step = after[:3].copy(), 0.5 * walls.voxel_size_m
        point[axis] += step
        more = value_at(walls.distance, walls.origin_m, walls.voxel_size_m, point[0], point[1], point[2])
        point[axis] -= 2.0 * step
        less = value_at(walls.distance, walls.origin_m, walls.voxel_size_m, point[0], point[1], point[2])
        normal[axis] = more - less
    length = math.sqrt((normal**2).sum())
    return normal / length if length > 1e-6 else np.zeros(3)


@nb.njit(cache=True)
def stepped(model: int, state: Float, step_s: float, walls: Walls) -> tuple[Float, Float]:
    """`moved` among walls: a velocity that leads into one is reversed."""
    x, f = moved(model, state, step_s)
    normal = rebound(state, x, walls)
    into = (normal * x[3:6]).sum()
    if into < 0.0:
        mirror = np.eye(8)
        for i in range(3):
            for j in range(3):
                mirror[3 + i, 3 + j] -= (1.0 + _KEPT) * normal[i] * normal[j]
        mirror[6, 6] = -1.0
        velocity = x[3:6].copy()
        x[:3] = state[:3]
        x[3:6] = velocity - (1.0 + _KEPT) * into * normal
        x[6] = -x[6]
        f = mirror @ f
    return x, f


@nb.njit(cache=True)
def noise_of(model: int, step_s: float, density: Float) -> Float:
    """Process noise (8, 8) of a model in a time step."""
    q = np.zeros((8, 8))
    for axis in range(3):
        of = density[1] if axis == 2 else density[0]
        q[axis, axis] = of * step_s**3 / 3.0
        q[axis, 3 + axis] = q[3 + axis, axis] = of * step_s**2 / 2.0
        q[3 + axis, 3 + axis] = of * step_s
    q[6, 6], q[7, 7] = density[2] * step_s, density[3] * step_s
    return q


@nb.njit(cache=True)
def _confine(model: int, state: Float, covariance: Float, prior: Float) -> None:
    """Give what a model does not use its prior, and keep what it uses within reason; in place."""
    for column in (6, 7):
        if model != (TURNING if column == 6 else ACCELERATING):
            state[column] = 0.0
            covariance[column, :] = 0.0
            covariance[:, column] = 0.0
            covariance[column, column] = prior[column - 6]
    state[6] = min(max(state[6], -_MOST_RADPS), _MOST_RADPS)
    state[7] = min(max(state[7], -_MOST_MPS2), _MOST_MPS2)


@nb.njit(cache=True)
def _mix(
    states: Float, covariances: Float, shares: Float, stays: float, prior: Float
) -> tuple[Float, Float, Float]:
    """States (M, 8), covariances (M, 8, 8) and shares (M,) that the models begin a step with."""
    count = len(shares)
    leaves = (1.0 - stays) / (count - 1)
    mixed, spread, after = np.zeros((count, 8)), np.zeros((count, 8, 8)), np.zeros(count)
    for j in range(count):
        weight = leaves * shares
        weight[j] = stays * shares[j]
        after[j] = weight.sum()
        weight /= after[j]
        for i in range(count):
            mixed[j] += weight[i] * states[i]
        for i in range(count):
            apart = states[i] - mixed[j]
            spread[j] += weight[i] * (covariances[i] + np.outer(apart, apart))
        _confine(j, mixed[j], spread[j], prior)
    return mixed, spread, after


@nb.njit(cache=True)
def predict(
    states: Float, covariances: Float, shares: Float, step_s: float, habits: Habits, walls: Walls
) -> tuple[Float, Float, Float]:
    """Mix the models and move each on by a time step > 0; returns states, covariances and shares."""
    mixed, spread, after = _mix(
        states, covariances, shares, math.exp(-habits.leaves_hz * step_s), habits.prior
    )
    for j in range(len(after)):
        x, f = stepped(j, mixed[j], step_s, walls)
        mixed[j], spread[j] = x, f @ spread[j] @ f.T + noise_of(j, step_s, habits.density[j])
    return mixed, spread, after


@nb.njit(cache=True)
def observe(
    states: Float, covariances: Float, shares: Float, seen_m: Float, variance: Float, habits: Habits
) -> tuple[Float, Float, Float]:
    """Take in an observed centre (3,) with this variance (3,); returns states, covariances and shares."""
    count = len(shares)
    new, spread, log = np.empty_like(states), np.empty_like(covariances), np.empty(count)
    for j in range(count):
        p = covariances[j]
        s = p[:3, :3] + np.diag(variance)
        inverse = np.linalg.inv(s)
        apart = seen_m - states[j, :3]
        gain = np.ascontiguousarray(p[:, :3]) @ inverse
        new[j] = states[j] + gain @ apart
        keep = np.eye(8)
        keep[:, :3] -= gain
        spread[j] = keep @ p @ keep.T + (gain * variance) @ gain.T  # Joseph's form: stays positive
        log[j] = -0.5 * ((apart @ inverse @ apart) + math.log(np.linalg.det(s)))
        _confine(j, new[j], spread[j], habits.prior)
    after = shares * np.exp(log - log.max())
    after = np.maximum(after / after.sum(), _LEAST_SHARE)
    return new, spread, after / after.sum()


@nb.njit(cache=True)
def merged(states: Float, covariances: Float, shares: Float) -> tuple[Float, Float]:
    """Mean (6,) and covariance (6, 6) of position and velocity over the models."""
    mean, spread = np.zeros(6), np.zeros((6, 6))
    for j in range(len(shares)):
        mean += shares[j] * states[j, :6]
    for j in range(len(shares)):
        apart = states[j, :6] - mean
        spread += shares[j] * (covariances[j, :6, :6] + np.outer(apart, apart))
    return mean, spread


@nb.njit(cache=True)
def ahead(states: Float, shares: Float, step_s: float, count: int, walls: Walls) -> Float:
    """Mean places (count, 3) that the models predict one time step after the other."""
    places = np.zeros((count, 3))
    for j in range(len(shares)):
        x = states[j].copy()
        for k in range(count):
            x = stepped(j, x, step_s, walls)[0]
            places[k] += shares[j] * x[:3]
    return places
