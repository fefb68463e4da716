"""Differential flatness of a quadrotor: from position and yaw over time to everything it does.

The outputs [x, y, z, yaw] and their derivatives fix the state and the inputs (Mellinger and Kumar 2011;
Faessler, Franchi and Scaramuzza 2018 with drag). One frame: world z up, body x forward, y left, z up.

    f = m (a + g e3) + c |v| v                        thrust, N; c of the isotropic drag force
    z = f / |f|,  y = z × x_yaw / |z × x_yaw|,  x = y × z      attitude R = [x y z]
    [W]× = Rᵀ Ṙ,  [dW/dt]× = Ṙᵀ Ṙ + Rᵀ R̈               body rate and its derivative
    M = J dW/dt + W × J W + W × J_rotor Σ s_i w_i e3        moment, N m
    Σ F_i = |f|,  M as the rotors give it  ->  F_i = C_T w_i²   rotor speeds

With acceleration, jerk and snap given, R, W and dW/dt are exact: nothing is differenced.
Singular in free fall (f = 0) and when body z is level along the yaw (z ∥ x_yaw).

Left out, as in the model (`vehicle.quadrotor`): reaction of rotor acceleration, blade flapping. Rotor lag
is no part of the map: the speeds are those the rotors must have, not those to be commanded.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Float
from uavexp.geometry import GRAVITY_MPS2, quaternion_from_rotation
from uavexp.trajectory import Trajectory, derivative
from uavexp.vehicle.quadrotor import Plant

# rotor 1 front right, 2 front left, 3 rear left, 4 rear right
_SIDE_X = np.array([1.0, 1.0, -1.0, -1.0])
_SIDE_Y = np.array([-1.0, 1.0, 1.0, -1.0])
_SPIN = np.array([1.0, -1.0, 1.0, -1.0])
_GYROSCOPIC_ROUNDS = 3  # the rotors' own angular momentum is a thousandth of the moment


class FlatOutputs(NamedTuple):
    """Position and yaw at N instants, and their derivatives."""

    velocity_mps: Float  # (N, 3)
    acceleration_mps2: Float  # (N, 3)
    jerk_mps3: Float  # (N, 3)
    snap_mps4: Float  # (N, 3)
    yaw_rad: Float  # (N,)
    yaw_rate_radps: Float  # (N,)
    yaw_acceleration_radps2: Float  # (N,)


class Motion(NamedTuple):
    """Attitude, rates and thrust that the outputs ask for."""

    rotation: Float  # (N, 3, 3) body to world
    body_rate_radps: Float  # (N, 3) body frame
    body_acceleration_radps2: Float  # (N, 3) derivative of the body rate
    thrust_N: Float  # (N,) collective, along body z

    @property
    def quaternion_wxyz(self) -> Float:
        """Attitudes (N, 4), body to world, w >= 0."""
        return np.stack([quaternion_from_rotation(rotation) for rotation in self.rotation])


@dataclass(frozen=True, slots=True, kw_only=True)
class Demand:
    """What a trajectory asks of the rotors and the body, at N instants."""

    time_s: Float  # (N,)
    thrust_N: Float  # (N,)
    body_rate_radps: Float  # (N, 3)
    rotor_speed_radps: Float  # (N, 4); NaN where a rotor would have to pull down
    feasible: bool  # whether all of it is within the vehicle's rotor speeds and body rates


def motion(outputs: FlatOutputs, mass_kg: float, drag_kgpm: float = 0.0) -> Motion:
    """Attitude, body rate, its derivative and thrust of flat outputs.

    Args:
        outputs: at N instants.
        mass_kg: of the vehicle.
        drag_kgpm: c in the drag force -c |v| v.
    """
    thrust = _specific_thrust(outputs, drag_kgpm / mass_kg)
    z = _unit(thrust)
    cosine, sine, zero = np.cos(outputs.yaw_rad), np.sin(outputs.yaw_rad), np.zeros(len(outputs.yaw_rad))
    heading, across = np.stack([cosine, sine, zero], axis=1), np.stack([-sine, cosine, zero], axis=1)
    rate, change = outputs.yaw_rate_radps[:, None], outputs.yaw_acceleration_radps2[:, None]
    y = _unit(_cross(z, (heading, rate * across, change * across - rate**2 * heading)))
    x = _cross(y, z)
    r, r1, r2 = (np.stack([axis[order] for axis in (x, y, z)], axis=2) for order in range(3))
    spin = np.einsum("nji,njk->nik", r, r1)  # [W]×
    turn = np.einsum("nji,njk->nik", r1, r1) + np.einsum("nji,njk->nik", r, r2)
    return Motion(r, _vee(spin), _vee(turn), mass_kg * np.linalg.norm(thrust[0], axis=1))


@nb.njit(cache=True)
def attitude_and_rate(
    thrust_mps2: Float, thrust_rate_mps3: Float, yaw_rad: float, yaw_rate_radps: float
) -> tuple[Float, Float]:
    """Attitude (3, 3) and body rate (3,), rad/s, of `motion` at one instant, for controllers.

    Args:
        thrust_mps2: (3,) specific thrust a + g e3 + drag, world frame.
        thrust_rate_mps3: (3,) its derivative.
        yaw_rad: heading.
        yaw_rate_radps: its derivative.
    """
    length = np.sqrt((thrust_mps2**2).sum())
    z = thrust_mps2 / length
    z1 = (thrust_rate_mps3 - (z * thrust_rate_mps3).sum() * z) / length
    heading = np.array([np.cos(yaw_rad), np.sin(yaw_rad), 0.0])
    across = np.array([-heading[1], heading[0], 0.0])
    side = np.cross(z, heading)
    side1 = np.cross(z1, heading) + yaw_rate_radps * np.cross(z, across)
    y = side / np.sqrt((side**2).sum())
    x = np.cross(y, z)
    rotation = np.empty((3, 3))
    rotation[:, 0], rotation[:, 1], rotation[:, 2] = x, y, z
    turn = -(x * side1).sum() / np.sqrt((side**2).sum())  # dy/dt along -x
    return rotation, np.array([-(y * z1).sum(), (x * z1).sum(), turn])


def rotor_speeds(wanted: Motion, plant: Plant) -> Float:
    """Rotor speeds (N, 4), rad/s, that give this motion; NaN where a rotor would have to pull down."""
    inertia = np.array([plant.inertia_x_kgm2, plant.inertia_y_kgm2, plant.inertia_z_kgm2])
    rate = wanted.body_rate_radps
    moment = wanted.body_acceleration_radps2 * inertia + np.cross(rate, rate * inertia)
    speeds = np.zeros((len(rate), 4))
    for _ in range(_GYROSCOPIC_ROUNDS):
        spin = plant.rotor_inertia_kgm2 * np.nan_to_num(speeds) @ _SPIN
        gyroscopic = np.stack([rate[:, 1] * spin, -rate[:, 0] * spin, np.zeros(len(spin))], axis=1)
        total = moment + gyroscopic
        force = 0.25 * (
            wanted.thrust_N[:, None]
            + (total[:, :1] * _SIDE_Y - total[:, 1:2] * _SIDE_X) / plant.lever_m
            - total[:, 2:] * _SPIN * plant.thrust_coefficient / plant.torque_coefficient
        )
        speeds = np.sqrt(np.where(force >= 0.0, force, np.nan) / plant.thrust_coefficient)
    return speeds


def demand(
    trajectory: Trajectory,
    yaw_rad: float,
    plant: Plant,
    max_body_rate_radps: float,
    step_s: float = 0.01,
) -> Demand:
    """What a trajectory at constant yaw asks of a quadrotor, every `step_s`.

    Its snap, and so the moment, is taken piece by piece; at a break it may jump.
    """
    times = trajectory.start_s + np.arange(0.0, trajectory.duration_s, step_s)
    still = np.zeros(len(times))
    outputs = FlatOutputs(
        velocity_mps=derivative(trajectory, times, 1),
        acceleration_mps2=derivative(trajectory, times, 2),
        jerk_mps3=derivative(trajectory, times, 3),
        snap_mps4=derivative(trajectory, times, 4),
        yaw_rad=np.full(len(times), yaw_rad),
        yaw_rate_radps=still,
        yaw_acceleration_radps2=still,
    )
    wanted = motion(outputs, plant.mass_kg, plant.drag_kgpm)
    speeds = rotor_speeds(wanted, plant)
    kept = (speeds >= plant.min_rotor_speed_radps) & (speeds <= plant.max_rotor_speed_radps)  # NaN is neither
    slow = np.abs(wanted.body_rate_radps) <= max_body_rate_radps
    return Demand(
        time_s=times,
        thrust_N=wanted.thrust_N,
        body_rate_radps=wanted.body_rate_radps,
        rotor_speed_radps=speeds,
        feasible=bool(kept.all() and slow.all()),
    )


_Jet = tuple[Float, Float, Float]  # a vector (N, 3) over time with its first and second derivative


def _specific_thrust(outputs: FlatOutputs, drag_per_m: float) -> _Jet:
    """Specific thrust a + g e3 + (c/m) |v| v, m/s², and its derivatives."""
    v, a, j, s = outputs[:4]
    speed = np.linalg.norm(v, axis=1, keepdims=True)
    along = _divide(_dot(v, a), speed)  # d|v|/dt
    growth = _divide(_dot(a, a) + _dot(v, j) - along**2, speed)
    return (
        a + np.array([0.0, 0.0, GRAVITY_MPS2]) + drag_per_m * speed * v,
        j + drag_per_m * (along * v + speed * a),
        s + drag_per_m * (growth * v + 2.0 * along * a + speed * j),
    )


def _unit(vector: _Jet) -> _Jet:
    """The unit vector of a vector over time."""
    w, w1, w2 = vector
    length = np.linalg.norm(w, axis=1, keepdims=True)
    n = w / length
    length1 = _dot(n, w1)
    n1 = (w1 - length1 * n) / length
    length2 = _dot(n1, w1) + _dot(n, w2)
    return n, n1, (w2 - length2 * n - 2.0 * length1 * n1) / length


def _cross(a: _Jet, b: _Jet) -> _Jet:
    """Cross product of two vectors over time."""
    second = np.cross(a[2], b[0]) + 2.0 * np.cross(a[1], b[1]) + np.cross(a[0], b[2])
    return np.cross(a[0], b[0]), np.cross(a[1], b[0]) + np.cross(a[0], b[1]), second


def _vee(matrix: Float) -> Float:
    """The vectors (N, 3) of the antisymmetric parts of (N, 3, 3)."""
    skew = 0.5 * (matrix - np.swapaxes(matrix, 1, 2))
    return np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)


def _dot(a: Float, b: Float) -> Float:
    return np.asarray(np.sum(a * b, axis=1, keepdims=True))


def _divide(a: Float, b: Float) -> Float:
    """Ratio a / b, and 0 where b is 0: drag has no slope at rest."""
    return np.divide(a, b, out=np.zeros_like(a), where=b > 0.0)
