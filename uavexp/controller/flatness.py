"""The position-velocity loop with the body rate that the reference itself asks for.

Feedback, thrust and attitude are those of `position_velocity`. To the attitude loop it also gives the
rate at which the wanted attitude turns, which differential flatness takes from acceleration and jerk of
the reference (`uavexp.vehicle.quadrotor_flatness`), so the attitude need not lag behind for the rate to come:

    W_ff = W(a_ref + g e3 + (c / m) |v| v, its derivative, yaw, yaw rate)

turned into the frame of the wanted attitude, which the feedback tilts off the reference's. Leading the
attitude by the lag of rate loop and rotors was tried and is worse: the rate suffices.
"""

from __future__ import annotations

import math

import numba as nb

from uavexp.arrays import Float
from uavexp.controller.position_velocity import PositionVelocity
from uavexp.geometry import GRAVITY_MPS2, rotation_from_quaternion
from uavexp.parameters import NonNegative, option
from uavexp.types import Command, Reference, State
from uavexp.vehicle.quadrotor_flatness import attitude_and_rate


@nb.njit(cache=True)
def feed_forward(
    velocity_mps: Float,
    acceleration_mps2: Float,
    jerk_mps3: Float,
    yaw_rad: float,
    yaw_rate_radps: float,
    drag_per_m: float,
    attitude: Float,
) -> Float:
    """Body rate (3,) of the reference, in the frame of the wanted attitude (4,)."""
    speed = math.sqrt((velocity_mps**2).sum())
    thrust = acceleration_mps2 + drag_per_m * speed * velocity_mps
    thrust[2] += GRAVITY_MPS2
    change = jerk_mps3 + drag_per_m * speed * acceleration_mps2
    if speed > 0.0:
        change += drag_per_m * (velocity_mps * acceleration_mps2).sum() / speed * velocity_mps
    rotation, rate = attitude_and_rate(thrust, change, yaw_rad, yaw_rate_radps)
    turned: Float = rotation_from_quaternion(attitude).T @ (rotation @ rate)
    return turned


@option
class Flatness(PositionVelocity):
    """Position-velocity loop with body-rate feed-forward from differential flatness."""

    drag_kgpm: NonNegative = 0.0026  # kg/m, c in the drag force c v^2 to make up for: the quadrotor's [ours]

    def command(self, estimated_state: State, reference: Reference) -> Command:
        """Return thrust, attitude and body rate that lead the state to the reference."""
        wanted = PositionVelocity.command(self, estimated_state, reference)
        rate = feed_forward(
            reference.velocity_mps,
            reference.acceleration_mps2,
            reference.jerk_mps3,
            float(reference.yaw_rad),
            float(reference.yaw_rate_radps),
            self.drag_kgpm / self._mass_kg,
            wanted.quaternion_wxyz,
        )
        return Command(thrust_N=wanted.thrust_N, quaternion_wxyz=wanted.quaternion_wxyz, body_rate_radps=rate)
