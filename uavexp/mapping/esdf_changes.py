"""Kernels of the ESDF's change log: what is looked at, what has changed, and its publication."""

from __future__ import annotations

import numba as nb
import numpy as np

from uavexp.arrays import Float32, Int32, UInt8
from uavexp.mapping.esdf_kernels import Int16, widen


@nb.njit(cache=True)
def list_changed(
    shape: tuple[int, int, int], touched: Int32, outside: Int16, inside: Int16, published: Int16,
    seen: UInt8, begins: Int32, ends: Int32,
) -> tuple[int, int]:  # fmt: skip
    """List, ascending, the part of each touched column that holds its changes; count parts and changes."""
    nx, ny, nz = shape
    count, total = 0, 0
    for x in range(nx):
        for y in range(touched[x, 0], touched[x, 1]):
            begin = (x * ny + y) * nz
            far, near = outside[begin : begin + nz], inside[begin : begin + nz]
            was, fresh = published[begin : begin + nz], seen[begin : begin + nz]
            changes, low, high = np.int16(0), np.int16(nz), np.int16(0)
            for k in range(nz):
                differs = (np.int16(far[k] - near[k]) != was[k]) | (fresh[k] != 0)
                changes = np.int16(changes + differs)
                low = min(low, np.int16(k) if differs else np.int16(nz))
                high = max(high, np.int16(k + 1) if differs else np.int16(0))
            if changes > 0:
                begins[count] = begin + low
                ends[count] = begin + high
                count += 1
                total += int(changes)
        touched[x, 0] = ny
        touched[x, 1] = 0
    return count, total


@nb.njit(cache=True)
def emit(
    begins: Int32, ends: Int32, outside: Int16, inside: Int16, published: Int16, seen: UInt8,
    table: Float32, empty: int, max_distance_m: float, distance: Float32,
    voxel: Int32, old: Float32, new: Float32, first_seen: UInt8, occupied: UInt8,
) -> None:  # fmt: skip
    """Publish the distances of the listed parts and write the change log (with one spare row).

    Row `empty` of the table is the distance in an empty map.
    """
    beyond = np.float32(max_distance_m)
    count = np.uint64(0)  # unsigned: numba then leaves out the test for negative indices
    for n in range(begins.shape[0]):
        begin, end = begins[n], ends[n]
        far, near = outside[begin:end], inside[begin:end]
        was, fresh, metres = published[begin:end], seen[begin:end], distance[begin:end]
        for k in range(end - begin):  # every row is written, and kept when it changed: no branches
            value = np.int16(far[k] - near[k])
            after = table[np.uint64(value + empty)]
            voxel[count] = begin + k
            old[count] = beyond if fresh[k] else metres[k]
            new[count] = after
            first_seen[count] = fresh[k]
            occupied[count] = near[k] > 0
            count += np.uint64((value != was[k]) | (fresh[k] != 0))
            metres[k] = after
        for k in range(end - begin):
            was[k] = np.int16(far[k] - near[k])
        fresh[:] = 0


@nb.njit(cache=True)
def flag_columns(shape: tuple[int, int, int], voxels: Int32, flagged: UInt8, box: Int32) -> None:
    """Flag the columns of flat voxels and widen their bounding box (x0, x1, y0, y1)."""
    _, ny, nz = shape
    for n in range(voxels.shape[0]):
        column = voxels[n] // nz
        x, y = column // ny, column % ny
        flagged[column] = 1
        box[0], box[1] = min(box[0], x), max(box[1], x + 1)
        box[2], box[3] = min(box[2], y), max(box[3], y + 1)


@nb.njit(cache=True)
def mark_seen(shape: tuple[int, int, int], voxels: Int32, seen: UInt8, touched: Int32) -> None:
    """Mark voxels first seen and have their columns looked at."""
    _, ny, nz = shape
    for n in range(voxels.shape[0]):
        column = voxels[n] // nz
        x, y = column // ny, column % ny
        seen[voxels[n]] = 1
        widen(touched, x, y, y + 1)
