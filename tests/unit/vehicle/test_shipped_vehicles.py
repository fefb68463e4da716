"""Both vehicles are paper 1's."""

from __future__ import annotations

import numpy as np
import pytest

from tests.components import build
from uavexp.check.hall import LIMITS, hovering
from uavexp.geometry import GRAVITY_MPS2
from uavexp.types import Command

VEHICLES = pytest.mark.parametrize("vehicle", ["point_mass", "quadrotor"])


@VEHICLES
def test_limits_are_paper_1s(vehicle: str) -> None:
    assert build("vehicle", vehicle).limits == LIMITS


@VEHICLES
def test_a_steady_roll_accelerates_by_g_tan(vehicle: str) -> None:
    made, roll = build("vehicle", vehicle), 0.3
    made.reset(hovering((0.0, 0.0, 0.0)))
    command = Command(
        thrust_N=made.mass_kg * GRAVITY_MPS2 / np.cos(roll),
        quaternion_wxyz=np.array([np.cos(roll / 2), np.sin(roll / 2), 0.0, 0.0]),
        body_rate_radps=np.zeros(3),
    )
    for _ in range(100):
        after = made.step(command, 0.01)
    # body z of a roll by +0.3 about x is (0, -sin, cos)
    assert after.velocity_mps[1] == pytest.approx(-GRAVITY_MPS2 * np.tan(roll), rel=0.25)
    assert abs(after.velocity_mps[0]) < 1e-9
    assert after.body_rate_radps[0] == pytest.approx(0.0, abs=0.02)
