"""Cascaded position-velocity loop with acceleration feed-forward, to thrust and attitude.

    v* = v_ref + clip(k_p (p_ref - p))
    a* = clip(a_ref + k_v (v* - v - |e| e / 2j)), of it along v at most k_s (v_most - |v|)
    f  = a* + (c / m) |v| v + g e3, tilted at most `max_tilt_rad`        thrust = m f . z_body

Body z of the wanted attitude points along f, its heading is the reference's yaw; the yaw
rate of the reference is fed forward. e is what the attitude gives sideways beyond a_ref, and
|e| e / 2j the velocity that still comes of it while the thrust turns back at the body-rate limit,
at jerk j: without it, a vehicle far off its reference turns back too late, again and again. The bound
along v is a barrier (Ames et al. 2017): however far behind the vehicle is, its speed comes no faster to
its limit than exponentially, and returns from beyond it. Clipping v* would not do, since a_ref drives on.
Paper 1 names a position-velocity loop and no more; gains and bounds are [ours].
"""

from __future__ import annotations

import math
from dataclasses import field
from typing import Annotated, NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Float
from uavexp.braking import jerk_mps3
from uavexp.errors import require
from uavexp.geometry import GRAVITY_MPS2, quaternion_from_rotation, rotation_from_quaternion
from uavexp.parameters import NonNegative, Positive, PositiveShare, above, at_most, option
from uavexp.types import Command, Limits, Reference, State
from uavexp.vehicle.base import Vehicle
from uavexp.vehicle.body import require_flyable_drag

_LEAST_LIFT = 0.3  # share of gravity that is always lifted, so that body z stays up


class Gains(NamedTuple):
    """Parameters of the loop, as the kernel takes them."""

    position_per_s: float
    velocity_per_s: float
    max_correction_mps: float
    max_tilt_rad: float
    drag_per_m: float
    max_speed_mps: float
    speed_gain_per_s: float
    max_jerk_mps3: float
    max_acceleration_mps2: float


@nb.njit(cache=True)
def _attitude(force: Float, yaw_rad: float) -> Float:
    """Quaternion (4,) with body z along `force` (3,), upward, and heading `yaw_rad`."""
    z = force / math.sqrt(force[0] * force[0] + force[1] * force[1] + force[2] * force[2])
    heading = np.array([math.cos(yaw_rad), math.sin(yaw_rad), 0.0])
    y = np.cross(z, heading)
    y /= math.sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2])
    x = np.cross(y, z)
    rotation = np.empty((3, 3))
    rotation[:, 0], rotation[:, 1], rotation[:, 2] = x, y, z
    attitude: Float = quaternion_from_rotation(rotation)
    return attitude


@nb.njit(cache=True)
def _clip_norm(vector: Float, limit: float) -> None:
    """Shorten a vector (3,) in place to the length `limit`."""
    norm = math.sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2])
    if norm > limit:
        vector *= limit / norm


@nb.njit(cache=True)
def _clip_along(acceleration: Float, velocity: Float, speed: float, limit: float) -> None:
    """Shorten an acceleration (3,) in place until it is at most `limit` along the velocity (3,)."""
    along = acceleration[0] * velocity[0] + acceleration[1] * velocity[1] + acceleration[2] * velocity[2]
    excess = along - limit * speed
    if excess > 0.0:
        acceleration -= excess / (speed * speed) * velocity


@nb.njit(cache=True)
def _still_to_come(body_z: Float, drag: Float, reference_acceleration: Float, gains: Gains) -> Float:
    """Velocity (3,), m/s, that the present tilt still gives beyond the reference while it is turned back."""
    excess = np.zeros(3)
    lift = max(GRAVITY_MPS2 + reference_acceleration[2], _LEAST_LIFT * GRAVITY_MPS2)
    for i in range(2):
        excess[i] = lift * body_z[i] / max(body_z[2], _LEAST_LIFT) - drag[i] - reference_acceleration[i]
    _clip_norm(excess, gains.max_acceleration_mps2)
    excess *= 0.5 / gains.max_jerk_mps3 * math.sqrt(excess[0] * excess[0] + excess[1] * excess[1])
    return excess


@nb.njit(cache=True)
def thrust_and_attitude(
    position_m: Float,
    velocity_mps: Float,
    q: Float,
    reference_position_m: Float,
    reference_velocity_mps: Float,
    reference_acceleration_mps2: Float,
    yaw_rad: float,
    gains: Gains,
) -> tuple[float, Float]:
    """Specific thrust along body z, m/s², and wanted attitude (4,); see the module's equations."""
    body_z = rotation_from_quaternion(q)[:, 2]
    speed = math.sqrt(velocity_mps[0] ** 2 + velocity_mps[1] ** 2 + velocity_mps[2] ** 2)
    drag = gains.drag_per_m * speed * velocity_mps
    correction = gains.position_per_s * (reference_position_m - position_m)
    _clip_norm(correction, gains.max_correction_mps)
    wanted_mps = reference_velocity_mps + correction
    wanted_mps -= _still_to_come(body_z, drag, reference_acceleration_mps2, gains)
    force = reference_acceleration_mps2 + gains.velocity_per_s * (wanted_mps - velocity_mps)
    _clip_norm(force, gains.max_acceleration_mps2)
    if speed > 0.0:
        _clip_along(force, velocity_mps, speed, gains.speed_gain_per_s * (gains.max_speed_mps - speed))
    force += drag
    force[2] = max(force[2] + GRAVITY_MPS2, _LEAST_LIFT * GRAVITY_MPS2)
    sideways = math.sqrt(force[0] * force[0] + force[1] * force[1])
    most = force[2] * math.tan(gains.max_tilt_rad)
    if sideways > most:
        force[0] *= most / sideways
        force[1] *= most / sideways
    thrust = force[0] * body_z[0] + force[1] * body_z[1] + force[2] * body_z[2]
    return max(thrust, 0.0), _attitude(force, yaw_rad)


@option
class PositionVelocity:
    """Cascaded position-velocity loop with acceleration feed-forward."""

    rate_hz: Positive = 100.0  # Hz; paper 1
    position_gain_per_s: Positive = 2.0  # 1/s, from position error to a correction of velocity [ours]
    velocity_gain_per_s: Positive = 5.0  # 1/s, from velocity error to acceleration [ours]
    max_correction_mps: Positive = 1.0  # m/s, largest correction of velocity for a position error [ours]
    speed_gain_per_s: Positive = 3.0  # 1/s, from what is left to the speed bound to the largest
    # acceleration along the motion; the attitude lags by 0.2 s [ours]
    speed_share: PositiveShare = 0.99  # of the vehicle's speed limit: the speed bound; that lag carries the
    # vehicle 0.1 % beyond it [ours]
    acceleration_share: Positive = 2.0  # of the vehicle's acceleration limit: largest acceleration asked for;
    # plans use up to one [ours]
    max_tilt_rad: Annotated[float, above(0), at_most(1.2)] = 0.6  # rad, largest tilt asked for;
    # 2.5 m/s^2 needs 0.25 [ours]
    drag_kgpm: NonNegative = 0.0  # kg/m, c in the drag force c v^2 to make up for;
    # the quadrotor's 0.0026 moves it by 2 mm [ours]
    _limits: Limits = field(init=False, repr=False)
    _mass_kg: float = field(init=False, repr=False)

    def __post_init__(self) -> None:
        for name in ("position_gain_per_s", "velocity_gain_per_s", "speed_gain_per_s"):
            gain = getattr(self, name)
            require(
                gain <= self.rate_hz,
                f"{name} = {gain:g} must be at most rate_hz = {self.rate_hz:g}, at which the loop is run",
            )

    def requires(self, *, vehicle: Vehicle, **_: object) -> None:
        """Refuse to make up for a drag that the vehicle could not fly against."""
        require_flyable_drag("drag_kgpm", self.drag_kgpm, vehicle.mass_kg, vehicle.limits.max_speed_mps)

    def reset(self, limits: Limits, mass_kg: float) -> None:
        """Begin a trial of a vehicle with these limits, of this mass."""
        self._limits, self._mass_kg = limits, mass_kg

    @property
    def gains(self) -> Gains:
        """Parameters of the loop for the vehicle of this trial."""
        return Gains(
            position_per_s=self.position_gain_per_s,
            velocity_per_s=self.velocity_gain_per_s,
            max_correction_mps=self.max_correction_mps,
            max_tilt_rad=self.max_tilt_rad,
            drag_per_m=self.drag_kgpm / self._mass_kg,
            max_speed_mps=self.speed_share * self._limits.max_speed_mps,
            speed_gain_per_s=self.speed_gain_per_s,
            max_jerk_mps3=jerk_mps3(self._limits),
            max_acceleration_mps2=self.acceleration_share * self._limits.max_acceleration_mps2,
        )

    def command(self, estimated_state: State, reference: Reference) -> Command:
        """Return thrust and attitude that lead the state to the reference."""
        thrust, attitude = thrust_and_attitude(
            estimated_state.position_m,
            estimated_state.velocity_mps,
            estimated_state.quaternion_wxyz,
            reference.position_m,
            reference.velocity_mps,
            reference.acceleration_mps2,
            float(reference.yaw_rad),
            self.gains,
        )
        return Command(
            thrust_N=self._mass_kg * thrust,
            quaternion_wxyz=attitude,
            body_rate_radps=np.array([0.0, 0.0, reference.yaw_rate_radps]),
        )
