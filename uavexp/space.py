"""Which space of a building is free, solid, never measured, or outside of it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from uavexp.arrays import Bool, Float, Int, UInt8

UNMEASURED, FREE, SOLID = 0, 1, 2  # free: air inside the building
OUTSIDE, SURFACE = 3, 4  # air around the building; a cell that a surface enters, part air and part solid


@dataclass(frozen=True, slots=True, kw_only=True)
class Space:
    """The state of space, cell by cell; the outermost cells stand for all that lies beyond them."""

    state: UInt8  # (X, Y, Z)
    low_m: Float  # (3,) lower corner of cell (0, 0, 0)
    cell_m: Float  # (3,) size of a cell along each axis
    yaw_rad: float = 0.0  # of the cells, about the vertical through `low_m`
    unmeasured_is_solid: bool = True  # or free to fly through

    @classmethod
    def all_free(cls) -> Space:
        """Nothing but free space."""
        return cls(state=np.full((1, 1, 1), FREE, np.uint8), low_m=np.zeros(3), cell_m=np.ones(3))

    def index_of(self, points_m: Float) -> tuple[Int, Int, Int]:
        """Cells that hold points (N, 3), or the nearest ones: their indices along x, y and z, (N,) each."""
        local = np.asarray(points_m, dtype=np.float64) - self.low_m
        if self.yaw_rad != 0.0:
            c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
            x, y, z = local.T
            local = np.column_stack([c * x + s * y, c * y - s * x, z])
        last = np.array(self.state.shape) - 1
        cell = np.clip(np.floor(local / self.cell_m), 0, last).astype(np.int64)
        return cell[:, 0], cell[:, 1], cell[:, 2]

    def state_at(self, points_m: Float) -> UInt8:
        """State (N,) at points (N, 3), m."""
        return np.asarray(self.state[self.index_of(points_m)])

    def is_inside(self, points_m: Float) -> Bool:
        """Whether points (N, 3) lie in free space inside the building (N,)."""
        return np.asarray(self.state_at(points_m) == FREE)

    def is_free(self, points_m: Float) -> Bool:
        """Whether points (N, 3) lie in air, inside the building or around it (N,)."""
        state = self.state_at(points_m)
        return np.asarray((state == FREE) | (state == OUTSIDE))

    def is_solid(self, points_m: Float) -> Bool:
        """Whether points (N, 3) lie inside of a solid, or in what counts as one (N,)."""
        state = self.state_at(points_m)
        return np.asarray((state == SOLID) | ((state == UNMEASURED) & self.unmeasured_is_solid))
