"""A corridor of convex free regions along a path, on the voxels of the distance field.

Each region is grown around a segment of the path: the nearest obstacle voxel not yet cut off is
cut off by the plane square to the way from the segment to it, moved towards the segment by the
clearance asked for; until none is left in a window around the segment (Liu et al. 2017, with the
segment's own metric for their ellipsoid). Therefore

- every point of a region is at least the clearance away from every obstacle in the window, by the
  field's own measure (distance between centres less half a voxel), without interpolation;
- a region contains its segment whenever that keeps the clearance, because the plane through
  the nearest point of a convex set does not cut it; so neighbouring regions share a point.

Where a segment itself comes closer (a start below the limit), the plane stops at the segment.
Half-spaces, not boxes: boxes tied to the axes cut a slanted passage into slivers.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Float, Float32, Int, UInt8
from uavexp.field import DistanceField

REACH_M = 1.0  # of the window beyond the segment
_MOST_FACES = 100  # of a region; each cuts off the nearest obstacle left
_SURFACE_VOXELS = 0.6  # an obstacle's voxel less deep than this is on its surface
_ROUNDING_M = 1e-6


class Corridor(NamedTuple):
    """Regions {x: normal x <= offset}; faces of region m are rows first[m] to first[m + 1]."""

    normal: Float  # (F, 3) unit, outward
    offset: Float  # (F,) m
    first: Int  # (M+1,)
    whole: bool  # whether every obstacle seen was cut off


def make_corridor(
    field: DistanceField, points_m: Float, bounds_m: Float, clearance_m: float, known_only: bool
) -> Corridor:
    """One region around each segment of a polyline.

    Args:
        field: the map.
        points_m: (M+1, 3).
        bounds_m: (2, 3) box that no region leaves, unless its segment does.
        clearance_m: of every point of a region from mapped obstacles.
        known_only: whether unknown voxels are closed, too (they alone, with no clearance).
    """
    grid = (field.distance, field.state, field.origin_m, field.voxel_size_m)
    normal, offset, first, whole = _grow(*grid, points_m, bounds_m, clearance_m, known_only)
    return Corridor(normal, offset, first, whole)


@nb.njit(cache=True)
def _borders_known(state: UInt8, i: int, j: int, k: int) -> bool:
    """Whether a voxel shares a face with one that was seen."""
    for axis in range(3):
        for side in (-1, 1):
            a = i + side if axis == 0 else i
            b = j + side if axis == 1 else j
            c = k + side if axis == 2 else k
            inside = 0 <= a < state.shape[0] and 0 <= b < state.shape[1] and 0 <= c < state.shape[2]
            if inside and state[a, b, c] != 0:
                return True
    return False


@nb.njit(cache=True)
def _collect(
    distance: Float32,
    state: UInt8,
    origin_m: Float,
    voxel_m: float,
    box: Float,
    clearance_m: float,
    known_only: bool,
) -> tuple[Float, Float]:
    """Centres (K, 3) of obstacles' surface voxels in a box (2, 3), and the distance (K,) to keep from each.

    Unknown voxels have distance 0: nothing but the voxel itself is closed.
    """
    low, high = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    for axis in range(3):
        last = distance.shape[axis] - 1
        low[axis] = min(max(int(np.floor((box[0, axis] - origin_m[axis]) / voxel_m)), 0), last)
        high[axis] = min(max(int(np.floor((box[1, axis] - origin_m[axis]) / voxel_m)), 0), last)
    room, count = 256, 0
    centre, apart = np.empty((room, 3)), np.empty(room)
    for i in range(low[0], high[0] + 1):
        for j in range(low[1], high[1] + 1):
            for k in range(low[2], high[2] + 1):
                # half a voxel below zero: an obstacle's voxel with a face to free space
                surface = -_SURFACE_VOXELS * voxel_m < distance[i, j, k] < 0.0
                unknown = known_only and state[i, j, k] == 0
                if not (surface or (unknown and _borders_known(state, i, j, k))):
                    continue
                if count == room:
                    room *= 2
                    wider, longer = np.empty((room, 3)), np.empty(room)
                    wider[:count], longer[:count] = centre, apart
                    centre, apart = wider, longer
                centre[count, 0] = origin_m[0] + (i + 0.5) * voxel_m
                centre[count, 1] = origin_m[1] + (j + 0.5) * voxel_m
                centre[count, 2] = origin_m[2] + (k + 0.5) * voxel_m
                apart[count] = clearance_m + 0.5 * voxel_m if surface else 0.0
                count += 1
    return centre[:count], apart[:count]


@nb.njit(cache=True)
def _nearest_on_segment(a: Float, b: Float, point: Float, nearest: Float) -> float:
    """Write the point of segment ab nearest to `point` to `nearest`; return the distance, m."""
    along, length2 = 0.0, 0.0
    for axis in range(3):
        along += (point[axis] - a[axis]) * (b[axis] - a[axis])
        length2 += (b[axis] - a[axis]) ** 2
    share = min(max(along / length2, 0.0), 1.0) if length2 > 0.0 else 0.0
    square = 0.0
    for axis in range(3):
        nearest[axis] = a[axis] + share * (b[axis] - a[axis])
        square += (point[axis] - nearest[axis]) ** 2
    return float(np.sqrt(square))


@nb.njit(cache=True, inline="always")
def _extent(normal: Float, apart_m: float, voxel_m: float) -> float:
    """How far before an obstacle's centre a plane with this normal must lie."""
    if apart_m > 0.0:
        return apart_m
    return 0.5 * voxel_m * float(abs(normal[0]) + abs(normal[1]) + abs(normal[2]))


@nb.njit(cache=True)
def _cut_off(
    a: Float, b: Float, centre: Float, apart: Float, voxel_m: float, normal: Float, offset: Float, faces: int
) -> tuple[int, bool]:
    """Write, from row `faces` on, the planes that cut obstacles off segment ab.

    Returns:
        The next row, and whether every obstacle is cut off.
    """
    nearest, away = np.empty(3), np.empty(3)
    left = centre.shape[0]
    far = np.empty(left)
    for n in range(left):
        reach = _nearest_on_segment(a, b, centre[n], nearest)
        for axis in range(3):
            away[axis] = (centre[n, axis] - nearest[axis]) / max(reach, 1e-9)
        far[n] = reach - _extent(away, apart[n], voxel_m)
    for _ in range(_MOST_FACES):
        if left == 0:
            break
        best = 0
        for n in range(1, left):
            if far[n] < far[best]:
                best = n
        reach = _nearest_on_segment(a, b, centre[best], nearest)
        if reach < 1e-9:  # the segment meets an obstacle's centre: there is no free side
            break
        spare = max(far[best] - _ROUNDING_M, 0.0)
        at = 0.0
        for axis in range(3):
            normal[faces, axis] = (centre[best, axis] - nearest[axis]) / reach
            at += normal[faces, axis] * nearest[axis]
        offset[faces] = at + spare
        kept = 0
        for n in range(left):  # keep those that the plane does not keep at their clearance
            beyond = -_extent(normal[faces], apart[n], voxel_m) - offset[faces] - min(far[best], 0.0)
            for axis in range(3):
                beyond += normal[faces, axis] * centre[n, axis]
            if beyond < -_ROUNDING_M and n != best:
                centre[kept], apart[kept], far[kept] = centre[n], apart[n], far[n]
                kept += 1
        left = kept
        faces += 1
    return faces, left == 0


@nb.njit(cache=True)
def _grow(
    distance: Float32,
    state: UInt8,
    origin_m: Float,
    voxel_m: float,
    points_m: Float,
    bounds_m: Float,
    clearance_m: float,
    known_only: bool,
) -> tuple[Float, Float, Int, bool]:
    """Faces of all regions: `Corridor`'s arrays."""
    segments = points_m.shape[0] - 1
    normal, offset = np.empty((segments * (_MOST_FACES + 6), 3)), np.empty(segments * (_MOST_FACES + 6))
    first = np.zeros(segments + 1, dtype=np.int64)
    box = np.empty((2, 3))
    faces, whole = 0, True
    for m in range(segments):
        a, b = points_m[m], points_m[m + 1]
        for axis in range(3):
            low, high = min(a[axis], b[axis]), max(a[axis], b[axis])
            box[0, axis] = min(max(low - REACH_M, bounds_m[0, axis]), low)
            box[1, axis] = max(min(high + REACH_M, bounds_m[1, axis]), high)
            for side in range(2):
                normal[faces] = 0.0
                normal[faces, axis] = 2.0 * side - 1.0
                offset[faces] = normal[faces, axis] * box[side, axis]
                faces += 1
            box[0, axis] -= clearance_m + voxel_m  # an obstacle outside keeps the curve off the inside
            box[1, axis] += clearance_m + voxel_m
        centre, apart = _collect(distance, state, origin_m, voxel_m, box, clearance_m, known_only)
        faces, cut = _cut_off(a, b, centre, apart, voxel_m, normal, offset, faces)
        whole = whole and cut
        first[m + 1] = faces
    return normal[:faces].copy(), offset[:faces].copy(), first, whole
