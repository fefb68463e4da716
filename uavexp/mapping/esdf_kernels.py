"""Kernels of the distance transform by windows; `esdf` says what they compute.

Fields are flat, C order with z contiguous, so that a run of neighbouring columns is one
contiguous piece of memory. Squares are kept less `start`, what they are in an empty map: zeros
begin them, and where nothing is seen they take no memory. Windows (X, 2) are a range of y for
each plane of one x, begin and end; begin >= end: none.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np
import numpy.typing as npt

from uavexp.arrays import Int32, UInt8
from uavexp.field import OCCUPIED

Int16 = npt.NDArray[np.int16]


@nb.njit(cache=True)
def no_windows(shape: tuple[int, int, int]) -> Int32:
    """Windows (X, 2) of planes in which nothing has changed."""
    windows = np.zeros((shape[0], 2), np.int32)
    windows[:, 0] = shape[1]
    return windows


@nb.njit(cache=True, inline="always")
def widen(windows: Int32, x: int, begin: int, end: int) -> None:
    """Let a plane's window hold a range of y, too."""
    windows[x, 0] = min(windows[x, 0], begin)
    windows[x, 1] = max(windows[x, 1], end)


@nb.njit(cache=True)
def _largest(run: Int16) -> int:
    largest = run[0]
    for k in range(run.shape[0]):
        largest = max(largest, run[k])
    return int(largest)


@nb.njit(cache=True)
def _differ(one: Int16, other: Int16) -> bool:
    bits = np.int16(0)
    for k in range(one.shape[0]):
        bits = np.int16(bits | (one[k] ^ other[k]))
    return bool(bits)


@nb.njit(cache=True)
def _lower(target: Int16, source: Int16, add: int) -> None:
    """Set target = min(target, source + add) along a contiguous run."""
    offset = np.int16(add)
    for k in range(target.shape[0]):
        target[k] = min(np.int16(source[k] + offset), target[k])


@nb.njit(cache=True)
def _lower_both(target: Int16, one: Int16, other: Int16, add: int) -> None:
    """Set target = min(target, one + add, other + add)."""
    offset = np.int16(add)
    for k in range(target.shape[0]):
        target[k] = min(np.int16(min(one[k], other[k]) + offset), target[k])


@nb.njit(cache=True)
def _lowest(source: Int16, begin: int, stride: int, low: int, high: int, start: int, out: Int16) -> int:
    """Fill `out` (N,) with the least, over whole n, of source[begin + n stride ...] + n^2; its largest.

    Only what lies in the flat interval [low, high) of `source` counts.
    """
    size = out.shape[0]
    out[:] = source[begin : begin + size]
    largest = _largest(out)
    n = 1
    while n * n < largest + start:
        before, after = source[max(begin - n * stride, low) :], source[begin + n * stride :]
        first = min(max(low - begin + n * stride, 0), size)  # of those with a neighbour before them
        last = max(min(high - begin - n * stride, size), 0)  # one beyond those with one after them
        if first < last:
            _lower(out[:first], after, n * n)
            _lower_both(out[first:last], before, after[first:], n * n)
            _lower(out[last:], before[last - first :], n * n)
        else:
            _lower(out[:last], after, n * n)
            _lower(out[first:], before, n * n)
        if n & (n - 1) == 0:  # looking at 1, 2, 4, 8 ... is enough to stop early
            largest = _largest(out)
        n += 1
    return int(_largest(out))


@nb.njit(cache=True)
def _scan_column(state: UInt8, cap: int, outside: Int16, inside: Int16) -> None:
    """Squared distances along one column, capped: of free voxels to occupied ones, and the reverse."""
    count, other = state.shape[0], -cap  # the nearest voxel of the other kind below, then above
    for k in range(count):
        occupied = state[k] == OCCUPIED
        other = k - 1 if k > 0 and (state[k - 1] == OCCUPIED) != occupied else other
        square = min((k - other) * (k - other), cap)
        outside[k], inside[k] = (0, square) if occupied else (square, 0)
    other = count + cap
    for k in range(count - 2, -1, -1):
        other = k + 1 if (state[k + 1] == OCCUPIED) != (state[k] == OCCUPIED) else other
        square = min((other - k) * (other - k), cap)
        outside[k], inside[k] = min(outside[k], square), min(inside[k], square)


@nb.njit(cache=True)
def _reach(bound: int, cap: int) -> int:
    """How far a change can be felt where no square exceeds `bound`, voxels."""
    return int(math.sqrt(min(bound, cap - 1)))


@nb.njit(cache=True)
def along_z(
    shape: tuple[int, int, int],
    state: UInt8,
    flagged: UInt8,
    box: Int32,
    cap: int,
    outside: Int16,
    inside: Int16,
) -> tuple[Int32, Int32]:
    """Scan flagged columns of a box (x0, x1, y0, y1) anew; windows of what changed outside and inside."""
    _, ny, nz = shape
    out_windows, in_windows = no_windows(shape), no_windows(shape)
    far, near = np.empty(nz, np.int16), np.empty(nz, np.int16)
    for x in range(box[0], box[1]):
        for y in range(box[2], box[3]):
            if flagged[x * ny + y] == 0:
                continue
            column = slice((x * ny + y) * nz, (x * ny + y + 1) * nz)
            _scan_column(state[column], cap, far, near)
            far -= np.int16(cap)
            for fresh, squares, windows in ((far, outside, out_windows), (near, inside, in_windows)):
                if _differ(fresh, squares[column]):
                    squares[column] = fresh
                    widen(windows, x, y, y + 1)
    return out_windows, in_windows


@nb.njit(cache=True)
def along_y(
    shape: tuple[int, int, int], cap: int, start: int, bound: int, g: Int16, h: Int16, changed: Int32
) -> tuple[Int32, int]:
    """Compute h anew where a change of g can be felt; windows of what changed, upper bound of all h."""
    nx, ny, nz = shape
    windows, fresh = no_windows(shape), np.empty(ny * nz, np.int16)
    reach, largest = _reach(bound + start, cap), bound
    for x in range(nx):
        if changed[x, 0] >= changed[x, 1]:
            continue
        low, high = x * ny * nz, (x + 1) * ny * nz
        y0, y1 = max(changed[x, 0] - reach, 0), min(changed[x, 1] + reach, ny)
        out = fresh[: (y1 - y0) * nz]
        largest = max(largest, _lowest(g, low + y0 * nz, nz, low, high, start, out))
        for y in range(y0, y1):
            new, old = out[(y - y0) * nz : (y - y0 + 1) * nz], h[low + y * nz : low + (y + 1) * nz]
            if _differ(new, old):
                old[:] = new
                widen(windows, x, y, y + 1)
    return windows, largest


@nb.njit(cache=True)
def along_x(
    shape: tuple[int, int, int], cap: int, start: int, bound: int, h: Int16, f: Int16, changed: Int32,
    touched: Int32,
) -> int:  # fmt: skip
    """Compute f anew where a change of h can be felt, and widen `touched` by it; upper bound of all f."""
    nx, ny, nz = shape
    plane = ny * nz
    reach, largest = _reach(bound + start, cap), bound
    for x in range(nx):
        y0, y1 = ny, 0
        for other in range(max(x - reach, 0), min(x + reach + 1, nx)):
            y0, y1 = min(y0, changed[other, 0]), max(y1, changed[other, 1])
        if y0 < y1:
            begin, end = x * plane + y0 * nz, x * plane + y1 * nz
            largest = max(largest, _lowest(h, begin, plane, 0, nx * plane, start, f[begin:end]))
            widen(touched, x, y0, y1)
    return largest
