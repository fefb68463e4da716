"""`vehicle=quadrotor` is paper 4's vehicle, and its forces do the work that its energy says."""

from __future__ import annotations

import numpy as np
import pytest
import yaml
from scipy.integrate import cumulative_trapezoid

from uavexp.arrays import Float
from uavexp.geometry import GRAVITY_MPS2, rotation_from_quaternion
from uavexp.paths import conf_folder
from uavexp.vehicle.quadrotor import Plant, Quadrotor, integrate

PLANT = Quadrotor().plant
INERTIA = np.array([PLANT.inertia_x_kgm2, PLANT.inertia_y_kgm2, PLANT.inertia_z_kgm2])


def test_the_default_is_the_papers_table_of_parameters() -> None:
    """What the paper limits (5 m/s, 3.5 m/s²) are two overrides; the rotor's radius enters nothing."""
    table = {
        "mass_kg": 0.75,
        "inertia_x_kgm2": 0.015,
        "inertia_y_kgm2": 0.015,
        "inertia_z_kgm2": 0.024,
        "thrust_coefficient_Ns2": 3.3e-5,
        "torque_coefficient_Nms2": 5.5e-7,
        "rotor_span_m": 0.152,
        "frontal_area_m2": 4.3e-3,
    }
    stated = yaml.safe_load((conf_folder() / "vehicle" / "quadrotor.yaml").read_text())
    assert {name: float(stated[name]) for name in table} == table
    limits = Quadrotor(max_speed_mps=5.0, max_acceleration_mps2=3.5).limits
    assert (limits.max_speed_mps, limits.max_acceleration_mps2) == (5.0, 3.5)


def flight(plant: Plant, step_s: float) -> Float:
    """Two seconds of rolling, climbing and yawing under changing rotor commands: states (T, 17)."""
    x, work = np.zeros(17), np.empty((5, 17))
    x[3:6], x[6], x[10:13], x[13:] = (3.0, -2.0, 1.0), 1.0, (0.5, -0.4, 1.0), 236.0
    rows = [x.copy()]
    for k in range(round(2.0 / step_s)):
        wave = np.sin(5.0 * k * step_s + np.array([0.0, 0.3, 0.9, 1.4]))
        integrate(x, 245.0 + 15.0 * wave, plant, step_s, work)
        rows.append(x.copy())
    return np.array(rows)


def forces(x: Float) -> tuple[float, float]:
    """Thrust N and drag coefficient times speed, kg/s, written out."""
    return float(3.3e-5 * (x[13:] ** 2).sum()), PLANT.drag_kgpm * float(np.linalg.norm(x[3:6]))


def test_energy_changes_by_the_work_of_thrust_and_drag() -> None:
    step_s = 5e-4
    rows = flight(PLANT, step_s)
    energy = 0.5 * 0.75 * (rows[:, 3:6] ** 2).sum(axis=1) + 0.75 * GRAVITY_MPS2 * rows[:, 2]
    power = []
    for x in rows:
        thrust, drag = forces(x)
        power.append(thrust * rotation_from_quaternion(x[6:10])[:, 2] @ x[3:6] - drag * x[3:6] @ x[3:6])
    work = step_s * (np.sum(power) - 0.5 * (power[0] + power[-1]))
    assert abs(energy[-1] - energy[0]) > 1.0
    assert energy[-1] - energy[0] == pytest.approx(work, rel=1e-5)


def test_angular_momentum_changes_by_the_torque_of_the_rotors() -> None:
    step_s, plant = 5e-4, PLANT._replace(rotor_inertia_kgm2=1e-4)
    rows, lever = flight(plant, step_s), 0.076 / np.sqrt(2.0)
    sides_x, sides_y = np.array([1, 1, -1, -1]), np.array([-1, 1, 1, -1])
    spins = np.array([1, -1, 1, -1])
    torque, momentum = [], []
    for x in rows:
        rotation, square = rotation_from_quaternion(x[6:10]), x[13:] ** 2
        force = 3.3e-5 * square
        moment = np.array([lever * sides_y @ force, -lever * sides_x @ force, -5.5e-7 * spins @ square])
        rotor = np.array([0.0, 0.0, 1e-4 * spins @ x[13:]])
        # the model leaves out the reaction of accelerating rotors: their share moves with the body alone
        torque.append(rotation @ (moment - np.cross(x[10:13], rotor)))
        momentum.append(rotation @ (INERTIA * x[10:13]))
    impulse = cumulative_trapezoid(torque, dx=step_s, axis=0)
    change = np.array(momentum[1:]) - momentum[0]
    assert np.linalg.norm(change, axis=1).max() > 0.005
    np.testing.assert_allclose(change, impulse, atol=1e-5)
