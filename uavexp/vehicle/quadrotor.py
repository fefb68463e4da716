"""Newton-Euler quadrotor in X configuration with lagged rotors and an inner attitude loop.

Model (paper 4, DF-BIT*, in one frame: world z up, body x forward, y left, z up):

    m dv/dt     = R e3 sum(F_i) - m g e3 - 1/2 rho C_d A |v| v          F_i = C_T w_i^2
    J dW/dt     = M - W x J W - W x (J_rotor sum(s_i w_i) e3)
    M           = [ l sum(y_i F_i), -l sum(x_i F_i), -C_D sum(s_i w_i^2) ]   l = L / sqrt(2)
    dq/dt       = 1/2 q * (0, W)
    tau dw_i/dt = w_cmd_i - w_i

Rotor 1 front right, 2 front left, 3 rear left, 4 rear right; (x_i, y_i) = ±1 their sides,
s_i = ±1 the sense of rotation about body z (the paper's (-1)^(i+1)). Integrated by RK4 with
rotor commands constant over each sub-step; the attitude loop runs once per sub-step.

Left out: reaction torque of rotor acceleration, blade flapping, ground effect, wind, and
the paper's unmodelled disturbances.

Source: paper 4, Newton-Euler equations and table of parameters; the drag law (isotropic
bluff body), rotor lag, rotor inertia, speed range and the attitude loop are [ours].
"""

from __future__ import annotations

import math
from dataclasses import field
from typing import Annotated, NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Float
from uavexp.errors import require
from uavexp.geometry import GRAVITY_MPS2
from uavexp.parameters import NonNegative, Positive, between, option
from uavexp.types import Command, State
from uavexp.vehicle.body import Body, require_flyable_drag

# layout of the state vector of the kernels
_P, _V, _Q, _W, _ROTOR, _SIZE = 0, 3, 6, 10, 13, 17
_SIDE_X = (1.0, 1.0, -1.0, -1.0)  # front, front, rear, rear
_SIDE_Y = (-1.0, 1.0, 1.0, -1.0)  # right, left, left, right
_SPIN = (1.0, -1.0, 1.0, -1.0)  # about body z


class Plant(NamedTuple):
    """Constants of the equations of motion, as the kernels take them."""

    mass_kg: float
    inertia_x_kgm2: float
    inertia_y_kgm2: float
    inertia_z_kgm2: float
    thrust_coefficient: float
    torque_coefficient: float
    lever_m: float  # l, of one rotor about body x and y
    drag_kgpm: float  # 1/2 rho C_d A
    rotor_inertia_kgm2: float
    rotor_lag_s: float
    min_rotor_speed_radps: float
    max_rotor_speed_radps: float


class AttitudeLoop(NamedTuple):
    """Gains of the inner loop, as the kernels take them."""

    tilt_gain_per_s: float
    yaw_gain_per_s: float
    tilt_rate_gain_per_s: float
    yaw_rate_gain_per_s: float
    max_body_rate_radps: float  # of a commanded axis


@nb.njit(cache=True)
def derivative(x: Float, rotor_command_radps: Float, plant: Plant, out: Float) -> None:
    """Write d(state)/dt of the 17-vector [p, v, q, W, w] under rotor commands (4,) to `out`."""
    qw, qx, qy, qz = x[6], x[7], x[8], x[9]
    wx, wy, wz = x[10], x[11], x[12]
    thrust, moment_x, moment_y, moment_z, spin = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(4):
        speed = x[_ROTOR + i]
        force = plant.thrust_coefficient * speed * speed
        thrust += force
        moment_x += plant.lever_m * _SIDE_Y[i] * force
        moment_y -= plant.lever_m * _SIDE_X[i] * force
        moment_z -= plant.torque_coefficient * _SPIN[i] * speed * speed
        spin += plant.rotor_inertia_kgm2 * _SPIN[i] * speed
        out[_ROTOR + i] = (rotor_command_radps[i] - speed) / plant.rotor_lag_s
    drag = plant.drag_kgpm * math.sqrt(x[3] * x[3] + x[4] * x[4] + x[5] * x[5])
    for i in range(3):
        out[i] = x[3 + i]
    out[3] = (2.0 * (qx * qz + qw * qy) * thrust - drag * x[3]) / plant.mass_kg
    out[4] = (2.0 * (qy * qz - qw * qx) * thrust - drag * x[4]) / plant.mass_kg
    out[5] = ((1.0 - 2.0 * (qx * qx + qy * qy)) * thrust - drag * x[5]) / plant.mass_kg - GRAVITY_MPS2
    out[6] = -0.5 * (qx * wx + qy * wy + qz * wz)
    out[7] = 0.5 * (qw * wx + qy * wz - qz * wy)
    out[8] = 0.5 * (qw * wy + qz * wx - qx * wz)
    out[9] = 0.5 * (qw * wz + qx * wy - qy * wx)
    jx, jy, jz = plant.inertia_x_kgm2, plant.inertia_y_kgm2, plant.inertia_z_kgm2
    out[10] = (moment_x - (jz - jy) * wy * wz - wy * spin) / jx
    out[11] = (moment_y - (jx - jz) * wz * wx + wx * spin) / jy
    out[12] = (moment_z - (jy - jx) * wx * wy) / jz


@nb.njit(cache=True)
def integrate(x: Float, rotor_command_radps: Float, plant: Plant, step_s: float, work: Float) -> None:
    """Advance the 17-vector `x` in place by one RK4 step under constant rotor commands (4,).

    `work` is scratch space of shape (5, 17).
    """
    k1, k2, k3, k4, mid = work[0], work[1], work[2], work[3], work[4]
    derivative(x, rotor_command_radps, plant, k1)
    for i in range(_SIZE):
        mid[i] = x[i] + 0.5 * step_s * k1[i]
    derivative(mid, rotor_command_radps, plant, k2)
    for i in range(_SIZE):
        mid[i] = x[i] + 0.5 * step_s * k2[i]
    derivative(mid, rotor_command_radps, plant, k3)
    for i in range(_SIZE):
        mid[i] = x[i] + step_s * k3[i]
    derivative(mid, rotor_command_radps, plant, k4)
    for i in range(_SIZE):
        x[i] += step_s / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])
    norm = math.sqrt(x[6] * x[6] + x[7] * x[7] + x[8] * x[8] + x[9] * x[9])
    for i in range(6, 10):
        x[i] /= norm


@nb.njit(cache=True)
def wanted_body_rate(q: Float, wanted: Float, feed_forward: Float, loop: AttitudeLoop, rate: Float) -> None:
    """Write the commanded body rate (3,), rad/s, that turns attitude `q` into `wanted`, to `rate`.

    The tilt error (between the two body z axes) and the twist about body z are corrected
    apart, so that a large yaw error never bends the thrust direction. Each axis stays
    within the rate limit; tilt keeps its direction when limited.
    """
    # error quaternion conj(q) * wanted, in the body frame
    ew = q[0] * wanted[0] + q[1] * wanted[1] + q[2] * wanted[2] + q[3] * wanted[3]
    ex = q[0] * wanted[1] - q[1] * wanted[0] - q[2] * wanted[3] + q[3] * wanted[2]
    ey = q[0] * wanted[2] + q[1] * wanted[3] - q[2] * wanted[0] - q[3] * wanted[1]
    ez = q[0] * wanted[3] - q[1] * wanted[2] + q[2] * wanted[1] - q[3] * wanted[0]
    # wanted body z in the body frame, and the rotation about body x, y that leads there
    zx, zy, zz = 2.0 * (ex * ez + ew * ey), 2.0 * (ey * ez - ew * ex), 1.0 - 2.0 * (ex * ex + ey * ey)
    sine = math.sqrt(zx * zx + zy * zy)
    # exactly upside down has no preferred direction: roll
    axis_x, axis_y = (-zy / sine, zx / sine) if sine > 1e-12 else (1.0, 0.0)
    tilt = loop.tilt_gain_per_s * math.atan2(sine, zz)
    rate[0] = tilt * axis_x + feed_forward[0]
    rate[1] = tilt * axis_y + feed_forward[1]
    norm = math.sqrt(rate[0] * rate[0] + rate[1] * rate[1])
    if norm > loop.max_body_rate_radps:
        rate[0] *= loop.max_body_rate_radps / norm
        rate[1] *= loop.max_body_rate_radps / norm
    sign = 1.0 if ew >= 0.0 else -1.0  # the shorter way round
    twist = 2.0 * math.atan2(sign * ez, sign * ew)
    yaw = loop.yaw_gain_per_s * twist + feed_forward[2]
    rate[2] = min(max(yaw, -loop.max_body_rate_radps), loop.max_body_rate_radps)


@nb.njit(cache=True)
def mix(thrust_N: float, moment_Nm: Float, plant: Plant, rotor_command_radps: Float) -> None:
    """Write the rotor speeds (4,), rad/s, that give this thrust and moment (3,) as far as they can.

    When a rotor saturates, yaw moment is given up first, then roll and pitch at a rotor's least speed, thrust
    at its most: thrust is never raised for a moment, with which the vehicle would climb off its way.
    """
    low = plant.thrust_coefficient * plant.min_rotor_speed_radps**2
    high = plant.thrust_coefficient * plant.max_rotor_speed_radps**2
    share = max(0.25 * thrust_N, low)
    tilt = np.empty(4)
    for i in range(4):
        tilt[i] = (_SIDE_Y[i] * moment_Nm[0] - _SIDE_X[i] * moment_Nm[1]) / (4.0 * plant.lever_m)
    room = min(share - low, 0.5 * (high - low))
    if tilt.max() > room:  # as much is taken from one rotor as another one gets
        tilt *= room / tilt.max()
    share = min(share, high - tilt.max())
    yaw = -0.25 * moment_Nm[2] * plant.thrust_coefficient / plant.torque_coefficient
    for i in range(4):  # largest common share of the yaw moment that no rotor refuses
        force, extra = share + tilt[i], _SPIN[i] * yaw
        if extra > 0.0 and force + extra > high:
            yaw *= max(high - force, 0.0) / extra
        elif extra < 0.0 and force + extra < low:
            yaw *= min(low - force, 0.0) / extra
    for i in range(4):
        force = min(max(share + tilt[i] + _SPIN[i] * yaw, low), high)
        rotor_command_radps[i] = math.sqrt(force / plant.thrust_coefficient)


@nb.njit(cache=True)
def advance(
    x: Float, command: Float, plant: Plant, loop: AttitudeLoop, step_s: float, substeps: int, work: Float
) -> None:
    """Advance `x` in place by `substeps` of attitude loop, mixer and RK4; command = [T, q, rate]."""
    rate, moment, rotors = work[5, 0:3], work[5, 3:6], work[5, 6:10]
    jx, jy, jz = plant.inertia_x_kgm2, plant.inertia_y_kgm2, plant.inertia_z_kgm2
    for _ in range(substeps):
        wanted_body_rate(x[6:10], command[1:5], command[5:8], loop, rate)
        wx, wy, wz = x[10], x[11], x[12]
        # the loop cancels the gyroscopic coupling W x J W
        moment[0] = jx * loop.tilt_rate_gain_per_s * (rate[0] - wx) + (jz - jy) * wy * wz
        moment[1] = jy * loop.tilt_rate_gain_per_s * (rate[1] - wy) + (jx - jz) * wz * wx
        moment[2] = jz * loop.yaw_rate_gain_per_s * (rate[2] - wz) + (jy - jx) * wx * wy
        mix(command[0], moment, plant, rotors)
        integrate(x, rotors, plant, step_s / substeps, work)


def state_of(x: Float) -> State:
    """The state in a 17-vector, copied."""
    x = x.copy()
    return State(
        position_m=x[_P:_V], velocity_mps=x[_V:_Q], quaternion_wxyz=x[_Q:_W], body_rate_radps=x[_W:_ROTOR]
    )


@option
class Quadrotor(Body):
    """Rigid-body quadrotor with rotor lag, drag and a rate-limited attitude loop."""

    inertia_x_kgm2: Positive = 0.015  # kg m^2, about body x (roll); paper 4
    inertia_y_kgm2: Positive = 0.015  # kg m^2, about body y (pitch); paper 4
    inertia_z_kgm2: Positive = 0.024  # kg m^2, about body z (yaw); paper 4
    thrust_coefficient_Ns2: Positive = 3.3e-5  # N s^2, C_T in F = C_T w^2 of one rotor; paper 4
    torque_coefficient_Nms2: Positive = 5.5e-7  # N m s^2, C_D in M = C_D w^2 of one rotor; paper 4
    rotor_span_m: Positive = 0.152  # m, 2L, between opposite rotors; paper 4
    frontal_area_m2: NonNegative = 4.3e-3  # m^2, in the drag law; paper 4
    air_density_kgpm3: NonNegative = 1.225  # kg/m^3, sea level, 15 degrees C [ours]
    drag_coefficient: NonNegative = 1.0  # bluff body, the same from all sides; 0: no drag [ours]
    rotor_inertia_kgm2: NonNegative = 4.0e-6  # kg m^2, of one rotor and motor bell, 9 cm across; 0:
    # no gyroscopic moment [ours]
    rotor_lag_s: Positive = 0.02  # s, time constant of rotor speed; RotorS has 0.0125 up, 0.025 down [ours]
    min_rotor_speed_radps: NonNegative = 60.0  # rad/s, idle; hover is 236 rad/s [ours]
    max_rotor_speed_radps: Positive = 400.0  # rad/s, 2.9 times the weight [ours]
    tilt_gain_per_s: Positive = 8.0  # 1/s, from tilt error to commanded rate [ours]
    yaw_gain_per_s: Positive = 2.0  # 1/s, from yaw error to commanded rate [ours]
    tilt_rate_gain_per_s: Positive = 20.0  # 1/s, from roll and pitch rate error to angular
    # acceleration [ours]
    yaw_rate_gain_per_s: Positive = 6.0  # 1/s, from yaw rate error to angular acceleration;
    # the rotors give 5 rad/s^2 [ours]
    rate_margin: Annotated[float, between(0, 0.5)] = 0.05  # share of the body rate limit left to the rate
    # loop's overshoot (measured 0.033) [ours]
    substeps: Annotated[int, between(1, 100)] = 2  # RK4 and attitude loop steps per simulation step [ours]
    _plant: Plant = field(init=False, repr=False)
    _loop: AttitudeLoop = field(init=False, repr=False)
    _x: Float = field(init=False, repr=False)
    _command: Float = field(init=False, repr=False)
    _work: Float = field(init=False, repr=False)

    def __post_init__(self) -> None:
        hover = math.sqrt(self.mass_kg * GRAVITY_MPS2 / (4.0 * self.thrust_coefficient_Ns2))
        require(
            self.min_rotor_speed_radps < hover < self.max_rotor_speed_radps,
            f"rotor speeds must span the hover speed of {hover:.1f} rad/s, got min_rotor_speed_radps "
            f"{self.min_rotor_speed_radps} and max_rotor_speed_radps {self.max_rotor_speed_radps}",
        )
        drag_kgpm = 0.5 * self.air_density_kgpm3 * self.drag_coefficient * self.frontal_area_m2
        require_flyable_drag("drag_coefficient", drag_kgpm, self.mass_kg, self.max_speed_mps)
        self._plant = Plant(
            mass_kg=self.mass_kg,
            inertia_x_kgm2=self.inertia_x_kgm2,
            inertia_y_kgm2=self.inertia_y_kgm2,
            inertia_z_kgm2=self.inertia_z_kgm2,
            thrust_coefficient=self.thrust_coefficient_Ns2,
            torque_coefficient=self.torque_coefficient_Nms2,
            lever_m=0.5 * self.rotor_span_m / math.sqrt(2.0),
            drag_kgpm=drag_kgpm,
            rotor_inertia_kgm2=self.rotor_inertia_kgm2,
            rotor_lag_s=self.rotor_lag_s,
            min_rotor_speed_radps=self.min_rotor_speed_radps,
            max_rotor_speed_radps=self.max_rotor_speed_radps,
        )
        self._loop = AttitudeLoop(
            tilt_gain_per_s=self.tilt_gain_per_s,
            yaw_gain_per_s=self.yaw_gain_per_s,
            tilt_rate_gain_per_s=self.tilt_rate_gain_per_s,
            yaw_rate_gain_per_s=self.yaw_rate_gain_per_s,
            max_body_rate_radps=(1.0 - self.rate_margin) * self.max_body_rate_radps,
        )

    @property
    def plant(self) -> Plant:
        """Constants of the equations of motion."""
        return self._plant

    @property
    def loop(self) -> AttitudeLoop:
        """Gains of the inner loop."""
        return self._loop

    @property
    def x(self) -> Float:
        """The 17-vector of the kernels itself, which they advance."""
        return self._x

    @property
    def rotor_speed_radps(self) -> Float:
        """Rotor speeds (4,), rad/s."""
        return self._x[_ROTOR:].copy()

    def reset(self, state: State) -> None:
        """Begin a trial in `state`, the rotors at hover speed."""
        self._x = np.empty(_SIZE)
        self._command = np.empty(8)
        self._work = np.empty((6, _SIZE))
        self._x[_ROTOR:] = math.sqrt(self.mass_kg * GRAVITY_MPS2 / (4.0 * self.thrust_coefficient_Ns2))
        self.place(state)

    def step(self, command: Command, step_s: float) -> State:
        """Advance by `step_s` under a constant command and return the new state."""
        packed = self._command
        packed[0] = command.thrust_N
        packed[1:5] = command.quaternion_wxyz
        packed[5:8] = command.body_rate_radps
        advance(self._x, packed, self._plant, self._loop, step_s, self.substeps, self._work)
        return state_of(self._x)

    def place(self, state: State) -> None:
        """Overwrite position, velocity, attitude and rate; the rotors keep their speed."""
        self._x[_P:_V] = state.position_m
        self._x[_V:_Q] = state.velocity_mps
        self._x[_Q:_W] = state.quaternion_wxyz
        self._x[_W:_ROTOR] = state.body_rate_radps
