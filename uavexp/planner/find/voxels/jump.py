"""Voxels as bits: neighbourhoods, and straight runs to where a canonical path may turn.

A free cell is clear when its 26 neighbours are free, else near (an obstacle). A straight
canonical path goes on through clear cells and along flat walls, where it has no choice; where
that ends is known before any search: for each of the six directions a bit says where a path
that arrives so must stop, and another whether any move is left there (jump points, Harabor and
Grastien 2014, in space). Stops lie in memory along their direction and are found 64 cells at a
time. What a search reads of 24 million voxels is 3 MB an array.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
import numpy.typing as npt

from uavexp.arrays import Bool, Int, UInt8
from uavexp.planner.find.voxels.moves import canonical_moves

UInt64 = npt.NDArray[np.uint64]
_DE_BRUIJN = 0x03F79D71B4CB0A89  # tells the 64 powers of two apart by their product's upper six bits
_TABLE = 1 << 16  # places for remembered neighbourhoods
_STRAIGHT = np.array([22, 4, 16, 10, 14, 12])  # +x -x +y -y +z -z
_SIDE = np.array([_STRAIGHT.tolist().index(n) if n in _STRAIGHT else -1 for n in range(27)])
_ALL_SIDES = 31  # stands for an arrival in the table of neighbourhoods


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
    near: UInt64  # (X Y words,) flat: bit k of a line along z is set where the cell is near
    stops: UInt64  # of six directions in turn, lines along them: word of stops, word of live ones
    first: Int  # (6,) where the words of each direction begin
    keys: Int  # (_TABLE,) remembered neighbourhoods with the move of arrival, -1 where none
    known: Int  # (_TABLE + 1,) their canonical moves; the last counts them


@nb.njit(cache=True)
def survey(free: Bool) -> Terrain:
    """Make free cells (X, Y, Z) ready for searches, padded by one on every side."""
    nx, ny, nz = free.shape
    bits = np.zeros((nx + 2, ny + 2, (nz + 9) // 8 + 1), dtype=np.uint8)
    near = np.zeros((nx + 2, ny + 2, (nz + 65) // 64), dtype=np.uint64)
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
                    near[i, j, (k + 1) >> 6] |= one << np.uint64((k + 1) & 63)
    shape = np.array((nx + 2, ny + 2, nz + 2))
    keys, known = np.full(_TABLE, -1, dtype=np.int64), np.zeros(_TABLE + 1, dtype=np.int64)
    stops, first = _stops(bits.ravel(), near, shape, keys, known)
    return Terrain(shape, bits.ravel(), near.ravel(), stops, first, keys, known)


@nb.njit(cache=True)
def _stops(free: UInt8, near: UInt64, shape: Int, keys: Int, known: Int) -> tuple[UInt64, Int]:
    """Stops and live stops of the six directions, and where each direction's words begin."""
    nx, ny, nz = shape[0], shape[1], shape[2]
    words = np.array((ny * nz * ((nx + 63) >> 6), nx * nz * ((ny + 63) >> 6), nx * ny * ((nz + 63) >> 6)))
    first = np.zeros(6, dtype=np.int64)
    for side in range(1, 6):
        first[side] = first[side - 1] + 2 * words[(side - 1) // 2]
    stops = np.zeros(first[5] + 2 * words[2], dtype=np.uint64)
    one = np.uint64(1)
    for i in range(1, nx - 1):
        for j in range(1, ny - 1):
            for k in range(1, nz - 1):
                if near[i, j, k >> 6] >> np.uint64(k & 63) & one == 0:
                    continue
                ends = _ends(keys, known, neighbourhood(free, shape, i, j, k))
                for side in range(6):
                    if not ends >> (2 * side) & 1:
                        continue
                    line, at = _line(shape, side, i, j, k)
                    word = first[side] + 2 * (line + (at >> 6))
                    stops[word] |= one << np.uint64(at & 63)
                    stops[word + 1] |= np.uint64(ends >> (2 * side + 1) & 1) << np.uint64(at & 63)
    return stops, first


@nb.njit(cache=True)
def _ends(keys: Int, known: Int, bits: int) -> int:
    """Two bits for each straight direction: a path that arrives so must stop here; and can go on."""
    key = _ALL_SIDES << 27 | bits
    mask = keys.shape[0] - 1
    place = (key * 0x9E3779B1 >> 20) & mask
    while keys[place] != -1 and keys[place] != key:
        place = (place + 1) & mask
    if keys[place] == key:
        return int(known[place])
    ends = 0
    for side in range(6):
        moves = canonical_moves(_STRAIGHT[side], bits)
        ends |= (moves != 1 << _STRAIGHT[side]) << (2 * side) | (moves != 0) << (2 * side + 1)
    if known[mask + 1] < mask // 2:
        known[mask + 1] += 1
        keys[place], known[place] = key, ends
    return int(ends)


@nb.njit(cache=True, inline="always")
def _line(shape: Int, side: int, i: int, j: int, k: int) -> tuple[int, int]:
    """First word of the line along a direction through a cell, and the cell's place in it."""
    if side < 2:
        line, at = (j * shape[2] + k) * ((shape[0] + 63) >> 6), i
    elif side < 4:
        line, at = (i * shape[2] + k) * ((shape[1] + 63) >> 6), j
    else:
        line, at = (i * shape[1] + j) * ((shape[2] + 63) >> 6), k
    return line, at


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
def is_near(near: UInt64, shape: Int, i: int, j: int, k: int) -> bool:
    """Whether a free cell has a neighbour that is not."""
    word = (i * shape[1] + j) * ((shape[2] + 63) >> 6) + (k >> 6)
    return bool(near[word] >> np.uint64(k & 63) & np.uint64(1) != 0)


@nb.njit(cache=True, inline="always")
def run_length(stops: UInt64, first: Int, shape: Int, n: int, i: int, j: int, k: int) -> tuple[int, bool]:
    """Cells from a free cell to the next stop by the straight move n, and whether a path goes on there.

    The move itself must be open.
    """
    side = _SIDE[n]
    line, at = _line(shape, side, i, j, k)
    begin = first[side] + 2 * line
    if side % 2 == 0:
        place = at + 1
        word = begin + 2 * (place >> 6)
        bits = stops[word] >> np.uint64(place & 63) << np.uint64(place & 63)
        while bits == 0:
            word += 2
            bits = stops[word]
        one_bit = bits & (~bits + np.uint64(1))
    else:
        place = at - 1
        word = begin + 2 * (place >> 6)
        bits = stops[word] << np.uint64(63 - (place & 63)) >> np.uint64(63 - (place & 63))
        while bits == 0:
            word -= 2
            bits = stops[word]
        bits |= bits >> np.uint64(1)
        bits |= bits >> np.uint64(2)
        bits |= bits >> np.uint64(4)
        bits |= bits >> np.uint64(8)
        bits |= bits >> np.uint64(16)
        bits |= bits >> np.uint64(32)
        one_bit = bits - (bits >> np.uint64(1))
    stop = ((word - begin) >> 1 << 6) + _PLACES[(one_bit * np.uint64(_DE_BRUIJN)) >> np.uint64(58)]
    return abs(stop - at), stops[word + 1] & one_bit != 0


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
    return int(moves)
