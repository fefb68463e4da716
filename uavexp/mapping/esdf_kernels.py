"""Kernels of the incremental distance transform; `esdf` says what they compute.

Fields are flat, C order with z contiguous, so that a run of neighbouring columns is one
contiguous piece of memory. A list of changed columns is four arrays: index (ascending), old
values, the smallest value that fell, the smallest old value that rose (cap + 1 if none).
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np
import numpy.typing as npt

from uavexp.arrays import Int32, UInt8
from uavexp.field import OCCUPIED

Int16 = npt.NDArray[np.int16]
_MERGE_GAP = 3  # columns: runs closer than this are treated as one


@nb.njit(cache=True)
def _lower(target: Int16, source: Int16, add: int) -> None:
    """Set target = min(target, source + add) along a contiguous run."""
    offset = np.int16(add)
    for k in range(target.shape[0]):
        target[k] = min(np.int16(source[k] + offset), target[k])


@nb.njit(cache=True)
def _any_equal_raised(target: Int16, old: Int16, new: Int16, add: int) -> bool:
    """Whether some raised entry may have been the minimum of `target`."""
    offset = np.int16(add)
    hit = np.int16(0)
    for k in range(target.shape[0]):
        hit = np.int16(hit | ((new[k] > old[k]) & (target[k] == np.int16(old[k] + offset))))
    return bool(hit)


@nb.njit(cache=True)
def _largest(run: Int16) -> int:
    largest = np.int16(0)
    for k in range(run.shape[0]):
        largest = max(largest, run[k])
    return int(largest)


@nb.njit(cache=True)
def _compare(new: Int16, old: Int16, cap: int) -> tuple[int, int, int]:
    """Smallest value that fell and smallest old value that rose (cap + 1 when none did), largest value."""
    fell = np.int16(cap + 1)
    rose = np.int16(cap + 1)
    none = np.int16(cap + 1)
    largest = np.int16(0)
    for k in range(new.shape[0]):
        fell = min(fell, new[k] if new[k] < old[k] else none)
        rose = min(rose, old[k] if new[k] > old[k] else none)
        largest = max(largest, new[k])
    return int(fell), int(rose), int(largest)


@nb.njit(cache=True)
def _scan_column(state: UInt8, to_occupied: bool, cap: int, out: Int16) -> None:
    """Squared distance along one column to its nearest source, capped."""
    count = out.shape[0]
    distance = cap
    for k in range(count):
        distance = 0 if (state[k] == OCCUPIED) == to_occupied else min(distance + 1, cap)
        out[k] = min(distance * distance, cap)
    distance = cap
    for k in range(count - 1, -1, -1):
        distance = 0 if out[k] == 0 else min(distance + 1, cap)
        out[k] = min(distance * distance, out[k])


@nb.njit(cache=True)
def _runs(columns: Int32, wanted: UInt8, first: int, last: int, runs: Int32) -> int:
    """Group the wanted ones of sorted columns[first:last] into runs; rows of (begin, end)."""
    count = 0
    for n in range(first, last):
        if wanted[n] == 0:
            continue
        column = columns[n]
        if count > 0 and column - runs[count - 1, 1] <= _MERGE_GAP:
            runs[count - 1, 1] = column + 1
        else:
            runs[count, 0] = column
            runs[count, 1] = column + 1
            count += 1
    return count


@nb.njit(cache=True)
def _recompute_run(
    target: Int16, source: Int16, begin: int, end: int, stride: int, limit: int, length: int
) -> int:
    """Compute flat target[begin:end] anew as the min over source shifted by whole strides.

    The shift keeps inside the flat interval [limit, limit + length). Returns the largest result.
    """
    out = target[begin:end]
    out[:] = source[begin:end]
    largest = _largest(out)
    offset = 1
    while offset * offset < largest:
        for sign in (-1, 1):
            shift = sign * offset * stride
            low = max(begin + shift, limit)
            high = min(end + shift, limit + length)
            if low < high:
                _lower(target[low - shift : high - shift], source[low:high], offset * offset)
        if offset & (offset - 1) == 0:  # looking at 1, 2, 4, 8 ... is enough to stop early
            largest = _largest(out)
        offset += 1
    return int(_largest(out))


@nb.njit(cache=True)
def carry_z(
    state: UInt8, flagged: UInt8, box: Int32, shape: tuple[int, int, int], to_occupied: bool, cap: int,
    g: Int16, columns: Int32, old: Int16, fell: Int32, rose: Int32,
) -> int:  # fmt: skip
    """Rescan flagged columns; list those that changed, in ascending order, with their old values."""
    _, ny, nz = shape
    count = 0
    fresh = np.empty(nz, np.int16)
    for x in range(box[0], box[1]):
        for y in range(box[2], box[3]):
            column = x * ny + y
            if flagged[column] == 0:
                continue
            here = g[column * nz : (column + 1) * nz]
            _scan_column(state[column * nz : (column + 1) * nz], to_occupied, cap, fresh)
            fell[count], rose[count], _ = _compare(fresh, here, cap)
            if fell[count] <= cap or rose[count] <= cap:
                columns[count] = column
                old[count * nz : (count + 1) * nz] = here
                here[:] = fresh
                count += 1
    return count


@nb.njit(cache=True)
def _mark_raised(
    h: Int16, peak: Int16, plane: int, low: int, high: int, source: int, rose: int, was: Int16, new: Int16,
    marked: UInt8,
) -> None:  # fmt: skip
    """Mark the columns of a plane whose minimum may have been a raised entry of the column `source`."""
    nz = was.shape[0]
    for y in range(low, high):
        offset = source - y
        if marked[y] == 0 and offset * offset + rose <= peak[plane + y]:
            here = h[(plane + y) * nz : (plane + y + 1) * nz]
            if _any_equal_raised(here, was, new, offset * offset):
                marked[y] = 1


@nb.njit(cache=True)
def _group(columns: Int32, first: int, count: int, plane: int, ny: int, apart: int) -> int:
    """End of the group of listed columns from `first` on: in one plane, neighbours at most so far apart."""
    last = first + 1
    while last < count and columns[last] < plane + ny and columns[last] - columns[last - 1] <= apart:
        last += 1
    return last


@nb.njit(cache=True)
def carry_y(
    shape: tuple[int, int, int], cap: int, peak: Int16, g: Int16, h: Int16,
    count_in: int, columns_in: Int32, old_in: Int16, fell_in: Int32, rose_in: Int32,
    columns: Int32, old: Int16, fell: Int32, rose: Int32,
) -> int:  # fmt: skip
    """Carry the changed columns of g into h, plane by plane; list the columns of h that changed.

    `peak` holds for each column of h an upper bound, beyond which no offset can matter to it.
    """
    _, ny, nz = shape
    count = 0
    before = np.empty(ny * nz, np.int16)
    marked = np.zeros(ny, np.uint8)
    runs = np.empty((ny, 2), np.int32)
    wanted = (fell_in[:count_in] <= cap).astype(np.uint8)
    rows = np.arange(ny).astype(np.int32)
    widest = int(math.sqrt(cap))
    first = 0
    while first < count_in:  # groups in one plane whose reaches do not meet
        x = columns_in[first] // ny
        plane = x * ny
        last = _group(columns_in, first, count_in, plane, ny, 2 * widest)
        first_y, last_y = columns_in[first] - plane, columns_in[last - 1] - plane
        bound = _largest(peak[plane + max(first_y - widest, 0) : plane + min(last_y + widest + 1, ny)])
        reach = int(math.sqrt(bound))
        low, high = max(first_y - reach, 0), min(last_y + reach + 1, ny)
        before[low * nz : high * nz] = h[(plane + low) * nz : (plane + high) * nz]
        total = _runs(columns_in, wanted, first, last, runs)
        for n in range(total):
            for offset in range(-reach, reach + 1):
                begin = max(runs[n, 0] + offset, plane) * nz
                end = min(runs[n, 1] + offset, plane + ny) * nz
                if begin < end:
                    shift = offset * nz
                    _lower(h[begin:end], g[begin - shift : end - shift], offset * offset)
        raised = False
        for n in range(first, last):
            if rose_in[n] <= cap:
                raised = True
                new = g[columns_in[n] * nz : (columns_in[n] + 1) * nz]
                was = old_in[n * nz : (n + 1) * nz]
                _mark_raised(h, peak, plane, low, high, columns_in[n] - plane, rose_in[n], was, new, marked)
        if raised:
            total = _runs(rows, marked, low, high, runs)
            for n in range(total):
                begin, end = (plane + runs[n, 0]) * nz, (plane + runs[n, 1]) * nz
                _recompute_run(h, g, begin, end, nz, plane * nz, ny * nz)
            marked[low:high] = 0
        for y in range(low, high):
            new = h[(plane + y) * nz : (plane + y + 1) * nz]
            was = before[y * nz : (y + 1) * nz]
            fell[count], rose[count], peak[plane + y] = _compare(new, was, cap)
            if fell[count] <= cap or rose[count] <= cap:
                columns[count] = plane + y
                old[count * nz : (count + 1) * nz] = was
                count += 1
        first = last
    return count


@nb.njit(cache=True)
def carry_x(
    shape: tuple[int, int, int], cap: int, bound: int, h: Int16, f: Int16,
    count_in: int, columns_in: Int32, old_in: Int16, fell_in: Int32, rose_in: Int32,
    marked: UInt8, touched: Int32,
) -> int:  # fmt: skip
    """Carry the changed columns of h into f; widen `touched`, each plane's range of y to look at."""
    nx, ny, nz = shape
    plane = ny * nz
    runs = np.empty((ny, 2), np.int32)
    wanted = (fell_in[:count_in] <= cap).astype(np.uint8)
    raised_low, raised_high = nx, 0
    first = 0
    while first < count_in:
        x = columns_in[first] // ny
        last = first
        lowest = cap
        while last < count_in and columns_in[last] // ny == x:
            lowest = min(lowest, fell_in[last])
            last += 1
        y_first, y_last = columns_in[first] - x * ny, columns_in[last - 1] - x * ny
        total = _runs(columns_in, wanted, first, last, runs)
        reach = int(math.sqrt(bound - lowest)) if bound > lowest else 0
        for other in range(max(x - reach, 0), min(x + reach + 1, nx)):
            if total > 0:
                touched[other, 0] = min(touched[other, 0], y_first)
                touched[other, 1] = max(touched[other, 1], y_last + 1)
            shift = (other - x) * plane
            for n in range(total):
                begin, end = runs[n, 0] * nz, runs[n, 1] * nz
                _lower(f[begin + shift : end + shift], h[begin:end], (other - x) * (other - x))
        first = last
    for n in range(count_in):
        if rose_in[n] > bound:
            continue
        column = columns_in[n]
        x, y = column // ny, column % ny
        new = h[column * nz : (column + 1) * nz]
        was = old_in[n * nz : (n + 1) * nz]
        reach = int(math.sqrt(bound - rose_in[n]))
        for other in range(max(x - reach, 0), min(x + reach + 1, nx)):
            at = other * ny + y
            if marked[at] == 0:
                here = f[at * nz : (at + 1) * nz]
                if _any_equal_raised(here, was, new, (other - x) * (other - x)):
                    marked[at] = 1
                    touched[other, 0] = min(touched[other, 0], y)
                    touched[other, 1] = max(touched[other, 1], y + 1)
                    raised_low, raised_high = min(raised_low, other), max(raised_high, other + 1)
    rows = np.arange(ny).astype(np.int32)
    for x in range(raised_low, raised_high):
        low, high = touched[x, 0], touched[x, 1]
        if low >= high:
            continue
        total = _runs(rows, marked[x * ny : (x + 1) * ny], low, high, runs)
        for n in range(total):
            begin, end = x * plane + runs[n, 0] * nz, x * plane + runs[n, 1] * nz
            bound = max(bound, _recompute_run(f, h, begin, end, plane, 0, nx * plane))
        marked[x * ny + low : x * ny + high] = 0
    return bound
