"""What every vehicle option keeps."""

from __future__ import annotations

import copy

import numpy as np
import pytest

from tests.components import build, numbers, options
from uavexp.errors import ConfigError
from uavexp.geometry import GRAVITY_MPS2, quaternion_from_yaw
from uavexp.types import Command, Limits, State

VEHICLES = options("vehicle")
pytestmark = pytest.mark.parametrize("option", VEHICLES)


def at_rest(yaw_rad: float = 0.0) -> State:
    return State(
        position_m=np.array([1.0, 2.0, 1.5]),
        velocity_mps=np.zeros(3),
        quaternion_wxyz=quaternion_from_yaw(yaw_rad),
        body_rate_radps=np.zeros(3),
    )


def rolled(angle_rad: float, thrust_N: float) -> Command:
    q = np.array([np.cos(angle_rad / 2), np.sin(angle_rad / 2), 0.0, 0.0])
    return Command(thrust_N=thrust_N, quaternion_wxyz=q, body_rate_radps=np.zeros(3))


def test_limits_are_paper_1s(option):
    limits = build("vehicle", option).limits
    assert limits == Limits(
        max_speed_mps=2.5, max_acceleration_mps2=2.5, max_body_rate_radps=2.0, body_size_m=(0.32, 0.32, 0.12)
    )


def test_hovers_under_its_weight(option):
    vehicle, state = build("vehicle", option), at_rest(0.7)
    vehicle.reset(state)
    hover = Command(
        thrust_N=vehicle.mass_kg * GRAVITY_MPS2,
        quaternion_wxyz=state.quaternion_wxyz,
        body_rate_radps=np.zeros(3),
    )
    for _ in range(500):
        after = vehicle.step(hover, 0.01)
    np.testing.assert_allclose(after.position_m, state.position_m, atol=1e-9)
    np.testing.assert_allclose(after.quaternion_wxyz, state.quaternion_wxyz, atol=1e-12)


def test_goes_where_its_thrust_points(option):
    vehicle = build("vehicle", option)
    vehicle.reset(at_rest())
    for _ in range(100):
        after = vehicle.step(rolled(0.3, vehicle.mass_kg * GRAVITY_MPS2 / np.cos(0.3)), 0.01)
    # body z of a roll by +0.3 about x is (0, -sin, cos)
    assert after.velocity_mps[1] == pytest.approx(-GRAVITY_MPS2 * np.tan(0.3), rel=0.25)
    assert abs(after.velocity_mps[0]) < 1e-9
    assert after.body_rate_radps[0] == pytest.approx(0.0, abs=0.02)


def test_same_commands_same_bytes(option):
    def flown() -> bytes:
        vehicle, rng = build("vehicle", option), np.random.default_rng(5)
        vehicle.reset(at_rest())
        for _ in range(100):
            state = vehicle.step(rolled(rng.uniform(-0.5, 0.5), rng.uniform(5.0, 10.0)), 0.01)
        return state.position_m.tobytes() + state.quaternion_wxyz.tobytes() + state.velocity_mps.tobytes()

    assert flown() == flown()


def test_states_already_returned_do_not_change(option):
    vehicle, start = build("vehicle", option), at_rest()
    vehicle.reset(start)
    first = vehicle.step(rolled(0.2, 8.0), 0.01)
    kept, begun = copy.deepcopy(first), at_rest()
    for _ in range(10):
        vehicle.step(rolled(-0.2, 6.0), 0.01)
    np.testing.assert_array_equal(first.position_m, kept.position_m)
    np.testing.assert_array_equal(first.quaternion_wxyz, kept.quaternion_wxyz)
    np.testing.assert_array_equal(start.position_m, begun.position_m)


def test_place_overwrites_the_state(option):
    vehicle = build("vehicle", option)
    vehicle.reset(at_rest())
    vehicle.step(rolled(0.3, 9.0), 0.01)
    put = State(
        position_m=np.array([-4.0, 0.0, 2.0]),
        velocity_mps=np.array([1.0, 0.0, 0.0]),
        quaternion_wxyz=quaternion_from_yaw(1.0),
        body_rate_radps=np.zeros(3),
    )
    vehicle.place(put)
    hover = Command(thrust_N=7.3575, quaternion_wxyz=put.quaternion_wxyz, body_rate_radps=np.zeros(3))
    after = vehicle.step(hover, 0.01)
    np.testing.assert_allclose(after.position_m, put.position_m + 0.01 * put.velocity_mps, atol=1e-3)


@pytest.mark.parametrize("value", [-1.0, float("nan"), float("inf")])
def test_refuses_bad_numbers(option, value):
    for name in numbers(build("vehicle", option)):
        with pytest.raises(ConfigError, match=r"(?s)must .*got"):
            build("vehicle", option, **{name: value})
