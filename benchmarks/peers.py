"""`python -m benchmarks.peers`: other simulators beside ours, in ratios of processor time a simulated second.

Each runs what it has of a flight, in a process of its own, by turns with ours; what it leaves out is printed
with its ratio. Ours is a whole flight of `strategy=mcr world=warehouse`: depth images of 64 x 48 pixels at
20 Hz, a map, its distance field, a goal, a plan, control at 100 Hz and contacts with the true geometry.
"""

from __future__ import annotations

import importlib.util
import multiprocessing
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from rich.console import Console

SIMULATED_S, ROUNDS = 20.0, 3
PIXELS, IMAGE_HZ = (64, 48), 20


@dataclass(frozen=True, slots=True, kw_only=True)
class Peer:
    """Another simulator."""

    name: str
    module: str
    install: str
    leaves_out: str
    cost: Callable[[], float]  # processor time s a simulated second


def ours() -> float:
    """A whole flight, its world drawn before, kernels loaded."""
    import uavexp
    from uavexp.config.build import build
    from uavexp.trial import fly

    trial = uavexp.fly(strategy="mcr", world="warehouse", seed=0)
    begin_s = time.process_time()
    log = fly(build(trial.config), trial.world, 0)
    return (time.process_time() - begin_s) / float(log.steps.time_s[-1])


def rotorpy() -> float:
    """A circle flown by the geometric controller, 100 Hz."""
    from rotorpy.controllers.quadrotor_control import SE3Control
    from rotorpy.environments import Environment
    from rotorpy.trajectories.circular_traj import ThreeDCircularTraj
    from rotorpy.vehicles.crazyflie_params import quad_params
    from rotorpy.vehicles.multirotor import Multirotor

    path = ThreeDCircularTraj(radius=np.array([1.0, 1.0, 0.0]))
    parts = {"vehicle": Multirotor(quad_params), "controller": SE3Control(quad_params), "trajectory": path}
    environment = Environment(**parts, sim_rate=100)
    environment.run(t_final=1.0)  # the first is no measurement
    begin_s = time.process_time()
    environment.run(t_final=SIMULATED_S)
    return (time.process_time() - begin_s) / SIMULATED_S


def gym_pybullet_drones() -> float:
    """Hover by its PID controller at 240 Hz physics and 48 Hz control, depth images at 20 Hz."""
    from gym_pybullet_drones.control.DSLPIDControl import DSLPIDControl
    from gym_pybullet_drones.envs.CtrlAviary import CtrlAviary
    from gym_pybullet_drones.utils.enums import DroneModel

    aviary = CtrlAviary(drone_model=DroneModel.CF2X, pyb_freq=240, ctrl_freq=48, gui=False, obstacles=True)
    aviary.IMG_RES = np.array(PIXELS)  # set for learning only
    pilot, there = DSLPIDControl(drone_model=DroneModel.CF2X), np.array([0.0, 0.0, 1.0])
    state, images = aviary.reset()[0][0], 0
    begin_s = time.process_time()
    for step in range(int(SIMULATED_S * aviary.CTRL_FREQ)):
        rpm = pilot.computeControlFromState(aviary.CTRL_TIMESTEP, state=state, target_pos=there)[0]
        state = aviary.step(rpm[None])[0][0]
        if step * IMAGE_HZ >= images * aviary.CTRL_FREQ:
            aviary._getDroneImages(0, segmentation=False)
            images += 1
    return (time.process_time() - begin_s) / SIMULATED_S


PEERS = (
    Peer(
        name="RotorPy",
        module="rotorpy",
        install="pip install 'uavexp[simulators]'",
        leaves_out="camera, map, planning, obstacles; has an IMU and motion capture",
        cost=rotorpy,
    ),
    Peer(
        name="gym-pybullet-drones, 64 x 48 pixels",
        module="gym_pybullet_drones",
        install="pip install git+https://github.com/utiasDSL/gym-pybullet-drones",
        leaves_out="noise of the image, map, planning; has colours beside depth",
        cost=gym_pybullet_drones,
    ),
)


def alone(cost: Callable[[], float]) -> float:
    """A cost, measured in a process of its own."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(cost)


def main() -> None:
    """Print a line a peer."""
    console = Console(highlight=False, soft_wrap=True)
    for peer in PEERS:
        if importlib.util.find_spec(peer.module) is None:
            console.print(f"{peer.name} is not installed: {peer.install}", markup=False)
            continue
        ratios = [alone(peer.cost) / alone(ours) for _ in range(ROUNDS)]
        spread = f"{min(ratios):.2f} to {max(ratios):.2f}"
        console.print(
            f"{peer.name} / ours: {statistics.median(ratios):.2f} ({spread}); it leaves out {peer.leaves_out}"
        )


if __name__ == "__main__":
    main()
