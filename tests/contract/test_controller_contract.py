"""What every controller option keeps."""

from __future__ import annotations

import numpy as np
import pytest

from tests.components import build, numbers, options
from uavexp.errors import ConfigError
from uavexp.geometry import GRAVITY_MPS2, rotation_from_quaternion, yaw_of
from uavexp.types import Limits, Reference, State

pytestmark = pytest.mark.parametrize("option", options("controller"))
LIMITS = Limits(
    max_speed_mps=2.5, max_acceleration_mps2=2.5, max_body_rate_radps=2.0, body_size_m=(0.32, 0.32, 0.12)
)
REST = State(
    position_m=np.zeros(3),
    velocity_mps=np.zeros(3),
    quaternion_wxyz=np.array([1.0, 0.0, 0.0, 0.0]),
    body_rate_radps=np.zeros(3),
)


def asked(
    option, *, mass_kg=0.75, acceleration=(0.0, 0.0, 0.0), position=(0.0, 0.0, 0.0), yaw=0.0, state=REST
):
    controller = build("controller", option)
    controller.reset(LIMITS, mass_kg)
    reference = Reference(
        position_m=np.array(position),
        velocity_mps=np.zeros(3),
        acceleration_mps2=np.array(acceleration),
        yaw_rad=yaw,
    )
    return controller.command(state, reference)


def test_on_the_reference_it_lifts_the_weight(option):
    command = asked(option, mass_kg=1.3)
    assert command.thrust_N == pytest.approx(1.3 * GRAVITY_MPS2)
    np.testing.assert_allclose(command.quaternion_wxyz, REST.quaternion_wxyz, atol=1e-12)


def test_thrust_direction_is_the_wanted_acceleration(option):
    acceleration = np.array([1.0, -2.0, 0.5])
    command = asked(option, acceleration=acceleration, yaw=2.0)
    body_z = rotation_from_quaternion(command.quaternion_wxyz)[:, 2]
    force = acceleration + np.array([0.0, 0.0, GRAVITY_MPS2])
    np.testing.assert_allclose(body_z, force / np.linalg.norm(force), atol=1e-12)


def test_heading_is_the_references(option):
    for yaw in (-3.0, -1.0, 0.0, 2.0):
        command = asked(option, acceleration=(0.0, 0.0, 1.0), yaw=yaw)
        assert yaw_of(command.quaternion_wxyz) == pytest.approx(yaw, abs=1e-12)


def test_pulls_towards_the_reference(option):
    command = asked(option, position=(1.0, 0.0, 0.0))
    assert rotation_from_quaternion(command.quaternion_wxyz)[0, 2] > 0.1


def test_however_far_it_asks_for_finite_upright_thrust(option):
    for position in ((1e6, 0.0, 0.0), (0.0, 0.0, -1e6), (0.0, 0.0, 1e6)):
        command = asked(option, position=position)
        assert np.isfinite(command.thrust_N)
        assert command.thrust_N >= 0.0
        assert rotation_from_quaternion(command.quaternion_wxyz)[2, 2] > 0.5
        assert np.linalg.norm(command.quaternion_wxyz) == pytest.approx(1.0)


@pytest.mark.parametrize("value", [-1.0, float("nan"), float("inf")])
def test_refuses_bad_numbers(option, value):
    for name in numbers(build("controller", option)):
        with pytest.raises(ConfigError, match=r"must .*got"):
            build("controller", option, **{name: value})
