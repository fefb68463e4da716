"""Straight runs through a voxel grid: whole stretches of open space in a few instructions.

From a `CLEAR` cell a straight canonical path has one way to go, on; the first cell where that
may change is `NEAR` an obstacle. One bit for every cell, set where it is `NEAR`, lies in
memory along each axis, so that the next one is found 64 cells at a time.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
import numpy.typing as npt

from uavexp.planner.voxel.moves import canonical_moves, neighbourhood
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
    """A padded voxel grid as the searches read it."""

    state: UInt8  # (X Y Z,) flat: BLOCKED, NEAR or CLEAR; the border is BLOCKED
    shape: Int  # (3,)
    near_x: UInt64  # (Y Z words,) flat: bit i of a line is set where the cell is NEAR
    near_y: UInt64  # (X Z words,)
    near_z: UInt64  # (X Y words,)
    keys: Int  # (_TABLE,) remembered neighbourhoods with the move of arrival, -1 where none
    known: Int  # (_TABLE + 1,) their canonical moves; the last counts them


@nb.njit(cache=True)
def survey(free: Bool) -> Terrain:
    """Make free cells (X, Y, Z) ready for searches, padded by one on every side."""
    nx, ny, nz = free.shape
    state = np.zeros((nx + 2, ny + 2, nz + 2), dtype=np.uint8)
    near_x = np.zeros((ny + 2, nz + 2, (nx + 65) // 64), dtype=np.uint64)
    near_y = np.zeros((nx + 2, nz + 2, (ny + 65) // 64), dtype=np.uint64)
    near_z = np.zeros((nx + 2, ny + 2, (nz + 65) // 64), dtype=np.uint64)
    for i in range(nx):
        for j in range(ny):
            source, target = free[i, j], state[i + 1, j + 1]
            for k in range(nz):
                target[k + 1] = source[k]
    line = np.empty(nz + 2, dtype=np.uint8)
    one = np.uint64(1)
    for i in range(1, nx + 1):
        for j in range(1, ny + 1):
            line[:] = 1
            for di in range(-1, 2):
                for dj in range(-1, 2):
                    other = state[i + di, j + dj]
                    for k in range(nz + 2):
                        line[k] &= other[k]
            here = state[i, j]
            for k in range(1, nz + 1):
                if here[k] != 0 and line[k - 1] & line[k] & line[k + 1] == 0:
                    near_x[j, k, i >> 6] |= one << np.uint64(i & 63)
                    near_y[i, k, j >> 6] |= one << np.uint64(j & 63)
                    near_z[i, j, k >> 6] |= one << np.uint64(k & 63)
    flat = state.ravel()
    shape = np.array(state.shape)
    for i in range(1, nx + 1):
        for j in range(1, ny + 1):
            base = (i * shape[1] + j) * shape[2]
            for k in range(1, nz + 1):
                if flat[base + k] != 0 and not near_z[i, j, k >> 6] >> np.uint64(k & 63) & one:
                    flat[base + k] = 3
    keys = np.full(_TABLE, -1, dtype=np.int64)
    known = np.zeros(_TABLE + 1, dtype=np.int64)
    return Terrain(flat, shape, near_x.ravel(), near_y.ravel(), near_z.ravel(), keys, known)


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
    """Cells from a `CLEAR` cell to the next `NEAR` one by the straight move n."""
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
def moves_from(state: UInt8, shape: Int, keys: Int, known: Int, cell: int, arrived: int) -> int:
    """Canonical moves from a cell reached by a move, as bits.

    Buildings repeat a few hundred neighbourhoods: they are remembered, until three quarters
    of the table are full.
    """
    bits = 0x7FFFFFF
    if state[cell] != 3:
        bits = neighbourhood(state, cell, shape[2], shape[1] * shape[2])
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
