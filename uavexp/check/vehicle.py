"""What every vehicle promises in free flight."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from uavexp.check.hall import hovering
from uavexp.check.promise import Make, keep, same, untouched
from uavexp.geometry import GRAVITY_MPS2
from uavexp.types import Command, State

_STEP_S = 0.01
_START = hovering((1.0, 2.0, 1.5), 0.7)


def _begun(make: Make, state: State = _START) -> Any:
    vehicle = make()
    vehicle.reset(state)
    return vehicle


def _command(thrust_N: float, quaternion_wxyz: Any) -> Command:
    return Command(thrust_N=thrust_N, quaternion_wxyz=quaternion_wxyz, body_rate_radps=np.zeros(3))


def _rolled(angle_rad: float, thrust_N: float) -> Command:
    return _command(thrust_N, np.array([np.cos(angle_rad / 2), np.sin(angle_rad / 2), 0.0, 0.0]))


def _weight_N(vehicle: Any) -> float:
    return float(vehicle.mass_kg * GRAVITY_MPS2)


def has_limits_and_a_body(make: Make) -> None:
    """Mass, speed, acceleration, body rate and size are positive numbers."""
    vehicle = make()
    limits = vehicle.limits
    values = {
        "mass_kg": vehicle.mass_kg,
        "max_speed_mps": limits.max_speed_mps,
        "max_acceleration_mps2": limits.max_acceleration_mps2,
        "max_body_rate_radps": limits.max_body_rate_radps,
        "body_size_m": min(limits.body_size_m),
    }
    for name, value in values.items():
        keep(0.0 < value < np.inf, f"{name} is {value}")


def hovers_under_its_weight(make: Make) -> None:
    """Five seconds of level thrust m g leave it where it is, to a millimetre."""
    vehicle = _begun(make)
    for _ in range(500):
        after = vehicle.step(_command(_weight_N(vehicle), _START.quaternion_wxyz), _STEP_S)
    moved_m = float(np.linalg.norm(after.position_m - _START.position_m))
    keep(moved_m < 1e-3, f"it moved by {moved_m:.3g} m in 5 s")
    turned = float(np.abs(after.quaternion_wxyz - _START.quaternion_wxyz).max())
    keep(turned < 1e-3, f"its quaternion changed by {turned:.3g} in 5 s")


def goes_where_its_thrust_points(make: Make) -> None:
    """A second of roll by 0.3 rad takes it to its right, not forward, and upright again it is finite."""
    vehicle = _begun(make, hovering((0.0, 0.0, 0.0)))
    for _ in range(100):
        after = vehicle.step(_rolled(0.3, _weight_N(vehicle) / np.cos(0.3)), _STEP_S)
    right_mps, forward_mps = -float(after.velocity_mps[1]), float(abs(after.velocity_mps[0]))
    keep(right_mps > 0.5, f"rolled by 0.3 rad for 1 s it flies to the right at {right_mps:.3f} m/s")
    keep(forward_mps < 0.1 * right_mps, f"rolled by 0.3 rad it flies forward at {forward_mps:.3f} m/s")


def does_the_same_under_the_same_commands(make: Make) -> None:
    """To the last bit, also after a reset."""

    def flown(vehicle: Any) -> list[State]:
        rng = np.random.default_rng(5)
        vehicle.reset(_START)
        return [
            vehicle.step(_rolled(rng.uniform(-0.5, 0.5), rng.uniform(5.0, 10.0)), _STEP_S) for _ in range(100)
        ]

    vehicle = make()
    keep(same(flown(vehicle), flown(make())), "another object flies otherwise")
    keep(same(flown(vehicle), flown(make())), "after a reset it flies otherwise")


def stays_in_attitude(make: Make) -> None:
    """The quaternion keeps its length, and all is finite."""
    vehicle, rng = _begun(make), np.random.default_rng(2)
    for step in range(200):
        state = vehicle.step(_rolled(rng.uniform(-1.0, 1.0), rng.uniform(0.0, 15.0)), _STEP_S)
        norm = float(np.linalg.norm(state.quaternion_wxyz))
        keep(abs(norm - 1.0) < 1e-6, f"a quaternion of length {norm:.6f} after {step + 1} steps")
        keep(np.isfinite(state.position_m).all(), f"a position {state.position_m} after {step + 1} steps")


def leaves_states_alone_that_it_has_returned(make: Make) -> None:
    """They are the trial's, as is the state that it begins in."""
    start = copy.deepcopy(_START)
    vehicle = _begun(make, start)
    first = vehicle.step(_rolled(0.2, 8.0), _STEP_S)
    with untouched(first=first, start=start):
        for _ in range(10):
            vehicle.step(_rolled(-0.2, 6.0), _STEP_S)


def goes_on_from_where_it_is_placed(make: Make) -> None:
    """After a contact the state is overwritten."""
    vehicle = _begun(make)
    vehicle.step(_rolled(0.3, 9.0), _STEP_S)
    put = State(
        position_m=np.array([-4.0, 0.0, 2.0]),
        velocity_mps=np.array([1.0, 0.0, 0.0]),
        quaternion_wxyz=hovering((0.0, 0.0, 0.0), 1.0).quaternion_wxyz,
        body_rate_radps=np.zeros(3),
    )
    vehicle.place(put)
    after = vehicle.step(_command(_weight_N(vehicle), put.quaternion_wxyz), _STEP_S)
    apart_m = float(np.linalg.norm(after.position_m - put.position_m - _STEP_S * put.velocity_mps))
    keep(apart_m < 1e-3, f"a step after it was placed it is {apart_m:.3g} m from where it should be")
