"""Quadrotor: what holds for every state, command and parameter."""

from __future__ import annotations

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from uavexp.geometry import multiply_quaternions, quaternion_from_yaw, rotation_from_quaternion
from uavexp.types import Command, State
from uavexp.vehicle.quadrotor import Quadrotor, derivative, mix

PLANT = Quadrotor().plant
angle = st.floats(-3.1, 3.1)


@st.composite
def quaternions(draw):
    q = np.array([draw(st.floats(-1.0, 1.0)) for _ in range(4)])
    norm = np.linalg.norm(q)
    return q / norm if norm > 1e-3 else np.array([1.0, 0.0, 0.0, 0.0])


def wrench(speeds):
    """Thrust and moment of rotor speeds, read off the equations of motion at rest."""
    x, out = np.zeros(17), np.empty(17)
    x[6], x[13:] = 1.0, speeds
    derivative(x, np.zeros(4), PLANT._replace(rotor_inertia_kgm2=0.0), out)
    inertia = np.array([PLANT.inertia_x_kgm2, PLANT.inertia_y_kgm2, PLANT.inertia_z_kgm2])
    return PLANT.mass_kg * (out[5] + 9.81), inertia * out[10:13]


@given(st.floats(-20.0, 60.0), *[st.floats(-3.0, 3.0)] * 3)
@settings(max_examples=300, deadline=None)
def test_mixer_keeps_rotor_limits_and_never_gives_up_tilt_for_yaw(thrust, roll, pitch, yaw):
    speeds = np.empty(4)
    mix(thrust, np.array([roll, pitch, yaw]), PLANT, speeds)
    low, high = PLANT.min_rotor_speed_radps, PLANT.max_rotor_speed_radps
    assert (speeds >= low * (1 - 1e-9)).all()
    assert (speeds <= high * (1 + 1e-9)).all()
    got_thrust, got = wrench(speeds)
    least, most = PLANT.thrust_coefficient * low**2, PLANT.thrust_coefficient * high**2
    need = (abs(roll) + abs(pitch)) / (4.0 * PLANT.lever_m)  # what a rotor gets and another one gives
    room = min(max(0.25 * thrust - least, 0.0), 0.5 * (most - least))
    share = min(1.0, room / need) if need > 0.0 else 1.0
    np.testing.assert_allclose(got[:2], [share * roll, share * pitch], atol=1e-8)
    assert got_thrust <= max(thrust, 4 * least) + 1e-8
    # yaw never overdone nor reversed
    assert got[2] * yaw >= -1e-9
    assert abs(got[2]) <= abs(yaw) + 1e-9
    if got[2] and abs(got[2]) < abs(yaw) - 1e-6:  # given up only where a rotor is at a limit
        assert np.isclose(speeds, low).any() or np.isclose(speeds, high).any()
    if 4 * least < thrust < 4 * (most - share * need):
        assert abs(got_thrust - thrust) < 1e-8


@given(quaternions(), quaternions(), st.floats(0.0, 20.0), st.floats(-5.0, 5.0))
@settings(max_examples=40, deadline=None)
def test_body_rates_stay_within_the_limit_and_states_finite(q, wanted, thrust, yaw_rate):
    vehicle = Quadrotor()
    vehicle.reset(
        State(
            position_m=np.zeros(3), velocity_mps=np.zeros(3), quaternion_wxyz=q, body_rate_radps=np.zeros(3)
        )
    )
    command = Command(thrust_N=thrust, quaternion_wxyz=wanted, body_rate_radps=np.array([0.0, 0.0, yaw_rate]))
    for _ in range(200):
        state = vehicle.step(command, 0.01)
        assert np.abs(state.body_rate_radps).max() <= 2.0
        assert abs(np.linalg.norm(state.quaternion_wxyz) - 1.0) < 1e-12
    assert np.isfinite(state.position_m).all()


@given(angle, quaternions(), st.floats(4.0, 12.0))
@settings(max_examples=40, deadline=None)
def test_the_flight_turns_with_the_world_about_the_vertical(yaw, wanted, thrust):
    # half turns have no preferred direction
    assume(rotation_from_quaternion(wanted)[2, 2] > -0.9 and abs(wanted[0]) > 0.1)
    turn = quaternion_from_yaw(yaw)
    rotation = rotation_from_quaternion(turn)
    velocity = np.array([2.0, -1.0, 0.5])
    ends = []
    for q, v in ((np.array([1.0, 0.0, 0.0, 0.0]), np.eye(3)), (turn, rotation)):
        vehicle = Quadrotor(drag_coefficient=30.0)
        vehicle.reset(
            State(
                position_m=np.zeros(3),
                velocity_mps=v @ velocity,
                quaternion_wxyz=q,
                body_rate_radps=np.zeros(3),
            )
        )
        command = Command(
            thrust_N=thrust, quaternion_wxyz=multiply_quaternions(q, wanted), body_rate_radps=np.zeros(3)
        )
        for _ in range(50):
            state = vehicle.step(command, 0.01)
        ends.append(state)
    np.testing.assert_allclose(ends[1].position_m, rotation @ ends[0].position_m, atol=1e-6)
    np.testing.assert_allclose(ends[1].velocity_mps, rotation @ ends[0].velocity_mps, atol=1e-5)
