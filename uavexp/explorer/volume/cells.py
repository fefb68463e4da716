"""The map in cells of a few voxels: closed, not seen yet, or free, kept up to date where the map changes.

A cell is as clear as its clearest voxel, so no doorway is lost however it lies on the grid; the planner
asks the voxels themselves. It is free when three quarters of it were seen. What is still wanted of a cell is
that half of it and more was not seen though the body would fit there. Cells lie flat with a closed margin
one cell wide, so that no step asks for the border.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from uavexp.arrays import Bool, Float, Float32, Int, Int32, UInt8
from uavexp.explorer.volume.waves import Steps, steps_on
from uavexp.field import TILE, UNKNOWN, DistanceField

# kinds; closed: outside, or too near to what is mapped; narrow: only the lesser clearance is kept
CLOSED, UNSEEN, OPEN, NARROW_UNSEEN, NARROW = 0, 1, 2, 3, 4


@nb.njit(cache=True)
def _pool(
    distance: Float32, state: UInt8, size: int, tiles: Int, inside: Int, clearance_m: tuple[float, float],
    kind: UInt8, wanted: Bool, changed: Int32,
) -> int:  # fmt: skip
    """Make the cells of tiles (T, 2) of columns anew; returns how many have changed their kind.

    Args:
        distance: (X, Y, Z) of the map, m.
        state: (X, Y, Z) of the map.
        size: voxels along a cell's edge.
        tiles: of `DistanceField.changed`.
        inside: (2, 3) first cell within the flight bounds, and the one behind the last.
        clearance_m: that some voxel of a passable cell exceeds, and the lesser one of a narrow cell.
        kind: (I, J, K) margin included, is written.
        wanted: the same.
        changed: filled with the flat cells whose kind has changed.
    """
    nx, ny, nz = state.shape
    count, half, few = 0, size**3 / 2, size**3 / 4
    for t in range(tiles.shape[0]):
        i1 = min((tiles[t, 0] * TILE + TILE - 1) // size + 1, inside[1, 0])
        j1 = min((tiles[t, 1] * TILE + TILE - 1) // size + 1, inside[1, 1])
        for i in range(max(tiles[t, 0] * TILE // size, inside[0, 0]), i1):
            for j in range(max(tiles[t, 1] * TILE // size, inside[0, 1]), j1):
                for k in range(inside[0, 2], inside[1, 2]):
                    best, unseen = np.float32(-np.inf), 0
                    for x in range(i * size, min(i * size + size, nx)):
                        for y in range(j * size, min(j * size + size, ny)):
                            for z in range(k * size, min(k * size + size, nz)):
                                best = max(best, distance[x, y, z])
                                unseen += state[x, y, z] == UNKNOWN
                    if best > clearance_m[0]:
                        now = UNSEEN if unseen > few else OPEN
                    elif best > clearance_m[1]:
                        now = NARROW_UNSEEN if unseen > few else NARROW
                    else:
                        now = CLOSED
                    wanted[i + 1, j + 1, k + 1] = now == UNSEEN and unseen >= half
                    if kind[i + 1, j + 1, k + 1] != now:
                        kind[i + 1, j + 1, k + 1] = now
                        changed[count] = ((i + 1) * kind.shape[1] + j + 1) * kind.shape[2] + k + 1
                        count += 1
    return count


@nb.njit(cache=True)
def _frontier(kind: UInt8, wanted: Bool, looked: UInt8, enough: int, faces: Int) -> Int:
    """Cells (F,) that are wanted, were looked at less than `enough` times in vain, and lie beside a free one.

    Args:
        kind: (N,) flat.
        wanted: (N,).
        looked: (N,).
        enough: times.
        faces: (6,) offsets to the neighbours across a face.
    """
    found, count = np.empty(kind.shape[0], np.int64), 0
    for at in range(kind.shape[0]):
        if not wanted[at] or looked[at] >= enough:
            continue
        for offset in faces:
            if kind[at + offset] == OPEN or kind[at + offset] == NARROW:
                found[count] = at
                count += 1
                break
    return found[:count].copy()


class Cells:
    """The cells of one field.

    Args:
        field: the map.
        bounds_m: (2, 3) of the flight.
        cell_m: edge of a cell; the nearest whole number of voxels is taken.
        clearance_m: that the body's centre keeps, and the lesser one that it keeps where it must.

    Attributes:
        kind: (N,) of each cell, flat, margin included.
        wanted: (N,) whether most of it was not seen.
        looked: (N,) how often it was looked at and not seen.
        steps: on the grid.
        shape: of the grid, margin included.
    """

    def __init__(
        self, field: DistanceField, bounds_m: Float, cell_m: float, clearance_m: tuple[float, float]
    ) -> None:
        self.field = field
        self.size = max(1, round(cell_m / field.voxel_size_m))
        self.cell_m = self.size * field.voxel_size_m
        self._clearance_m = clearance_m
        count = [-(-n // self.size) + 2 for n in field.state.shape]
        self.shape = (count[0], count[1], count[2])
        self.kind: UInt8 = np.zeros(int(np.prod(count)), np.uint8)
        self.wanted: Bool = np.zeros_like(self.kind, dtype=np.bool_)
        self.looked: UInt8 = np.zeros_like(self.kind)
        self.steps: Steps = steps_on(self.shape)
        self._faces: Int = self.steps.offset[self.steps.length == self.steps.length.min()]
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
        shaped = self.kind.reshape(self.shape), self.wanted.reshape(self.shape)
        count = _pool(
            field.distance, field.state, self.size, tiles, self._inside, self._clearance_m, *shaped,
            self._changes,
        )  # fmt: skip
        return self._changes[:count].copy()

    def frontier(self, enough: int) -> Int:
        """Frontier cells (F,), ascending; those looked at so often in vain are none any more."""
        found: Int = _frontier(self.kind, self.wanted, self.looked, enough, self._faces)
        return found

    def index(self, cells: Int) -> Int:
        """Indices (F, 3) of flat cells (F,)."""
        return np.stack(np.unravel_index(cells, self.shape), axis=-1)

    def centre_m(self, cells: Int) -> Float:
        """Centres (F, 3) of flat cells (F,)."""
        return np.asarray(self.field.origin_m + (self.index(cells) - 0.5) * self.cell_m, dtype=np.float64)

    def of(self, points_m: Float) -> Int:
        """Flat cells (P,) that hold points (P, 3); the nearest ones of points outside."""
        index = np.floor((points_m - self.field.origin_m) / self.cell_m).astype(np.int64) + 1
        index = np.clip(index, 1, np.array(self.shape) - 2)
        return np.asarray(np.ravel_multi_index(tuple(index.T), self.shape))
