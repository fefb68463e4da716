"""Exact truncated signed distance transform of a dense voxel grid, kept up to date by windows.

The squared distance to the nearest source voxel separates by axis:

    along z   g(x, y, z) = min over sources (x, y, z') of (z - z')^2
    along y   h(x, y, z) = min over y' of g(x, y', z) + (y - y')^2
    along x   f(x, y, z) = min over x' of h(x', y, z) + (x - x')^2

(Saito and Toriwaki 1994), all in integers and cut off at `cap`, the first square whose
distance reaches the truncation. The three stages are kept, and an update computes each of
them anew within the windows in which a change of its input can be felt. That is exact:

    h(y) changes only if some g(y') does that was its minimum, g(y') + (y - y')^2 = h(y) before,
    or that falls below it, g(y') + (y - y')^2 < h(y) before.

Either way (y - y')^2 <= h(y) as it was, and < `cap`. So no change is felt beyond the root of
an upper bound of h, and the same holds of f. Towards occupied voxels the bound is `cap`;
towards others, inside of obstacles, it is the largest square so far.

Speed comes from memory layout rather than from cleverness: z is contiguous, so one min over
a run of neighbouring columns is one long loop over 16-bit integers.

Two such transforms, towards occupied and towards other voxels, make the signed field.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from uavexp.arrays import Bool, Float32, Int32, UInt8
from uavexp.errors import require
from uavexp.mapping.esdf_changes import emit, flag_columns, list_changed, mark_seen
from uavexp.mapping.esdf_kernels import along_x, along_y, along_z, no_windows
from uavexp.memory import blank
from uavexp.types import MapUpdate

_LARGEST_CAP = 16_000  # sums of two capped squares must fit 16 bits


def distance_table(voxel_size_m: float, max_distance_m: float) -> tuple[int, Float32]:
    """Distances of the signed squared voxel distances -cap .. cap.

    Args:
        voxel_size_m: edge of a voxel, m.
        max_distance_m: truncation, m.

    Returns:
        cap: the smallest square at or beyond the truncation.
        table: (2 cap + 1,) signed distance, m, of square s at index s + cap; ±`max_distance_m` at the ends.
    """
    reach = max_distance_m / voxel_size_m + 0.5
    require(
        reach * reach < _LARGEST_CAP,
        f"max_distance_m must be <= {(math.sqrt(_LARGEST_CAP) - 1) * voxel_size_m:.3g} m "
        f"at voxel_size_m {voxel_size_m}, got {max_distance_m}",
    )
    cap = math.ceil(reach * reach - 1e-9)
    outside = np.minimum((np.sqrt(np.arange(cap + 1)) - 0.5) * voxel_size_m, max_distance_m)
    outside[cap] = max_distance_m
    return cap, np.concatenate([-outside[:0:-1], outside]).astype(np.float32)


class _Stages:
    """The three stages of one transform, towards occupied or towards other voxels."""

    def __init__(self, shape: tuple[int, int, int], cap: int, start: int) -> None:
        """Begin with the square `start` everywhere; the arrays hold what it is more or less than that."""
        size = math.prod(shape)
        self.shape, self.cap, self.start = shape, cap, start
        self.along_z, self.along_y, self.along_x = (blank(size, np.int16) for _ in range(3))  # flat
        self._bound_y = self._bound_x = 0  # nothing in the latter two exceeds these

    def update(self, changed: Int32, touched: Int32) -> None:
        """Carry on what has changed along z in windows (X, 2), and widen `touched`."""
        changed, self._bound_y = along_y(
            self.shape, self.cap, self.start, self._bound_y, self.along_z, self.along_y, changed
        )
        self._bound_x = along_x(
            self.shape, self.cap, self.start, self._bound_x, self.along_y, self.along_x, changed, touched
        )


class SignedDistance:
    """The signed field of one grid: `distance` follows `state` at every `update`."""

    def __init__(self, shape: tuple[int, int, int], voxel_size_m: float, max_distance_m: float) -> None:
        """Begin with nothing occupied.

        Args:
            shape: voxels along x, y, z.
            voxel_size_m: edge of a voxel, m.
            max_distance_m: truncation, m.
        """
        nx, ny, nz = shape
        size = nx * ny * nz
        self.shape = shape
        self.max_distance_m = max_distance_m
        self.cap, self._table = distance_table(voxel_size_m, max_distance_m)
        self.distance: Float32 = np.full(shape, max_distance_m, np.float32)
        self._outside = _Stages(shape, self.cap, self.cap)
        self._inside = _Stages(shape, self.cap, 0)
        self._published = blank(size, np.int16)  # outside less inside, as the stages hold them
        self._seen = blank(size, np.uint8)
        self._flagged = np.zeros(nx * ny, np.uint8)
        self._touched = no_windows(shape)
        self._begins, self._ends = np.empty(nx * ny, np.int32), np.empty(nx * ny, np.int32)

    def update(self, time_s: float, state: UInt8, flipped: Int32, first_seen: Int32) -> MapUpdate:
        """Bring `distance` up to date with `state`.

        Args:
            time_s: trial time, passed on to the log.
            state: (X, Y, Z) UNKNOWN, FREE or OCCUPIED.
            flipped: (F,) flat indices of at least every voxel that became or ceased to be
                occupied since the last update; any order, repeats allowed.
            first_seen: (S,) flat indices of voxels observed for the first time since then.

        Returns:
            the change log, in ascending voxel order.
        """
        if flipped.size:
            box = np.array([self.shape[0], 0, self.shape[1], 0], np.int32)
            flag_columns(self.shape, flipped, self._flagged, box)
            outside, inside = along_z(
                self.shape, state.reshape(-1), self._flagged, box, self.cap, self._outside.along_z,
                self._inside.along_z,
            )  # fmt: skip
            self._outside.update(outside, self._touched)
            self._inside.update(inside, self._touched)
            flags = self._flagged.reshape(self.shape[:2])
            flags[box[0] : box[1], box[2] : box[3]] = 0
        if first_seen.size:
            mark_seen(self.shape, first_seen, self._seen, self._touched)
        parts, total = list_changed(
            self.shape, self._touched, self._outside.along_x, self._inside.along_x, self._published,
            self._seen, self._begins, self._ends,
        )  # fmt: skip
        kinds = (np.int32, np.float32, np.float32, np.uint8, np.uint8)
        log: tuple[Any, ...] = tuple(np.empty(total + 1, kind) for kind in kinds)
        emit(
            self._begins[:parts], self._ends[:parts], self._outside.along_x, self._inside.along_x,
            self._published, self._seen, self._table, 2 * self.cap, self.max_distance_m,
            self.distance.reshape(-1), *log,
        )  # fmt: skip
        voxel, old, new, fresh, occupied = (array[:total] for array in log)
        return MapUpdate(
            time_s=time_s,
            voxel=voxel,
            old_distance_m=old,
            new_distance_m=new,
            first_seen=_as_bool(fresh),
            occupied=_as_bool(occupied),
        )


def _as_bool(array: UInt8) -> Bool:
    return array.view(np.bool_)
