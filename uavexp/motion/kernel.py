"""The steps between two ticks as one numba kernel: a shipped controller flies the quadrotor."""

from __future__ import annotations

import math

import numba as nb

from uavexp.arrays import Float
from uavexp.controller.flatness import feed_forward
from uavexp.controller.position_velocity import Gains, thrust_and_attitude
from uavexp.vehicle.quadrotor import AttitudeLoop, Plant, advance


@nb.njit(cache=True)
def fly_free(
    x: Float,
    before: Float,
    command: Float,
    work: Float,
    references: Float,
    rows: Float,
    first: int,
    command_steps: int,
    step_s: float,
    substeps: int,
    gains: Gains,
    feeds: bool,
    plant: Plant,
    loop: AttitudeLoop,
    centre_m: Float,
    radius_m: float,
) -> tuple[int, bool]:
    """Fly on while nothing can be met: to the last reference, or until a step has left a ball.

    Args:
        x: the quadrotor's 17-vector; advanced in place.
        before: (17,) takes `x` as it was a step ago.
        command: (8,) thrust, attitude and body rate as commanded last; kept up to date.
        work: (6, 17) scratch space.
        references: (N, 14) of `pilot.following`, one per step.
        rows: (N, 19) of the recorder; each step's is written before it is flown.
        first: number of the first step.
        command_steps: from one command to the next.
        step_s: of each step.
        substeps: of the quadrotor.
        gains: of the controller.
        feeds: whether it feeds forward the body rate (`controller.flatness`), or the yaw rate alone.
        plant: the quadrotor's constants.
        loop: its inner loop.
        centre_m: (3,) of the ball in which the vehicle is free.
        radius_m: of that ball.

    Returns:
        How many steps were flown, and whether the last one has left the ball.
    """
    for k in range(references.shape[0]):
        reference, row = references[k], rows[k]
        if (first + k) % command_steps == 0:
            thrust, attitude = thrust_and_attitude(
                x[0:3], x[3:6], x[6:10], reference[0:3], reference[3:6], reference[6:9], reference[9], gains
            )
            command[0] = plant.mass_kg * thrust
            command[1:5] = attitude
            command[5:7] = 0.0
            command[7] = reference[10]
            if feeds:
                command[5:8] = feed_forward(
                    reference[3:6], reference[6:9], reference[11:14], reference[9], reference[10],
                    gains.drag_per_m, attitude,
                )  # fmt: skip
        row[0:10] = x[0:10]
        row[10:13] = x[0:3]
        row[13:16] = reference[0:3]
        row[16:19] = reference[6:9]
        before[:] = x
        advance(x, command, plant, loop, step_s, substeps, work)
        gone_x, gone_y, gone_z = x[0] - centre_m[0], x[1] - centre_m[1], x[2] - centre_m[2]
        if not math.sqrt(gone_x * gone_x + gone_y * gone_y + gone_z * gone_z) < radius_m:
            return k + 1, True
    return references.shape[0], False
