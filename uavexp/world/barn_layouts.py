"""The 300 layouts of the BARN benchmark: where its cylinders stand, how long its reference paths are.

Made from the published Gazebo worlds (Perille, Truong, Xiao and Stone 2020, "Benchmarking Metric Ground
Navigation"; MIT, `barn_data/LICENSE`), whose cylinders all stand on a grid as wide as they are: a bit of
`cells` in `barn_data/layouts.csv` is a place of that grid, row by row from y = 0, along x from -4.5 m.
The reference paths are those that the BARN Challenge takes its optimal times from.
"""

from __future__ import annotations

import csv
import functools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from uavexp.arrays import Float

COUNT = 300
DIAMETER_M = 0.15  # of a cylinder, and the spacing of the grid
CORNER_M = (-4.5, 0.0)  # x, y, of the grid
FIELD_M = (4.5, 14.0)  # along x and y: the grid, and the open ground that the target lies on
START_M = (-2.25, 3.0)  # x, y
TARGET_M = (-2.25, 13.0)
_ROWS, _COLUMNS = 64, 30
_FILE = Path(__file__).parent / "barn_data" / "layouts.csv"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Layout:
    """One world, as published."""

    centres_m: Float  # (N, 2) of the cylinders
    reference_path_m: float


def layout(number: int) -> Layout:
    """A world by its number, from 0."""
    reference_path_m, cells = _rows()[number]
    bits = np.unpackbits(np.frombuffer(bytes.fromhex(cells), dtype=np.uint8)).reshape(_ROWS, _COLUMNS)
    row, column = np.nonzero(bits)
    return Layout(
        centres_m=np.array(CORNER_M) + DIAMETER_M * (np.column_stack([column, row]) + 0.5),
        reference_path_m=reference_path_m,
    )


@functools.cache
def _rows() -> tuple[tuple[float, str], ...]:
    with _FILE.open(encoding="ascii", newline="") as file:
        return tuple((float(row["reference_path_m"]), row["cells"]) for row in csv.DictReader(file))


def name_of(number: int) -> str:
    """Name of a world, by which it is known after a flight."""
    return f"barn_{number:03d}"


def number_of(name: str) -> int | None:
    """Number of the world of a name; None where it is none of these."""
    stem, _, digits = name.partition("_")
    return int(digits) if stem == "barn" and digits.isdecimal() else None
