"""State and reference as a table: a row per simulation step, units in the names of the columns."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from uavexp.arrays import Float
from uavexp.store.stored_trial import StoredTrial

_AXES = ("x", "y", "z")


def write(trial: StoredTrial, file: Path) -> Sequence[Path]:
    """Write the table; numbers in their shortest form that reads back as the same."""
    columns = table(trial)
    with file.open("w", encoding="utf-8", newline="\n") as text:
        text.write(",".join(columns) + "\n")
        for row in np.column_stack(list(columns.values())).tolist():
            text.write(",".join(map(repr, row)) + "\n")
    return [file]


def table(trial: StoredTrial) -> dict[str, Float]:
    """Columns (T,) by name; world frame, z up; the quaternion turns body to world."""
    steps = trial.log.steps
    vectors = {
        "position_{}_m": steps.position_m,
        "velocity_{}_mps": steps.velocity_mps,
        "estimated_position_{}_m": steps.estimated_position_m,
        "reference_position_{}_m": steps.reference_position_m,
        "reference_acceleration_{}_mps2": steps.reference_acceleration_mps2,
    }
    columns = {"time_s": steps.time_s}
    for name, rows in vectors.items():
        columns |= {name.format(axis): rows[:, index] for index, axis in enumerate(_AXES)}
    columns |= {f"quaternion_{axis}": steps.quaternion_wxyz[:, index] for index, axis in enumerate("wxyz")}
    return {**columns, "clearance_m": steps.clearance_m}
