"""The point mass against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from uavexp.geometry import GRAVITY_MPS2, quaternion_from_yaw, yaw_of
from uavexp.types import Command, State
from uavexp.vehicle.point_mass import PointMass


def start(velocity=(0.0, 0.0, 0.0)) -> State:
    return State(
        position_m=np.array([0.0, 0.0, 10.0]),
        velocity_mps=np.array(velocity),
        quaternion_wxyz=np.array([1.0, 0.0, 0.0, 0.0]),
        body_rate_radps=np.zeros(3),
    )


def level(thrust_N: float) -> Command:
    q = np.array([1.0, 0.0, 0.0, 0.0])
    return Command(thrust_N=thrust_N, quaternion_wxyz=q, body_rate_radps=np.zeros(3))


def test_without_thrust_it_flies_a_parabola():
    vehicle = PointMass()
    vehicle.reset(start((2.0, -1.0, 3.0)))
    for _ in range(100):
        state = vehicle.step(level(0.0), 0.01)
    np.testing.assert_allclose(state.position_m, [2.0, -1.0, 13.0 - 0.5 * GRAVITY_MPS2], atol=1e-12)
    np.testing.assert_allclose(state.velocity_mps, [2.0, -1.0, 3.0 - GRAVITY_MPS2], atol=1e-12)


def test_attitude_turns_at_the_rate_limit_and_stops():
    vehicle = PointMass(max_body_rate_radps=2.0)
    vehicle.reset(start())
    turn = Command(thrust_N=7.3575, quaternion_wxyz=quaternion_from_yaw(1.0), body_rate_radps=np.zeros(3))
    states = [vehicle.step(turn, 0.01) for _ in range(60)]
    yaw = np.array([yaw_of(s.quaternion_wxyz) for s in states])
    np.testing.assert_allclose(yaw, np.minimum(0.02 * np.arange(1, 61), 1.0), atol=1e-12)
    assert states[10].body_rate_radps[2] == pytest.approx(2.0)
    np.testing.assert_allclose(states[-1].body_rate_radps, 0.0, atol=1e-12)


def test_both_signs_of_a_quaternion_are_one_attitude():
    for sign in (1.0, -1.0):
        vehicle = PointMass()
        vehicle.reset(start())
        q = sign * quaternion_from_yaw(0.3)
        for _ in range(30):
            state = vehicle.step(Command(thrust_N=7.0, quaternion_wxyz=q, body_rate_radps=np.zeros(3)), 0.01)
        assert yaw_of(state.quaternion_wxyz) == pytest.approx(0.3)


def test_negative_thrust_does_not_pull():
    vehicle = PointMass()
    vehicle.reset(start())
    assert vehicle.step(level(-100.0), 0.01).velocity_mps[2] == pytest.approx(-0.01 * GRAVITY_MPS2)
