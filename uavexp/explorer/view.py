"""What one choice of a goal sees: the planar map, where the body fits, and path lengths over it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavexp.arrays import Bool, Float, Float32, Int
from uavexp.explorer.planar import path_lengths
from uavexp.field import FREE, UNKNOWN
from uavexp.mapping.projection import PlanarMap


@dataclass(frozen=True, slots=True)
class View:
    """The planar map as one choice of a goal sees it."""

    planar: PlanarMap
    inside: Bool  # (X, Y) cells within the flight bounds
    clear: Bool  # (X, Y) of these, where the body fits as far as is known
    vehicle: tuple[int, int]

    @property
    def known(self) -> Bool:
        """Clear cells known to be free (X, Y)."""
        return np.asarray(self.clear & (self.planar.state == FREE))

    def flat(self, points_m: Float) -> Int:
        """Flat indices (N,) of the cells that hold points (N, 3)."""
        index = np.floor((points_m[:, :2] - self.planar.origin_m) / self.planar.cell_m).astype(np.int64)
        shape = np.array(self.planar.state.shape)
        i, j = np.clip(index, 0, shape - 1).T
        return np.asarray(i * shape[1] + j)

    def lengths(self, passable: Bool, source: tuple[int, int], wanted: Int, unknown_cost: float) -> Float32:
        """Path lengths (X, Y) from a cell, in cells, exact at the `wanted` ones that can be reached."""
        wanted = wanted[passable.ravel()[wanted]]
        if len(wanted) == 0:
            return np.full(passable.shape, np.inf, dtype=np.float32)
        dear = np.int32(round(100 * unknown_cost))
        cost = np.where(self.planar.state == UNKNOWN, dear, np.int32(100))
        found: Float32 = path_lengths(passable, cost, source, wanted)
        return found


@dataclass(frozen=True, slots=True)
class Search:
    """Graph distances on one view, from the vehicle and from the target."""

    view: View
    from_vehicle: Float32  # (X, Y) path cost from the vehicle, over unknown cells too if optimistic, in cells
    from_target: Float32  # (X, Y) with unknown as free, in cells; 0 without a target
    target_known: bool  # whether known-free cells lead from the vehicle to the target


def view_of(
    planar: PlanarMap, position_m: Float, flight_bounds_m: Float, clearance_m: float, escape_m: float
) -> View:
    """View of a planar map from a position.

    Args:
        planar: the map.
        position_m: (3,) of the vehicle.
        flight_bounds_m: (2, 3).
        clearance_m: that passable cells exceed.
        escape_m: radius around the vehicle within which any clearance will do: nearer to an
            obstacle than allowed, it must still find its way out.
    """
    inside = _inside(planar, flight_bounds_m)
    vehicle = planar.cell_of(position_m)
    clear = inside & (planar.clearance > clearance_m)
    clear |= inside & (planar.clearance > 0.0) & _within(planar, vehicle, escape_m)
    return View(planar, inside, clear, vehicle)


def _inside(planar: PlanarMap, bounds_m: Float) -> Bool:
    nx, ny = planar.state.shape
    x = planar.origin_m[0] + (np.arange(nx) + 0.5) * planar.cell_m
    y = planar.origin_m[1] + (np.arange(ny) + 0.5) * planar.cell_m
    within_x = (x >= bounds_m[0, 0]) & (x <= bounds_m[1, 0])
    within_y = (y >= bounds_m[0, 1]) & (y <= bounds_m[1, 1])
    inside: Bool = within_x[:, None] & within_y[None, :]
    return inside


def _within(planar: PlanarMap, cell: tuple[int, int], radius_m: float) -> Bool:
    i, j = np.ogrid[: planar.state.shape[0], : planar.state.shape[1]]
    near: Bool = (i - cell[0]) ** 2 + (j - cell[1]) ** 2 <= (radius_m / planar.cell_m) ** 2
    return near
