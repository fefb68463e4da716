"""What every controller promises, asked at one instant after a reset."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from uavexp.check.hall import LIMITS, hovering
from uavexp.check.promise import Make, keep, same, untouched
from uavexp.geometry import GRAVITY_MPS2, rotation_from_quaternion, wrap_angle, yaw_of
from uavexp.types import Command, Reference, State
from uavexp.vehicle.quadrotor import Quadrotor

_STATE = hovering((0.0, 0.0, 0.0))
_REFERENCE = Reference(
    position_m=np.zeros(3), velocity_mps=np.zeros(3), acceleration_mps2=np.zeros(3), yaw_rad=0.0
)
_MASS_KG = 1.3
_ANGLE_RAD = 1e-3
_FAR_M = 1e6
_STEP_S, _STEPS = 0.01, 400
_LEADS_M = (0.0, 0.3, 5.0)  # of a reference before the vehicle, when both set off
_PACE = 0.96  # of the speed limit: of the reference
_SPARE = 1.001  # of the speed limit


def _command(make: Make, state: State = _STATE, **wanted: Any) -> Command:
    controller = make()
    controller.reset(LIMITS, _MASS_KG)
    command: Command = controller.command(state, replace(_REFERENCE, **wanted))
    return command


def _body_z(command: Command) -> Any:
    return rotation_from_quaternion(command.quaternion_wxyz)[:, 2]


def lifts_its_weight_on_the_reference(make: Make) -> None:
    """At rest where it should be, the thrust is m g and the attitude stays."""
    thrust_N, weight_N = _command(make).thrust_N, _MASS_KG * GRAVITY_MPS2
    keep(abs(thrust_N - weight_N) < 1e-3 * weight_N, f"thrust {thrust_N:.3f} N under {weight_N:.3f} N")


def pushes_along_the_acceleration_wanted(make: Make) -> None:
    """On the reference, tilted as it asks for, the thrust points along a + g, whatever the heading."""
    force = np.array([1.0, -2.0, 0.5 + GRAVITY_MPS2])
    wanted_z = force / np.linalg.norm(force)
    tilt = np.array([1.0 + wanted_z[2], -wanted_z[1], wanted_z[0], 0.0])  # the shortest turn from upright
    tilted = replace(_STATE, quaternion_wxyz=tilt / np.linalg.norm(tilt))
    body_z = _body_z(_command(make, tilted, acceleration_mps2=np.array([1.0, -2.0, 0.5]), yaw_rad=2.0))
    apart_rad = float(np.arccos(np.clip(body_z @ wanted_z, -1.0, 1.0)))
    keep(apart_rad < _ANGLE_RAD, f"the thrust points {apart_rad:.3g} rad aside")


def turns_to_the_heading_wanted(make: Make) -> None:
    """All around."""
    for yaw_rad in (-3.0, -1.0, 0.0, 2.0):
        command = _command(make, acceleration_mps2=np.array([0.0, 0.0, 1.0]), yaw_rad=yaw_rad)
        apart_rad = abs(wrap_angle(yaw_of(command.quaternion_wxyz) - yaw_rad))
        keep(apart_rad < _ANGLE_RAD, f"the heading is {apart_rad:.3g} rad from {yaw_rad:g} rad")


def pulls_towards_the_reference(make: Make) -> None:
    """A reference ahead tilts the thrust forward, one above asks for more of it."""
    ahead = float(_body_z(_command(make, position_m=np.array([1.0, 0.0, 0.0])))[0])
    keep(ahead > 0.01, f"a reference 1 m ahead gives the thrust the direction x = {ahead:.3g}")
    above_N = _command(make, position_m=np.array([0.0, 0.0, 0.5])).thrust_N
    keep(
        above_N > _MASS_KG * GRAVITY_MPS2,
        f"a reference 0.5 m above gives {above_N:.3f} N",
    )


def stays_upright_however_far_it_is(make: Make) -> None:
    """Finite thrust >= 0, a unit quaternion and no more than 60 degrees of tilt."""
    for position in ((_FAR_M, 0.0, 0.0), (0.0, 0.0, -_FAR_M), (0.0, 0.0, _FAR_M)):
        command = _command(make, position_m=np.array(position))
        at = f"with the reference at {position}"
        keep(np.isfinite(command.thrust_N) and command.thrust_N >= 0.0, f"thrust {command.thrust_N} N {at}")
        norm = float(np.linalg.norm(command.quaternion_wxyz))
        keep(abs(norm - 1.0) < 1e-6, f"a quaternion of length {norm:.6f} {at}")
        keep(_body_z(command)[2] > 0.5, f"body z points {_body_z(command)[2]:.3f} upwards {at}")


def keeps_the_vehicle_below_its_speed_limit(make: Make) -> None:
    """However far behind: the shipped quadrotor after a reference that is gone at once at a planned speed."""
    for way in ((1.0, 0.0, 0.0), (0.6, -0.6, 0.5), (0.0, 0.0, -1.0)):
        for lead_m in _LEADS_M:
            fastest_mps, most_mps = _fastest_mps(make(), np.array(way) / np.linalg.norm(way), lead_m)
            keep(
                fastest_mps <= _SPARE * most_mps,
                f"{lead_m:g} m behind its reference along {way} it flies {fastest_mps:.3f} m/s,"
                f" the limit is {most_mps:g} m/s",
            )


def _fastest_mps(controller: Any, along: Any, lead_m: float) -> tuple[float, float]:
    """Highest speed flown in pursuit of a reference along a direction (3,), and the limit."""
    vehicle, state, fastest_mps = Quadrotor(), _STATE, 0.0
    vehicle.reset(state)
    controller.reset(vehicle.limits, vehicle.mass_kg)
    velocity_mps = _PACE * vehicle.limits.max_speed_mps * along
    every = max(round(1.0 / (controller.rate_hz * _STEP_S)), 1)
    for step in range(_STEPS):
        position_m = lead_m * along + step * _STEP_S * velocity_mps
        if step % every == 0:
            wanted = replace(_REFERENCE, position_m=position_m, velocity_mps=velocity_mps)
            command = controller.command(state, wanted)
        state = vehicle.step(command, _STEP_S)
        fastest_mps = max(fastest_mps, float(np.linalg.norm(state.velocity_mps)))
    return fastest_mps, vehicle.limits.max_speed_mps


def forgets_the_last_trial_at_a_reset(make: Make) -> None:
    """Same state, same reference, same bits."""
    controller, answers = make(), []
    for _ in range(2):
        controller.reset(LIMITS, _MASS_KG)
        wanted = [replace(_REFERENCE, position_m=np.array([0.1 * n, 0.0, 0.2])) for n in range(20)]
        answers.append([controller.command(_STATE, reference) for reference in wanted])
    keep(same(*answers), "the second trial of the same object is not the first")


def writes_into_nothing_it_is_given(make: Make) -> None:
    """State and reference are the trial's own."""
    controller = make()
    controller.reset(LIMITS, _MASS_KG)
    with untouched(state=_STATE, reference=_REFERENCE):
        controller.command(_STATE, _REFERENCE)
