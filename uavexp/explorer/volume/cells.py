"""The map in cells of a few voxels: closed, not seen yet, or open, kept up to date where the map changes.

A cell is as clear as its clearest voxel, so no doorway is lost however it lies on the grid. It is open when
all of the body's place about that voxel was seen, as `safety=committed` asks. Cells are wanted of which half
and more was not seen though the body would fit. Cells lie flat with a closed margin one cell wide, so that
no step asks for the border.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Bool, Float, Float32, Int, Int32, UInt8
from uavexp.explorer.volume.steps import Steps, steps_on
from uavexp.field import TILE, UNKNOWN, DistanceField

# kinds of cells. Closed: outside, or too near to what is mapped. Edge: seen, but not all around the body.
# Narrow: only the lesser clearance is kept; so may those that were not seen (all around).
CLOSED, UNSEEN, EDGE, OPEN, NARROW_UNSEEN, NARROW = 0, 1, 2, 3, 4, 5


class Body(NamedTuple):
    """What has to fit into cells."""

    clearance_m: float  # that some voxel of a passable cell exceeds
    narrow_m: float  # the lesser one of narrow cells
    radius_m: float  # of the upright cylinder that must have been seen ...
    half_height_m: float  # ... around a place


@nb.njit(cache=True)
def _seen_around(state: UInt8, i: int, j: int, k: int, radius: float, tall: int) -> bool:
    """Whether all voxels of an upright cylinder about a voxel were seen; those outside were not."""
    reach = int(radius)
    nx, ny, nz = state.shape
    if i < reach or j < reach or k < tall or i + reach >= nx or j + reach >= ny or k + tall >= nz:
        return False
    for x in range(i - reach, i + reach + 1):
        for y in range(j - reach, j + reach + 1):
            if (x - i) ** 2 + (y - j) ** 2 > radius * radius:
                continue
            for z in range(k - tall, k + tall + 1):
                if state[x, y, z] == UNKNOWN:
                    return False
    return True


@nb.njit(cache=True)
def _clearest(distance: Float32, first: tuple[int, int, int], size: int) -> tuple[int, int, int]:
    """The voxel of a cell, which begins at this one, that has the most clearance."""
    nx, ny, nz = distance.shape
    at = first
    for x in range(first[0], min(first[0] + size, nx)):
        for y in range(first[1], min(first[1] + size, ny)):
            for z in range(first[2], min(first[2] + size, nz)):
                if distance[x, y, z] > distance[at]:
                    at = (x, y, z)
    return at


@nb.njit(cache=True)
def _kind_of(
    distance: Float32, state: UInt8, first: tuple[int, int, int], size: int, body: Body, voxel_m: float
) -> tuple[int, int]:
    """Kind of the cell that begins at this voxel, and how many of its voxels were not seen."""
    at, unseen = _clearest(distance, first, size), 0
    for x in range(first[0], min(first[0] + size, state.shape[0])):
        for y in range(first[1], min(first[1] + size, state.shape[1])):
            for z in range(first[2], min(first[2] + size, state.shape[2])):
                unseen += state[x, y, z] == UNKNOWN
    best = distance[at]
    if best <= body.narrow_m:
        return CLOSED, unseen
    wide, tall = best > body.clearance_m, int(body.half_height_m / voxel_m + 0.5)
    seen = unseen <= size**3 / 4
    if seen and _seen_around(state, at[0], at[1], at[2], body.radius_m / voxel_m, tall):
        return (OPEN if wide else NARROW), unseen
    if not wide:
        return NARROW_UNSEEN, unseen
    return (EDGE if seen else UNSEEN), unseen


@nb.njit(cache=True)
def _columns_of(tiles: Int, shape: tuple[int, int], size: int, reach: int) -> Bool:
    """Columns of cells (I, J) that look at voxels of tiles (T, 2), or so many voxels beside them."""
    columns = np.zeros(shape, dtype=np.bool_)
    for t in range(tiles.shape[0]):
        low, high = (tiles[t] * TILE - reach) // size, (tiles[t] * TILE + TILE - 1 + reach) // size + 1
        columns[max(low[0], 0) : high[0], max(low[1], 0) : high[1]] = True
    return columns


@nb.njit(cache=True)
def _is_wanted(kind: int, unseen: int, size: int) -> bool:
    return bool(kind == UNSEEN and 2 * unseen >= size**3)


@nb.njit(cache=True)
def _pool(
    distance: Float32, state: UInt8, voxel_m: float, size: int, columns: Bool, inside: Int, body: Body,
    kind: UInt8, wanted: Bool, changed: Int32,
) -> int:  # fmt: skip
    """Make the cells of columns (I, J) anew; returns how many have changed their kind.

    Args:
        distance: (X, Y, Z) of the map, m.
        state: (X, Y, Z) of the map.
        voxel_m: edge of a voxel.
        size: voxels along a cell's edge.
        columns: without margin.
        inside: (2, 3) first cell within the flight bounds, and the one behind the last.
        body: that is to fit.
        kind: (I, J, K) margin included, is written.
        wanted: the same.
        changed: filled with the flat cells whose kind has changed.
    """
    count = 0
    for i in range(inside[0, 0], inside[1, 0]):
        for j in range(inside[0, 1], inside[1, 1]):
            if not columns[i, j]:
                continue
            for k in range(inside[0, 2], inside[1, 2]):
                first = (i * size, j * size, k * size)
                now, unseen = _kind_of(distance, state, first, size, body, voxel_m)
                wanted[i + 1, j + 1, k + 1] = _is_wanted(now, unseen, size)
                if kind[i + 1, j + 1, k + 1] != now:
                    kind[i + 1, j + 1, k + 1] = now
                    changed[count] = ((i + 1) * kind.shape[1] + j + 1) * kind.shape[2] + k + 1
                    count += 1
    return count


@nb.njit(cache=True)
def _still_wanted(distance: Float32, state: UInt8, voxel_m: float, size: int, first: Int, body: Body) -> Bool:
    """Whether cells (C,) that begin at voxels (C, 3) are wanted by the map as it is."""
    wanted = np.empty(first.shape[0], dtype=np.bool_)
    for n in range(first.shape[0]):
        at = (first[n, 0], first[n, 1], first[n, 2])
        kind, unseen = _kind_of(distance, state, at, size, body, voxel_m)
        wanted[n] = _is_wanted(kind, unseen, size)
    return wanted


@nb.njit(cache=True)
def _mark_frontier(kind: UInt8, wanted: Bool, columns: Bool, frontier: Bool) -> None:
    """Mark the cells that are wanted and lie beside a seen one, in columns (I, J) and those next to them.

    Args:
        kind: (I, J, K) margin included.
        wanted: the same.
        columns: without margin.
        frontier: as `kind`, is written.
    """
    rows, across = columns.shape
    for i in range(rows):
        for j in range(across):
            if not columns[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2].any():
                continue
            x, y = i + 1, j + 1
            for z in range(1, kind.shape[2] - 1):
                beside = False
                if wanted[x, y, z]:
                    for near in (
                        kind[x - 1, y, z], kind[x + 1, y, z], kind[x, y - 1, z], kind[x, y + 1, z],
                        kind[x, y, z - 1], kind[x, y, z + 1],
                    ):  # fmt: skip
                        beside |= near in (EDGE, OPEN, NARROW)
                frontier[x, y, z] = beside


class Cells:
    """The cells of one field.

    Args:
        field: the map.
        bounds_m: (2, 3) of the flight.
        cell_m: edge of a cell; the nearest whole number of voxels is taken.
        body: that is to fit.

    Attributes:
        kind: (N,) of each cell, flat, margin included.
        wanted: (N,) whether most of it was not seen.
        looked: (N,) how often it was looked at and not seen.
        steps: on the grid.
        shape: of the grid, margin included.
    """

    def __init__(self, field: DistanceField, bounds_m: Float, cell_m: float, body: Body) -> None:
        self.field = field
        self.size = max(1, round(cell_m / field.voxel_size_m))
        self.cell_m = self.size * field.voxel_size_m
        self._body = body
        count = [-(-n // self.size) + 2 for n in field.state.shape]
        self.shape = (count[0], count[1], count[2])
        self.kind: UInt8 = np.zeros(int(np.prod(count)), np.uint8)
        self.wanted: Bool = np.zeros_like(self.kind, dtype=np.bool_)
        self.looked: UInt8 = np.zeros_like(self.kind)
        self.steps: Steps = steps_on(self.shape)
        self._frontier: Bool = np.zeros_like(self.wanted)
        low = np.ceil((bounds_m[0] - field.origin_m) / self.cell_m - 0.5 - 1e-6)
        high = np.floor((bounds_m[1] - field.origin_m) / self.cell_m - 0.5 + 1e-6) + 1
        self._inside = np.clip(np.stack([low, high]), 0, np.array(self.shape) - 2).astype(np.int64)
        self._changes: Int32 = np.empty(self.kind.size, np.int32)
        self._seen: Int32 | None = None  # the field's counters of changes at the last update

    def update(self) -> Int32:
        """Bring the cells up to date; returns those (C,) whose kind has changed."""
        field, now = self.field, self.field.changed
        if self._seen is None:  # all of it
            tiles = np.argwhere(np.ones([-(-n // TILE) for n in field.state.shape[:2]], dtype=np.bool_))
        else:
            tiles = np.argwhere(now != self._seen)
        self._seen = now.copy()
        reach = int(self._body.radius_m / field.voxel_size_m) + self.size
        columns = _columns_of(tiles, (self.shape[0] - 2, self.shape[1] - 2), self.size, reach)
        shaped = self.kind.reshape(self.shape), self.wanted.reshape(self.shape)
        count = _pool(
            field.distance, field.state, field.voxel_size_m, self.size, columns, self._inside, self._body,
            *shaped, self._changes,
        )  # fmt: skip
        _mark_frontier(*shaped, columns, self._frontier.reshape(self.shape))
        return self._changes[:count].copy()

    def still_wanted(self, cells: Int) -> Bool:
        """Whether cells (C,) within the bounds are wanted by the map as it is now, without an update."""
        field, first = self.field, (self.index(cells) - 1) * self.size
        wanted: Bool = _still_wanted(
            field.distance, field.state, field.voxel_size_m, self.size, first, self._body
        )
        return wanted

    def frontier(self, enough: int) -> Int:
        """Frontier cells (F,), ascending; those looked at so often in vain are none any more."""
        found = np.flatnonzero(self._frontier)
        return found[self.looked[found] < enough]

    def index(self, cells: Int) -> Int:
        """Indices (F, 3) of flat cells (F,)."""
        return np.stack(np.unravel_index(cells, self.shape), axis=-1)

    def centre_m(self, cells: Int) -> Float:
        """Centres (F, 3) of flat cells (F,)."""
        return np.asarray(self.field.origin_m + (self.index(cells) - 0.5) * self.cell_m, dtype=np.float64)

    def clearest_m(self, cells: Int) -> Float:
        """Centres (F, 3) of the clearest voxels of flat cells (F,)."""
        first = (self.index(cells) - 1) * self.size
        voxel = [_clearest(self.field.distance, (i, j, k), self.size) for i, j, k in first]
        return np.asarray(self.field.origin_m + (np.reshape(voxel, (-1, 3)) + 0.5) * self.field.voxel_size_m)

    def of(self, points_m: Float) -> Int:
        """Flat cells (P,) that hold points (P, 3); the nearest ones of points outside."""
        index = np.floor((points_m - self.field.origin_m) / self.cell_m).astype(np.int64) + 1
        index = np.clip(index, 1, np.array(self.shape) - 2)
        return np.asarray(np.ravel_multi_index(tuple(index.T), self.shape))
