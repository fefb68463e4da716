"""Voxels as bits: neighbourhoods, and straight runs through whole stretches of open space.

A free cell is clear when its 26 neighbours are free, else near (an obstacle). From a clear cell
a straight canonical path has one way to go, on; the first cell where that may change is near.
A bit for every near cell lies in memory along each axis, so that the next one is found 64 cells
at a time. Everything a search reads of 24 million voxels is 3 MB an array, and stays in cache.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
import numpy.typing as npt

from uavexp.planner.voxel.moves import canonical_moves
from uavexp.types import Bool, Int, UInt8

UInt64 = npt.NDArray[np.uint64]
_DE_BRUIJN = 0x03F79D71B4CB0A89  # tells the 64 powers of two apart by their product's upper six bits
_TABLE = 1 << 16  # places for remembered neighbourhoods


def _bit_places() -> Int:
    places = np.empty(64, dtype=np.int64)
    for bit in range(64):
        places[((1 << bit) * _DE_BRUIJN & (1 << 64) - 1) >> 58] = bit
    return places


_PLACES = _bit_places()


class Terrain(NamedTuple):
    """A padded voxel grid as the searches read it; the border is blocked."""

    shape: Int  # (3,)
    free: UInt8  # (X Y bytes,) flat: bit k of a line along z is set where the cell is free
    near_x: UInt64  # (Y Z words,) flat: bit i of a line along x is set where the cell is near
    near_y: UInt64  # (X Z words,)
    near_z: UInt64  # (X Y words,)
    keys: Int  # (_TABLE,) remembered neighbourhoods with the move of arrival, -1 where none
    known: Int  # (_TABLE + 1,) their canonical moves; the last counts them


@nb.njit(cache=True)
def survey(free: Bool) -> Terrain:
    """Make free cells (X, Y, Z) ready for searches, padded by one on every side."""
    nx, ny, nz = free.shape
    bits = np.zeros((nx + 2, ny + 2, (nz + 9) // 8 + 1), dtype=np.uint8)
    near_x = np.zeros((ny + 2, nz + 2, (nx + 65) // 64), dtype=np.uint64)
    near_y = np.zeros((nx + 2, nz + 2, (ny + 65) // 64), dtype=np.uint64)
    near_z = np.zeros((nx + 2, ny + 2, (nz + 65) // 64), dtype=np.uint64)
    around = np.empty(nz, dtype=np.bool_)  # free in the nine cells of a level
    one = np.uint64(1)
    for i in range(1, nx + 1):
        for j in range(1, ny + 1):
            here = free[i - 1, j - 1]
            for k in range(nz):
                bits[i, j, (k + 1) >> 3] |= np.uint8(here[k]) << ((k + 1) & 7)
            inside = 1 < i < nx and 1 < j < ny
            around[:] = inside
            if inside:
                for di in range(-1, 2):
                    for dj in range(-1, 2):
                        line = free[i - 1 + di, j - 1 + dj]
                        for k in range(nz):
                            around[k] &= line[k]
            for k in range(nz):
                clear = 0 < k < nz - 1 and around[k - 1] and around[k] and around[k + 1]
                if here[k] and not clear:
                    near_x[j, k + 1, i >> 6] |= one << np.uint64(i & 63)
                    near_y[i, k + 1, j >> 6] |= one << np.uint64(j & 63)
                    near_z[i, j, (k + 1) >> 6] |= one << np.uint64((k + 1) & 63)
    shape = np.array((nx + 2, ny + 2, nz + 2))
    keys, known = np.full(_TABLE, -1, dtype=np.int64), np.zeros(_TABLE + 1, dtype=np.int64)
    return Terrain(shape, bits.ravel(), near_x.ravel(), near_y.ravel(), near_z.ravel(), keys, known)


@nb.njit(cache=True, inline="always")
def neighbourhood(free: UInt8, shape: Int, i: int, j: int, k: int) -> int:
    """Which of the 27 cells around a cell, not on the border, are free, as bits."""
    line = ((shape[2] + 7) >> 3) + 1
    first = ((i - 1) * shape[1] + j - 1) * line + ((k - 1) >> 3)
    shift = (k - 1) & 7
    bits = 0
    for di in range(3):
        for dj in range(3):
            at = first + (di * shape[1] + dj) * line
            three = (int(free[at]) | int(free[at + 1]) << 8) >> shift & 7
            bits |= three << (9 * di + 3 * dj)
    return bits


@nb.njit(cache=True, inline="always")
def is_near(near_z: UInt64, shape: Int, i: int, j: int, k: int) -> bool:
    """Whether a free cell has a neighbour that is not."""
    word = (i * shape[1] + j) * ((shape[2] + 63) >> 6) + (k >> 6)
    return near_z[word] >> np.uint64(k & 63) & np.uint64(1) != 0


@nb.njit(cache=True, inline="always")
def _to_next(words: UInt64, base: int, at: int) -> int:
    """Cells from place `at` of the line that begins at word `base` up to its next set bit; there is one."""
    place = at + 1
    word = base + (place >> 6)
    bits = words[word] >> np.uint64(place & 63)
    while bits == 0:
        word += 1
        place = (word - base) << 6
        bits = words[word]
    lowest = bits & (~bits + np.uint64(1))
    return place - at + _PLACES[(lowest * np.uint64(_DE_BRUIJN)) >> np.uint64(58)]


@nb.njit(cache=True, inline="always")
def _to_last(words: UInt64, base: int, at: int) -> int:
    """Cells from place `at` down to the line's last set bit before it; there is one."""
    place = at - 1
    word = base + (place >> 6)
    bits = words[word] << np.uint64(63 - (place & 63))
    while bits == 0:
        word -= 1
        place = ((word - base) << 6) + 63
        bits = words[word]
    bits |= bits >> np.uint64(1)
    bits |= bits >> np.uint64(2)
    bits |= bits >> np.uint64(4)
    bits |= bits >> np.uint64(8)
    bits |= bits >> np.uint64(16)
    bits |= bits >> np.uint64(32)
    highest = bits - (bits >> np.uint64(1))
    return at - place + 63 - _PLACES[(highest * np.uint64(_DE_BRUIJN)) >> np.uint64(58)]


@nb.njit(cache=True, inline="always")
def run_length(
    near_x: UInt64, near_y: UInt64, near_z: UInt64, shape: Int, n: int, i: int, j: int, k: int
) -> int:
    """Cells from a clear cell to the next near one by the straight move n."""
    if n == 12 or n == 14:
        base = (i * shape[1] + j) * ((shape[2] + 63) >> 6)
        cells = _to_next(near_z, base, k) if n == 14 else _to_last(near_z, base, k)
    elif n == 10 or n == 16:
        base = (i * shape[2] + k) * ((shape[1] + 63) >> 6)
        cells = _to_next(near_y, base, j) if n == 16 else _to_last(near_y, base, j)
    else:
        base = (j * shape[2] + k) * ((shape[0] + 63) >> 6)
        cells = _to_next(near_x, base, i) if n == 22 else _to_last(near_x, base, i)
    return cells


@nb.njit(cache=True, inline="always")
def remembered_moves(keys: Int, known: Int, arrived: int, bits: int) -> int:
    """`canonical_moves` by a table.

    Buildings repeat a few hundred neighbourhoods: they are remembered, until three quarters
    of the table are full.
    """
    key = arrived << 27 | bits
    mask = keys.shape[0] - 1
    place = (key * 0x9E3779B1 >> 20) & mask
    while keys[place] != -1 and keys[place] != key:
        place = (place + 1) & mask
    if keys[place] == key:
        moves = known[place]
    else:
        moves = canonical_moves(arrived, bits)
        if known[mask + 1] < 3 * mask // 4:
            known[mask + 1] += 1
            keys[place], known[place] = key, moves
    return moves
