"""The flown reference as setpoints of PX4's offboard mode (message `TrajectorySetpoint`).

PX4's world is north, east, down; ours is x east, y north, z up (REP 103): north = y, east = x, down = -z,
yaw from north clockwise = pi/2 - yaw. Columns are named as ulog2csv names the message's fields.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from uavexp.arrays import Float
from uavexp.geometry import wrap_angle, yaw_of
from uavexp.store.stored_trial import StoredTrial

RATE_HZ = 50.0  # offboard needs more than 2 Hz
_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def write(trial: StoredTrial, file: Path) -> Sequence[Path]:
    """Write a row per setpoint: timestamp in us; m, m/s, m/s^2, rad."""
    columns = setpoints(trial)
    with file.open("w", encoding="utf-8", newline="\n") as text:
        text.write(",".join(["timestamp", *columns]) + "\n")
        for time_us, row in zip(_times_us(trial), np.column_stack(list(columns.values())), strict=True):
            text.write(",".join([str(time_us), *(f"{value:.6g}" for value in row.tolist())]) + "\n")
    return [file]


def setpoints(trial: StoredTrial) -> dict[str, Float]:
    """Columns (N,) by name, north east down.

    A log has the reference's position and acceleration; its velocity is their position's central
    difference, and its yaw is the flown one.
    """
    steps, rows = trial.log.steps, _rows(trial)
    position_m = steps.reference_position_m
    spaced = len(position_m) > 1
    velocity_mps = np.gradient(position_m, trial.log.step_s, axis=0) if spaced else np.zeros_like(position_m)
    vectors = {
        "position": position_m,
        "velocity": velocity_mps,
        "acceleration": steps.reference_acceleration_mps2,
    }
    columns: dict[str, Float] = {}
    for name, values in vectors.items():
        ned = values[rows] @ _NED.T
        columns |= {f"{name}[{axis}]": ned[:, axis] for axis in range(3)}
    yaw_rad = [wrap_angle(0.5 * np.pi - yaw_of(q)) for q in steps.quaternion_wxyz[rows]]
    return {**columns, "yaw": np.array(yaw_rad)}


def _rows(trial: StoredTrial) -> slice:
    return slice(None, None, max(1, round(1.0 / (RATE_HZ * trial.log.step_s))))


def _times_us(trial: StoredTrial) -> list[int]:
    times: list[int] = np.rint(trial.log.steps.time_s[_rows(trial)] * 1e6).astype(np.int64).tolist()
    return times
