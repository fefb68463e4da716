"""The brake looks exactly one stopping distance ahead."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.unit.trigger.test_trigger import LIMITS, STRAIGHT, change, observe
from uavexp.braking import stopping_distance_m
from uavexp.check.fields import box, empty, field_from
from uavexp.field import DistanceField
from uavexp.safety.brake import Brake
from uavexp.safety.none import NoBrake
from uavexp.trajectory import evaluate
from uavexp.types import Limits, Observation, Reference


def flying(field: DistanceField, time_s: float) -> Observation:
    """At `time_s` on the straight trajectory, at 1 m/s along x."""
    position, velocity, _ = evaluate(STRAIGHT, np.array([time_s]))
    reference = Reference(
        position_m=position[0], velocity_mps=velocity[0], acceleration_mps2=np.zeros(3), yaw_rad=0.0
    )
    return replace(observe(field, change(field, field), time_s=time_s), reference=reference)


def walled(x_m: float, *, unknown: bool = False) -> DistanceField:
    grid = empty((7.0, 4.0, 2.0))
    box(grid, (x_m, 0.0, 0.0), (7.0, 4.0, 2.0))
    return field_from(np.zeros_like(grid), unknown=grid) if unknown else field_from(grid)


def first_brake_m(brake: Brake, field: DistanceField) -> float:
    """Position along x at which the brake first asks to stop."""
    must_brake = brake.begin(LIMITS).must_brake
    times = np.arange(1.0, 6.0, 0.01)
    asked = [t for t in times if must_brake(flying(field, t))]
    return 0.5 + (asked[0] - 1.0) if asked else float("inf")


def test_brakes_before_a_wall_with_room_to_stop_and_not_earlier() -> None:
    wall_m = 4.0
    brake = Brake(margin_m=0.05, reaction_s=0.2, stop_at_unknown=False)
    ahead_m = stopping_distance_m(1.0, LIMITS) + 0.2 + LIMITS.body_radius_m
    contact_m = wall_m - LIMITS.body_radius_m - 0.05
    assert first_brake_m(brake, walled(wall_m)) == pytest.approx(contact_m - ahead_m, abs=0.12)


def test_brakes_before_unknown_space_only_when_asked() -> None:
    field = walled(4.0, unknown=True)
    ahead_m = stopping_distance_m(1.0, LIMITS) + 0.2 + LIMITS.body_radius_m
    assert first_brake_m(Brake(stop_at_unknown=True), field) == pytest.approx(4.0 - ahead_m, abs=0.12)
    assert first_brake_m(Brake(stop_at_unknown=False), field) == float("inf")


def test_no_brake_never_brakes() -> None:
    assert not NoBrake().begin(LIMITS).must_brake(flying(walled(1.0), 2.0))


def test_a_vehicle_that_cannot_decelerate_is_refused() -> None:
    still = Limits(
        max_speed_mps=1.0, max_acceleration_mps2=0.0, max_body_rate_radps=1.0, body_size_m=(0.3, 0.3, 0.1)
    )
    with pytest.raises(ValueError, match="max_acceleration_mps2"):
        Brake().begin(still)
