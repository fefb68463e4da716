"""The quadrotor against closed forms, conservation laws and MuJoCo."""

from __future__ import annotations

import math

import numpy as np
import pytest

from uavexp.errors import ConfigError
from uavexp.geometry import GRAVITY_MPS2, quaternion_from_yaw, rotation_from_quaternion, yaw_of
from uavexp.types import Command, State
from uavexp.vehicle.quadrotor import AttitudeLoop, Quadrotor, derivative, integrate, mix, wanted_body_rate

PLANT = Quadrotor().plant
STEP_S = 0.005  # 10 ms in the default two sub-steps
NO_FORCE = PLANT._replace(drag_kgpm=0.0, thrust_coefficient=0.0, torque_coefficient=0.0)


def vector(
    *, velocity=(0.0, 0.0, 0.0), quaternion=(1.0, 0.0, 0.0, 0.0), rate=(0.0, 0.0, 0.0), rotors=(0.0,) * 4
):
    return np.array([0.0, 0.0, 0.0, *velocity, *quaternion, *rate, *rotors], dtype=np.float64)


def run(x, plant, seconds, step_s=STEP_S, rotors=None):
    """All states (T, 17) under constant rotor commands."""
    work, rows = np.empty((5, 17)), [x.copy()]
    for _ in range(round(seconds / step_s)):
        integrate(x, x[13:].copy() if rotors is None else rotors, plant, step_s, work)
        rows.append(x.copy())
    return np.array(rows)


def wrench(rotor_speeds, plant=PLANT):
    """Thrust N and moment (3,) N m of rotor speeds, read off the equations of motion at rest."""
    out, still = np.empty(17), plant._replace(rotor_inertia_kgm2=0.0)
    derivative(vector(rotors=rotor_speeds), np.zeros(4), still, out)
    inertia = np.array([plant.inertia_x_kgm2, plant.inertia_y_kgm2, plant.inertia_z_kgm2])
    return plant.mass_kg * (out[5] + GRAVITY_MPS2), inertia * out[10:13]


def mixed(thrust, moment, plant=PLANT):
    speeds = np.empty(4)
    mix(thrust, np.array(moment), plant, speeds)
    return speeds


def rest(position=(0.0, 0.0, 1.5)):
    return State(
        position_m=np.array(position),
        velocity_mps=np.zeros(3),
        quaternion_wxyz=np.array([1.0, 0.0, 0.0, 0.0]),
        body_rate_radps=np.zeros(3),
    )


def test_hover_speed_is_236_radps():
    vehicle = Quadrotor()
    vehicle.reset(rest())
    np.testing.assert_allclose(vehicle.rotor_speed_radps, 236.09, atol=0.01)


def test_falls_as_tanh_to_terminal_speed():
    terminal = math.sqrt(PLANT.mass_kg * GRAVITY_MPS2 / PLANT.drag_kgpm)
    assert terminal == pytest.approx(52.86, abs=0.01)  # sqrt(2 m g / (rho C_d A))
    flight = run(vector(), PLANT, 10.0)
    time_s = STEP_S * np.arange(flight.shape[0])
    np.testing.assert_allclose(-flight[:, 5], terminal * np.tanh(GRAVITY_MPS2 * time_s / terminal), atol=1e-7)
    fallen = terminal**2 / GRAVITY_MPS2 * np.log(np.cosh(GRAVITY_MPS2 * time_s / terminal))
    np.testing.assert_allclose(-flight[:, 2], fallen, atol=1e-6)


def test_free_fall_keeps_energy_and_tumbling_keeps_angular_momentum():
    plant = NO_FORCE._replace(inertia_y_kgm2=0.018)  # three different axes: a real tumble
    flight = run(vector(velocity=(1.0, -2.0, 3.0), rate=(6.0, 0.1, 4.0)), plant, 10.0)
    inertia = np.array([plant.inertia_x_kgm2, plant.inertia_y_kgm2, plant.inertia_z_kgm2])
    speed2, rate = np.sum(flight[:, 3:6] ** 2, axis=1), flight[:, 10:13]
    energy = 0.5 * plant.mass_kg * speed2 + plant.mass_kg * GRAVITY_MPS2 * flight[:, 2]
    spin_energy = 0.5 * (rate**2 @ inertia)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-10)
    np.testing.assert_allclose(spin_energy, spin_energy[0], rtol=1e-6)
    momentum = np.array([rotation_from_quaternion(x[6:10]) @ (inertia * x[10:13]) for x in flight])
    np.testing.assert_allclose(momentum, np.tile(momentum[0], (len(flight), 1)), atol=1e-6)
    assert np.ptp(rate, axis=0).max() > 1.0
    np.testing.assert_allclose(np.linalg.norm(flight[:, 6:10], axis=1), 1.0, atol=1e-14)


def test_spinning_rotors_are_gyroscopes():
    """Body and rotor angular momentum together are conserved; without the rotors' share they are not."""
    plant = NO_FORCE._replace(rotor_inertia_kgm2=1e-3)
    rotors = (300.0, 0.0, 300.0, 0.0)  # both of one sense
    flight = run(vector(rate=(1.0, 2.0, 0.5), rotors=rotors), plant, 5.0)
    inertia = np.array([plant.inertia_x_kgm2, plant.inertia_y_kgm2, plant.inertia_z_kgm2])
    spin = np.array([0.0, 0.0, 1e-3 * 600.0])
    momentum = np.array([rotation_from_quaternion(x[6:10]) @ (inertia * x[10:13] + spin) for x in flight])
    np.testing.assert_allclose(momentum, np.tile(momentum[0], (len(flight), 1)), atol=1e-4)
    body = np.array([rotation_from_quaternion(x[6:10]) @ (inertia * x[10:13]) for x in flight])
    assert np.ptp(body, axis=0).max() > 0.05


def test_rotor_speed_follows_its_command_exponentially():
    flight = run(vector(), PLANT, 0.1, rotors=np.full(4, 300.0))
    time_s = STEP_S * np.arange(flight.shape[0])
    wanted = 300.0 * (1.0 - np.exp(-time_s / PLANT.rotor_lag_s))
    np.testing.assert_allclose(flight[:, 13], wanted, atol=0.01)


def test_integration_is_of_fourth_order():
    def end(step_s):
        return run(vector(rate=(3.0, 2.0, 1.0)), PLANT, 0.4, step_s, rotors=np.array([250.0, 240, 230, 260]))[
            -1
        ]

    exact = end(0.0005)
    coarse, fine = (np.linalg.norm((end(h) - exact)[:13]) for h in (0.01, 0.005))
    assert 12.0 < coarse / fine < 22.0


def test_mixer_gives_the_wanted_wrench():
    thrust, moment = wrench(mixed(8.0, [0.05, -0.08, 0.01]))
    assert thrust == pytest.approx(8.0)
    np.testing.assert_allclose(moment, [0.05, -0.08, 0.01], atol=1e-12)


def test_mixer_gives_up_yaw_first_then_thrust():
    thrust, moment = wrench(mixed(8.0, [0.15, 0.1, 5.0]))
    assert thrust == pytest.approx(8.0)
    np.testing.assert_allclose(moment[:2], [0.15, 0.1], atol=1e-12)
    assert 0.0 < moment[2] < 1.0
    thrust, moment = wrench(mixed(1e3, [0.15, 0.1, 0.0]))
    np.testing.assert_allclose(moment, [0.15, 0.1, 0.0], atol=1e-12)
    assert thrust < 4 * PLANT.thrust_coefficient * PLANT.max_rotor_speed_radps**2


def test_mixer_never_raises_the_thrust_for_a_moment():
    """At hover a rotor gives at most what it carries: so much moment, and no climb."""
    hover = PLANT.mass_kg * GRAVITY_MPS2
    thrust, moment = wrench(mixed(hover, [1.0, 0.0, 0.0]))
    assert thrust == pytest.approx(hover)
    least = PLANT.thrust_coefficient * PLANT.min_rotor_speed_radps**2
    np.testing.assert_allclose(moment, [4 * PLANT.lever_m * (hover / 4 - least), 0.0, 0.0], atol=1e-12)


def test_yaw_moment_is_the_reaction_of_the_rotors():
    """Rotors 1 and 3 turn about +z: more of them turns the body about -z."""
    _, moment = wrench((300.0, 200.0, 300.0, 200.0))
    assert moment[2] == pytest.approx(-2.0 * PLANT.torque_coefficient * (300.0**2 - 200.0**2))
    _, moment = wrench((0.0, 300.0, 300.0, 0.0))  # the left pair
    assert moment[0] == pytest.approx(2.0 * PLANT.thrust_coefficient * 300.0**2 * 0.076 / math.sqrt(2.0))


def test_yaw_slews_to_the_command_and_stays_within_the_rate_limit():
    vehicle = Quadrotor()
    vehicle.reset(rest())
    turned = Command(
        thrust_N=0.75 * GRAVITY_MPS2, quaternion_wxyz=quaternion_from_yaw(3.0), body_rate_radps=np.zeros(3)
    )
    states = [vehicle.step(turned, 0.01) for _ in range(500)]
    yaw, rate = [yaw_of(s.quaternion_wxyz) for s in states], [s.body_rate_radps[2] for s in states]
    assert yaw[-1] == pytest.approx(3.0, abs=1e-4)
    assert max(yaw) < 3.02
    assert 1.8 < max(rate) < 2.0


def test_both_signs_of_a_quaternion_are_one_attitude():
    ends = []
    for sign in (1.0, -1.0):
        vehicle = Quadrotor()
        vehicle.reset(rest())
        q = sign * quaternion_from_yaw(1.0)
        for _ in range(50):
            state = vehicle.step(Command(thrust_N=7.0, quaternion_wxyz=q, body_rate_radps=np.zeros(3)), 0.01)
        ends.append(yaw_of(state.quaternion_wxyz))
    assert 0.2 < ends[0] < 1.0
    assert ends[0] == ends[1]


def test_rights_itself_from_upside_down():
    vehicle = Quadrotor()
    flipped = State(
        position_m=np.array([0.0, 0.0, 50.0]),
        velocity_mps=np.zeros(3),
        quaternion_wxyz=np.array([0.0, 1.0, 0.0, 0.0]),
        body_rate_radps=np.zeros(3),
    )
    vehicle.reset(flipped)
    for sign in (1.0, -1.0):
        vehicle.place(flipped)
        level = Command(
            thrust_N=7.0, quaternion_wxyz=sign * rest().quaternion_wxyz, body_rate_radps=np.zeros(3)
        )
        for _ in range(300):
            state = vehicle.step(level, 0.01)
        assert rotation_from_quaternion(state.quaternion_wxyz)[2, 2] > 0.999


def aggressive_flight(seconds, refine):
    """Rotor commands (T, 4) and states (T+1, 17) of a flight through attitudes of up to 1 rad of tilt."""
    rng, loop = np.random.default_rng(11), AttitudeLoop(8.0, 2.0, 20.0, 6.0, 6.0)
    inertia = np.array([PLANT.inertia_x_kgm2, PLANT.inertia_y_kgm2, PLANT.inertia_z_kgm2])
    x, rate, work = vector(rotors=(236.0,) * 4), np.empty(3), np.empty((5, 17))
    commands, states = [], [x.copy()]
    for k in range(round(seconds / STEP_S)):
        if k % 80 == 0:  # a new attitude every 0.4 s
            tilt, way, yaw, thrust = rng.uniform([0.0, -3.1, -3.1, 4.0], [1.0, 3.1, 3.1, 14.0])
            q = np.array(
                [math.cos(tilt / 2), *(math.sin(tilt / 2) * np.array([math.cos(way), math.sin(way), 0.0]))]
            )
            spun = quaternion_from_yaw(yaw)
            wanted = np.array(
                [
                    spun[0] * q[0] - spun[3] * q[3],
                    spun[0] * q[1] - spun[3] * q[2],
                    spun[0] * q[2] + spun[3] * q[1],
                    spun[0] * q[3] + spun[3] * q[0],
                ]
            )
        wanted_body_rate(x[6:10], wanted, np.zeros(3), loop, rate)
        rotors = mixed(thrust, inertia * 20.0 * (rate - x[10:13]))
        for _ in range(refine):
            integrate(x, rotors, PLANT, STEP_S / refine, work)
        commands.append(rotors)
        states.append(x.copy())
    return np.array(commands), np.array(states)


@pytest.mark.parametrize(("refine", "tolerance_m", "tolerance_rad"), [(1, 0.02, 2e-4), (4, 2e-4, 2e-6)])
def test_agrees_with_mujoco_over_ten_seconds_of_aggressive_flight(refine, tolerance_m, tolerance_rad):
    """An independent integrator of the free rigid body under the same rotor commands.

    The wrench is written out here from exact exponential rotor speeds; MuJoCo integrates.
    The difference at the default step is that step's own error: a quarter of it leaves 1/100.
    """
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option timestep="0.0025" integrator="RK4" gravity="0 0 -9.81"/><worldbody><body>
        <freejoint/><inertial pos="0 0 0" mass="0.75" diaginertia="0.015 0.015 0.024"/>
        </body></worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    commands, states = aggressive_flight(10.0, refine)
    x, y, sense = np.array([1, 1, -1, -1]), np.array([-1, 1, 1, -1]), np.array([1, -1, 1, -1])
    arm = 0.076 * math.sqrt(0.5)
    speed, interval = np.full(4, 236.0), 0

    def rotor_speeds(since_s):
        return commands[interval] + (speed - commands[interval]) * math.exp(-since_s / 0.02)

    def apply(_, data):
        w = rotor_speeds(data.time - interval * STEP_S)
        force, rate, velocity = 3.3e-5 * w**2, data.qvel[3:6], data.qvel[0:3]
        up = np.empty(3)
        mujoco.mju_rotVecQuat(up, np.array([0.0, 0.0, 1.0]), data.qpos[3:7])
        drag = 0.5 * 1.225 * 1.0 * 4.3e-3 * np.linalg.norm(velocity) * velocity
        moment = np.array([arm * (y @ force), -arm * (x @ force), -5.5e-7 * (sense @ w**2)])
        spin = 4.0e-6 * np.array([0.0, 0.0, sense @ w])
        data.qfrc_passive[0:3] += up * force.sum() - drag
        data.qfrc_passive[3:6] += moment - np.cross(rate, spin)

    worst_m, worst_rad = 0.0, 0.0
    mujoco.set_mjcb_passive(apply)
    try:
        for interval in range(len(commands)):
            mujoco.mj_step(model, data, 2)
            speed = rotor_speeds(STEP_S)
            ours = states[interval + 1]
            worst_m = max(worst_m, float(np.linalg.norm(ours[0:3] - data.qpos[0:3])))
            worst_rad = max(worst_rad, 2.0 * math.acos(min(1.0, abs(float(ours[6:10] @ data.qpos[3:7])))))
    finally:
        mujoco.set_mjcb_passive(None)
    assert np.linalg.norm(states[:, 3:6], axis=1).max() > 5.0
    assert np.abs(states[:, 10:13]).max() > 4.0
    assert worst_m < tolerance_m
    assert worst_rad < tolerance_rad


def test_refuses_what_cannot_hover():
    with pytest.raises(ConfigError, match=r"rotor speeds must span the hover speed of 236\.1 rad/s"):
        Quadrotor(max_rotor_speed_radps=200.0)
    with pytest.raises(ConfigError, match=r"substeps must be 1 to 100, got 0"):
        Quadrotor(substeps=0)
