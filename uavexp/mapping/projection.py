"""The 2D map at flight height: least clearance over a band of heights, and what is known of it.

M(x, y) = min over z in [z_min, z_max] of the distance field (paper 1). The band lies around
the flight height, or floor and ceiling would make every column occupied.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba as nb
import numpy as np

from uavexp.arrays import Float, Float32, UInt8
from uavexp.errors import require, require_positive
from uavexp.field import FREE, OCCUPIED, UNKNOWN, DistanceField


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarMap:
    """Clearance and state of square cells; cell (i, j) has its centre at origin + (i + 0.5, j + 0.5) cell."""

    origin_m: Float  # (2,) lower corner of cell (0, 0), world x and y
    cell_m: float
    clearance: Float32  # (X, Y) least distance over the band at the cell's centre, m
    state: UInt8  # (X, Y) UNKNOWN, FREE or OCCUPIED (`mapping.base`)

    def cell_of(self, position_m: Float) -> tuple[int, int]:
        """Cell that holds a point (2,) or (3,); the nearest one when it lies outside."""
        index = np.floor((np.asarray(position_m)[:2] - self.origin_m) / self.cell_m).astype(np.int64)
        clamped = np.clip(index, 0, np.array(self.state.shape) - 1)
        return int(clamped[0]), int(clamped[1])

    def centre_m(self, cell: Float) -> Float:
        """World x and y (..., 2) of cell indices (..., 2), which may be fractional."""
        return np.asarray(self.origin_m + (np.asarray(cell) + 0.5) * self.cell_m, dtype=np.float64)


@nb.njit(cache=True, inline="always")
def _between(coordinate: float, count: int) -> tuple[int, int, float]:
    """Lower and upper voxel and fraction between their centres, clamped to the grid's edge."""
    clamped = min(max(coordinate, 0.0), count - 1.0)
    lower = int(clamped)
    return lower, min(lower + 1, count - 1), clamped - lower


@nb.njit(cache=True)
def _project(
    distance: Float32, state: UInt8, first_layer: int, last_layer: int, flight_layer: int,
    ratio: float, occupied_below_m: float, clearance: Float32, planar: UInt8,
) -> None:  # fmt: skip
    """Fill `clearance` and `planar`; `ratio` is cell over voxel."""
    nx, ny, _ = distance.shape
    for i in range(planar.shape[0]):
        across = (i + 0.5) * ratio
        x0, x1, wx = _between(across - 0.5, nx)
        x = min(int(across), nx - 1)
        for j in range(planar.shape[1]):
            along = (j + 0.5) * ratio
            y0, y1, wy = _between(along - 0.5, ny)
            least = np.inf
            for k in range(first_layer, last_layer + 1):
                near = distance[x0, y0, k] * (1.0 - wy) + distance[x0, y1, k] * wy
                far = distance[x1, y0, k] * (1.0 - wy) + distance[x1, y1, k] * wy
                least = min(least, near * (1.0 - wx) + far * wx)
            clearance[i, j] = least
            if state[x, min(int(along), ny - 1), flight_layer] == UNKNOWN:
                planar[i, j] = UNKNOWN
            else:
                planar[i, j] = OCCUPIED if least < occupied_below_m else FREE


def project(
    field: DistanceField,
    *,
    z_min_m: float,
    z_max_m: float,
    flight_height_m: float,
    cell_m: float = 0.15,
    occupied_below_m: float,
) -> PlanarMap:
    """Project a distance field onto the plane at flight height.

    Args:
        field: the map.
        z_min_m: lower end of the band, world z; layers that the band touches count.
        z_max_m: upper end of the band.
        flight_height_m: world z; a cell is UNKNOWN until the voxel that holds its centre at
            this height was observed, whatever is known above and below.
        cell_m: edge of a cell.
        occupied_below_m: an observed cell is OCCUPIED below this clearance, else FREE.

    Raises:
        ConfigError: the band is empty or does not hold the flight height, or a value is not finite.

    Source: paper 1, §3.2.
    """
    require_positive(cell_m=cell_m)
    require(
        z_min_m <= flight_height_m <= z_max_m and math.isfinite(z_max_m - z_min_m),
        f"z_min_m <= flight_height_m <= z_max_m must hold, got {z_min_m}, {flight_height_m}, {z_max_m}",
    )
    require(math.isfinite(occupied_below_m), f"occupied_below_m must be finite, got {occupied_below_m}")
    nx, ny, nz = field.distance.shape
    voxel_m = field.voxel_size_m

    def layer(height_m: float, slack: float) -> int:
        index = math.floor((height_m - float(field.origin_m[2])) / voxel_m + slack)
        return int(min(max(index, 0), nz - 1))

    shape = tuple(max(1, math.ceil(count * voxel_m / cell_m - 1e-6)) for count in (nx, ny))
    clearance = np.empty(shape, np.float32)
    state = np.empty(shape, np.uint8)
    _project(
        field.distance, field.state, layer(z_min_m, 1e-6), layer(z_max_m, -1e-6),
        layer(flight_height_m, 1e-6), cell_m / voxel_m, occupied_below_m, clearance, state,
    )  # fmt: skip
    return PlanarMap(origin_m=field.origin_m[:2].copy(), cell_m=cell_m, clearance=clearance, state=state)
