"""The 2D map at flight height: least clearance over a band of heights, and what is known of it.

M(x, y) = min over z in [z_min, z_max] of the distance field (paper 1, §3.2). The band lies around
the flight height, or floor and ceiling would make every column occupied.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba as nb
import numpy as np

from uavexp.arrays import Float, Float32, Int, Int32, UInt8
from uavexp.errors import require, require_positive
from uavexp.field import FREE, OCCUPIED, TILE, UNKNOWN, DistanceField

Part = tuple[int, int, int, int]  # of the plane: rows from, to, columns from, to


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """What of a field is projected; raises `ConfigError` when it does not hold the flight height."""

    z_min_m: float  # world z of the lower end; layers that the band touches count
    z_max_m: float  # of the upper end
    flight_height_m: float  # world z; a cell is UNKNOWN until the voxel that holds its centre at
    # this height was observed, whatever is known above and below
    cell_m: float = 0.15  # edge of a cell
    occupied_below_m: float  # an observed cell is OCCUPIED below this clearance, else FREE

    def __post_init__(self) -> None:
        require_positive(cell_m=self.cell_m)
        low_m, height_m, high_m = self.z_min_m, self.flight_height_m, self.z_max_m
        require(
            low_m <= height_m <= high_m and math.isfinite(high_m - low_m),
            f"z_min_m <= flight_height_m <= z_max_m must hold, got {low_m}, {height_m}, {high_m}",
        )
        below_m = self.occupied_below_m
        require(math.isfinite(below_m), f"occupied_below_m must be finite, got {below_m}")

    def layers(self, field: DistanceField) -> tuple[int, int, int]:
        """First and last layer of the band, and the one of the flight height."""

        def layer(height_m: float, slack: float) -> int:
            index = math.floor((height_m - float(field.origin_m[2])) / field.voxel_size_m + slack)
            return int(min(max(index, 0), field.state.shape[2] - 1))

        return layer(self.z_min_m, 1e-6), layer(self.z_max_m, -1e-6), layer(self.flight_height_m, 1e-6)


@nb.njit(cache=True, inline="always")
def _between(coordinate: float, count: int) -> tuple[int, int, float]:
    """Lower and upper voxel and fraction between their centres, clamped to the grid's edge."""
    clamped = min(max(coordinate, 0.0), count - 1.0)
    lower = int(clamped)
    return lower, min(lower + 1, count - 1), clamped - lower


@nb.njit(cache=True)
def _project(
    distance: Float32, state: UInt8, layers: tuple[int, int, int], ratio: float, occupied_below_m: float,
    parts: Int, clearance: Float32, planar: UInt8,
) -> None:  # fmt: skip
    """Fill parts (P, 4) of `clearance` and `planar`; `ratio` is cell over voxel."""
    nx, ny, _ = distance.shape
    first, last, flight = layers
    for n in range(parts.shape[0]):
        for i in range(parts[n, 0], parts[n, 1]):
            across = (i + 0.5) * ratio
            x0, x1, wx = _between(across - 0.5, nx)
            x = min(int(across), nx - 1)
            for j in range(parts[n, 2], parts[n, 3]):
                along = (j + 0.5) * ratio
                y0, y1, wy = _between(along - 0.5, ny)
                least = np.inf
                for k in range(first, last + 1):
                    near = distance[x0, y0, k] * (1.0 - wy) + distance[x0, y1, k] * wy
                    far = distance[x1, y0, k] * (1.0 - wy) + distance[x1, y1, k] * wy
                    least = min(least, near * (1.0 - wx) + far * wx)
                clearance[i, j] = least
                if state[x, min(int(along), ny - 1), flight] == UNKNOWN:
                    planar[i, j] = UNKNOWN
                else:
                    planar[i, j] = OCCUPIED if least < occupied_below_m else FREE


class Projection:
    """The planar map of a field, kept up to date; what has not changed is not projected again.

    Args:
        field: the map.
        band: what is projected.
    """

    __slots__ = ("_band", "_seen", "field", "planar")

    def __init__(self, field: DistanceField, band: Band) -> None:
        cells = np.array(field.state.shape[:2]) * field.voxel_size_m / band.cell_m
        shape = tuple(np.maximum(1, np.ceil(cells - 1e-6)).astype(int))
        self.field = field
        self.planar = PlanarMap(
            origin_m=field.origin_m[:2].copy(),
            cell_m=band.cell_m,
            clearance=np.empty(shape, np.float32),
            state=np.empty(shape, np.uint8),
        )
        self._band = band
        self._seen: Int32 | None = None  # the field's counters of changes at the last update

    def update(self) -> Int:
        """Bring the planar map up to date; returns the parts (P, 4) that were: rows from, to, columns."""
        field, planar, band = self.field, self.planar, self._band
        parts = self._stale()
        self._seen = field.changed.copy()
        _project(
            field.distance, field.state, band.layers(field), band.cell_m / field.voxel_size_m,
            band.occupied_below_m, parts, planar.clearance, planar.state,
        )  # fmt: skip
        return parts

    def _stale(self) -> Int:
        """Parts of the plane that look at a tile of columns that has changed."""
        shape = np.array(self.planar.state.shape)
        if self._seen is None:
            return np.array([[0, shape[0], 0, shape[1]]])
        tile = np.argwhere(self.field.changed != self._seen)
        ratio = self._band.cell_m / self.field.voxel_size_m
        # A cell looks at columns whose middles are less than one from its own; at the edge, at the last.
        low = np.ceil((tile * TILE - 0.5) / ratio - 0.5 - 1e-6).astype(np.int64).clip(0)
        high = np.ceil((tile * TILE + TILE + 0.5) / ratio - 0.5 + 1e-6).astype(np.int64)
        high = np.where(tile == np.array(self.field.changed.shape) - 1, shape, np.minimum(high, shape))
        return np.column_stack([low[:, 0], high[:, 0], low[:, 1], high[:, 1]])
