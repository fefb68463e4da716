"""Where movers are, row by row: the form in which the options keep their motion."""

from __future__ import annotations

import math
from typing import NamedTuple

from uavexp.arrays import Float, UInt8
from uavexp.types import Bodies

ROW_S = 0.01  # between two rows; between them bodies go on at their velocity


class Timeline(NamedTuple):
    """Positions and velocities of bodies at every `ROW_S`, from time 0."""

    shape: UInt8  # (B,) values of `Shape`
    half_size_m: Float  # (B, 3)
    position_m: Float  # (K, B, 3)
    velocity_mps: Float  # (K, B, 3)

    def at(self, time_s: float, row_time_s: float) -> Bodies:
        """The bodies at a time, read from the row at or before `row_time_s` (no later than the last row)."""
        row = row_of(row_time_s)
        position_m, velocity_mps = self.position_m[row], self.velocity_mps[row]
        rest_s = row_time_s - row * ROW_S
        if rest_s > 1e-8:
            position_m = position_m + rest_s * velocity_mps
        return Bodies(
            time_s=time_s,
            shape=self.shape,
            half_size_m=self.half_size_m,
            position_m=position_m,
            velocity_mps=velocity_mps,
        )


def row_of(time_s: float) -> int:
    """Index of the last row at or before a time."""
    return math.floor(time_s / ROW_S + 1e-6)
