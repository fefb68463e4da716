"""Point mass: ideal thrust along an attitude that turns to the command at the rate limit.

The simplest vehicle behind the same interface: no rotors, no drag, no attitude dynamics.
What a strategy gains or loses on the quadrotor against this one is due to the dynamics.

Over one step the attitude turns about a fixed axis to the commanded one, at most at the
rate limit; thrust acts along the attitude of mid-step: v and p are those of a constant
acceleration.
"""

from __future__ import annotations

import math
from dataclasses import field

import numba as nb
import numpy as np

from uavexp.arrays import Float
from uavexp.geometry import GRAVITY_MPS2
from uavexp.parameters import Positive, option
from uavexp.types import Command, State
from uavexp.vehicle.body import Body


@nb.njit(cache=True)
def _advance(x: Float, command: Float, mass_kg: float, max_rate_radps: float, step_s: float) -> None:
    """Advance `x` = [p, v, q, rate] in place under command = [thrust, q]."""
    q, wanted = x[6:10].copy(), command[1:5]
    ew = q[0] * wanted[0] + q[1] * wanted[1] + q[2] * wanted[2] + q[3] * wanted[3]
    e = np.empty(3)
    e[0] = q[0] * wanted[1] - q[1] * wanted[0] - q[2] * wanted[3] + q[3] * wanted[2]
    e[1] = q[0] * wanted[2] + q[1] * wanted[3] - q[2] * wanted[0] - q[3] * wanted[1]
    e[2] = q[0] * wanted[3] - q[1] * wanted[2] + q[2] * wanted[1] - q[3] * wanted[0]
    if ew < 0.0:  # the shorter way round
        ew, e = -ew, -e
    sine = math.sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2])
    angle = 2.0 * math.atan2(sine, ew)
    turned = min(angle, max_rate_radps * step_s)
    axis = e / sine if sine > 1e-15 else np.zeros(3)
    mid = _turned(q, axis, 0.5 * turned)
    thrust = max(command[0], 0.0) / mass_kg
    acceleration = np.empty(3)
    acceleration[0] = 2.0 * (mid[1] * mid[3] + mid[0] * mid[2]) * thrust
    acceleration[1] = 2.0 * (mid[2] * mid[3] - mid[0] * mid[1]) * thrust
    acceleration[2] = (1.0 - 2.0 * (mid[1] * mid[1] + mid[2] * mid[2])) * thrust - GRAVITY_MPS2
    x[6:10] = _turned(q, axis, turned)
    for i in range(3):
        x[i] += step_s * (x[3 + i] + 0.5 * step_s * acceleration[i])
        x[3 + i] += step_s * acceleration[i]
        x[10 + i] = axis[i] * turned / step_s


@nb.njit(cache=True)
def _turned(q: Float, axis: Float, angle_rad: float) -> Float:
    """Quaternion `q` turned by an angle about an axis (3,) of the body frame, of unit length."""
    c, s = math.cos(0.5 * angle_rad), math.sin(0.5 * angle_rad)
    ax, ay, az = s * axis[0], s * axis[1], s * axis[2]
    out = np.empty(4)
    out[0] = q[0] * c - q[1] * ax - q[2] * ay - q[3] * az
    out[1] = q[0] * ax + q[1] * c + q[2] * az - q[3] * ay
    out[2] = q[0] * ay - q[1] * az + q[2] * c + q[3] * ax
    out[3] = q[0] * az + q[1] * ay - q[2] * ax + q[3] * c
    return out / math.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2 + out[3] ** 2)


@option
class PointMass(Body):
    """Point mass with ideal thrust and a rate-limited attitude."""

    max_body_rate_radps: Positive = 2.0  # rad/s, how fast the attitude turns at most; paper 1
    _x: Float = field(init=False, repr=False)
    _command: Float = field(init=False, repr=False)

    def reset(self, state: State) -> None:
        """Begin a trial in `state`."""
        self._x = np.empty(13)
        self._command = np.empty(5)
        self.place(state)

    def step(self, command: Command, step_s: float) -> State:
        """Advance by `step_s` under a constant command and return the new state."""
        self._command[0] = command.thrust_N
        self._command[1:5] = command.quaternion_wxyz
        _advance(self._x, self._command, self.mass_kg, self.max_body_rate_radps, step_s)
        x = self._x.copy()
        return State(
            position_m=x[0:3], velocity_mps=x[3:6], quaternion_wxyz=x[6:10], body_rate_radps=x[10:13]
        )

    def place(self, state: State) -> None:
        """Overwrite position, velocity, attitude and rate (after a contact)."""
        self._x[0:3] = state.position_m
        self._x[3:6] = state.velocity_mps
        self._x[6:10] = state.quaternion_wxyz
        self._x[10:13] = state.body_rate_radps
