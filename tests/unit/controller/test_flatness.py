"""Flatness against closed forms, differences and the simulator, and what it is worth in flight."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from uavexp.arrays import Float
from uavexp.controller.base import Controller
from uavexp.controller.flatness import Flatness
from uavexp.controller.position_velocity import PositionVelocity
from uavexp.geometry import GRAVITY_MPS2
from uavexp.trajectory import Trajectory, evaluate
from uavexp.trajectory import derivative as trajectory_derivative
from uavexp.types import Reference, State
from uavexp.vehicle.quadrotor import Quadrotor, derivative, integrate
from uavexp.vehicle.quadrotor_flatness import (
    FlatOutputs,
    Motion,
    attitude_and_rate,
    demand,
    motion,
    rotor_speeds,
)

PLANT = Quadrotor().plant
DRAGGED = Quadrotor(drag_coefficient=40.0, rotor_inertia_kgm2=1e-4).plant  # so that every term counts
RNG = np.random.default_rng(4)
SIZE_M, PACE, PHASE = 0.6 * RNG.normal(size=(3, 3)), RNG.uniform(0.5, 2.0, 3), RNG.uniform(0.0, 6.0, 3)


def position(times: Float, order: int) -> Float:
    """A sum of three harmonics and any derivative of it (N, 3)."""
    angle = np.outer(times, PACE) + PHASE + 0.5 * order * np.pi
    return np.asarray((PACE**order * np.sin(angle)) @ SIZE_M)


def outputs(times: Float) -> FlatOutputs:
    return FlatOutputs(
        *(position(times, k) for k in range(1, 5)), np.sin(times), np.cos(times), -np.sin(times)
    )


def moved(times: Float) -> Motion:
    return motion(outputs(times), DRAGGED.mass_kg, DRAGGED.drag_kgpm)


def test_hover_is_level_still_and_at_hover_speed() -> None:
    zero = np.zeros((1, 3))
    hover = motion(FlatOutputs(zero, zero, zero, zero, np.array([0.7]), np.zeros(1), np.zeros(1)), 0.75)
    turn = [math.cos(0.7), -math.sin(0.7), math.sin(0.7), math.cos(0.7)]
    np.testing.assert_allclose(hover.rotation[0, :2, :2].ravel(), turn, atol=1e-15)
    np.testing.assert_allclose(hover.quaternion_wxyz[0], [math.cos(0.35), 0, 0, math.sin(0.35)], atol=1e-15)
    assert hover.thrust_N[0] == pytest.approx(0.75 * GRAVITY_MPS2)
    assert not hover.body_rate_radps.any()
    np.testing.assert_allclose(rotor_speeds(hover, PLANT), 236.09, atol=0.01)


def test_circle_in_closed_form() -> None:
    """At constant yaw the tilt goes round with the circle; looking ahead, it stands still in the body."""
    radius, pace = 2.0, 1.3
    times = np.linspace(0.0, 4.0, 9)

    def go_round(order: int) -> Float:
        angle = pace * times + 0.5 * order * np.pi
        return radius * pace**order * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)

    turning = np.full(9, pace)
    ahead = FlatOutputs(
        *(go_round(k) for k in range(1, 5)), pace * times + 0.5 * np.pi, turning, 0.0 * turning
    )
    flown = motion(ahead, 0.75)
    tilt = math.atan2(radius * pace**2, GRAVITY_MPS2)
    rate = np.array([0.0, -pace * math.sin(tilt), pace * math.cos(tilt)])  # about the vertical, leaning left
    np.testing.assert_allclose(flown.body_rate_radps, np.tile(rate, (9, 1)), atol=1e-12)
    np.testing.assert_allclose(flown.body_acceleration_radps2, 0.0, atol=1e-12)
    np.testing.assert_allclose(flown.thrust_N, 0.75 * math.hypot(GRAVITY_MPS2, radius * pace**2))


def test_rates_are_the_derivatives_of_the_attitude() -> None:
    times, h = np.linspace(0.0, 5.0, 40), 1e-5
    now, later, before = moved(times), moved(times + h), moved(times - h)
    spin = np.einsum("nji,njk->nik", now.rotation, (later.rotation - before.rotation) / (2.0 * h))
    differenced = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
    np.testing.assert_allclose(now.body_rate_radps, differenced, atol=1e-8)
    differenced = (later.body_rate_radps - before.body_rate_radps) / (2.0 * h)
    np.testing.assert_allclose(now.body_acceleration_radps2, differenced, atol=1e-8)
    np.testing.assert_allclose(np.linalg.det(now.rotation), 1.0, atol=1e-12)


def test_one_instant_equals_many() -> None:
    times = np.linspace(0.0, 5.0, 20)
    many, given = motion(outputs(times), 0.75), outputs(times)
    up = np.array([0.0, 0.0, GRAVITY_MPS2])
    for n in range(20):
        rotation, rate = attitude_and_rate(
            given.acceleration_mps2[n] + up,
            given.jerk_mps3[n],
            given.yaw_rad[n],
            given.yaw_rate_radps[n],
        )
        np.testing.assert_allclose(rotation, many.rotation[n], atol=1e-12)
        np.testing.assert_allclose(rate, many.body_rate_radps[n], atol=1e-12)


def simulator_state(times: Float, wanted: Motion, speeds: Float, n: int) -> Float:
    at = times[n : n + 1]
    parts = (position(at, 0)[0], position(at, 1)[0], wanted.quaternion_wxyz[n])
    return np.concatenate([*parts, wanted.body_rate_radps[n], speeds[n]])


def test_the_simulator_accelerates_as_the_outputs_say() -> None:
    """Round trip: outputs -> attitude, rates, rotor speeds -> equations of motion -> outputs."""
    times = np.linspace(0.0, 5.0, 40)
    wanted = moved(times)
    speeds, out = rotor_speeds(wanted, DRAGGED), np.empty(17)
    assert np.isfinite(speeds).all()
    for n in range(40):
        derivative(simulator_state(times, wanted, speeds, n), speeds[n], DRAGGED, out)
        np.testing.assert_allclose(out[3:6], position(times[n : n + 1], 2)[0], atol=1e-9)
        np.testing.assert_allclose(out[10:13], wanted.body_acceleration_radps2[n], atol=5e-5)


def test_open_loop_the_simulator_flies_the_outputs() -> None:
    """Rotor speeds alone, without feedback or lag, keep to the curve for a second."""
    plant, step_s = DRAGGED._replace(rotor_lag_s=1e-4), 1e-4
    times = np.arange(0.0, 1.0, step_s)
    speeds = rotor_speeds(moved(times + 0.5 * step_s), DRAGGED)
    x, work = simulator_state(times, moved(times[:1]), speeds, 0), np.empty((5, 17))
    for n in range(len(times)):
        x[13:] = speeds[n]
        integrate(x, speeds[n], plant, step_s, work)
    np.testing.assert_allclose(x[:3], position(np.array([1.0]), 0)[0], atol=1e-6)


def test_demand_of_a_trajectory_says_whether_it_can_be_flown() -> None:
    def there_and_back(duration_s: float) -> Trajectory:
        """Ten metres by the quintic from rest to rest."""
        powers = np.array([0.0, 0.0, 0.0, 10.0, -15.0, 6.0]) * 10.0 / duration_s ** np.arange(6)
        coefficients = powers[None, :, None] * np.array([1.0, 0.0, 0.0])
        return Trajectory(breaks_s=np.array([3.0, 3.0 + duration_s]), coefficients=coefficients, at_rest=True)

    calm = demand(there_and_back(8.0), 0.4, PLANT, 2.0)
    assert calm.feasible
    assert calm.time_s[0] == 3.0
    steepest = math.hypot(GRAVITY_MPS2, 10.0 / math.sqrt(3.0) * 10.0 / 64.0)
    assert calm.thrust_N.max() == pytest.approx(0.75 * steepest, rel=1e-3)
    assert 230.0 < calm.rotor_speed_radps.min() < 236.1 < calm.rotor_speed_radps.max() < 250.0
    hurried = demand(there_and_back(1.2), 0.4, PLANT, 2.0)
    assert not hurried.feasible
    assert np.abs(hurried.body_rate_radps).max() > 2.0
    assert not demand(there_and_back(8.0), 0.4, PLANT._replace(max_rotor_speed_radps=236.5), 2.0).feasible


def test_derivatives_of_a_trajectory_agree_with_its_evaluation() -> None:
    rng = np.random.default_rng(0)
    flown = Trajectory(
        breaks_s=np.array([1.0, 1.7, 3.0]), coefficients=rng.normal(size=(2, 6, 3)), at_rest=False
    )
    times = np.array([0.5, 1.0, 1.2, 1.7, 2.9, 3.0, 3.5])
    for order, value in enumerate(evaluate(flown, times)):
        np.testing.assert_allclose(trajectory_derivative(flown, times, order), value, atol=1e-12)
    h, inside = 1e-5, np.array([1.2, 1.5, 2.0, 2.9])
    for order in (3, 4, 5):
        low, high = (trajectory_derivative(flown, inside + side * h, order - 1) for side in (-1, 1))
        np.testing.assert_allclose(
            trajectory_derivative(flown, inside, order), (high - low) / (2 * h), atol=1e-4
        )


def tracking_error_m(controller: Controller, asked: Callable[[float], Reference], seconds: float) -> float:
    """RMS distance from the reference of the quadrotor that starts on it."""
    vehicle = Quadrotor(max_speed_mps=6.0, max_acceleration_mps2=3.5)
    controller.reset(vehicle.limits, vehicle.mass_kg)
    first = asked(0.0)
    one = (first.velocity_mps, first.acceleration_mps2, first.jerk_mps3, np.zeros(3))
    start = motion(FlatOutputs(*(part[None] for part in one), *np.zeros((3, 1))), vehicle.mass_kg)
    state = State(
        position_m=first.position_m,
        velocity_mps=first.velocity_mps,
        quaternion_wxyz=start.quaternion_wxyz[0],
        body_rate_radps=start.body_rate_radps[0],
    )
    vehicle.reset(state)
    square = 0.0
    for k in range(round(seconds * 100)):
        reference = asked(0.01 * k)
        square += float(((state.position_m - reference.position_m) ** 2).sum())
        state = vehicle.step(controller.command(state, reference), 0.01)
    return math.sqrt(square / round(seconds * 100))


@pytest.mark.parametrize(
    ("size_m", "pace", "most_m"),
    [((2.0, 1.0, 0.3), 0.9, 0.006), ((7.1, 0.0, 0.0), 0.7, 0.002)],
    ids=["eight", "shuttle"],
)
def test_feed_forward_of_the_body_rate_takes_most_of_the_tracking_error(
    size_m: tuple[float, float, float], pace: float, most_m: float
) -> None:
    """A lemniscate and a shuttle of up to 3.5 m/s²; at least five times better than without."""
    paces = pace * np.array([1.0, 2.0, 1.0])

    def asked(time_s: float) -> Reference:
        p, v, a, j = (size_m * paces**k * np.sin(paces * time_s + 0.5 * k * np.pi) for k in range(4))
        return Reference(position_m=p, velocity_mps=v, acceleration_mps2=a, jerk_mps3=j, yaw_rad=0.0)

    without = tracking_error_m(PositionVelocity(), asked, 10.0)
    fed = tracking_error_m(Flatness(), asked, 10.0)
    assert fed < most_m
    assert fed < 0.2 * without
