"""The signed distance field: what every role asks of a map, in batches."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numba as nb
import numpy as np

from uavexp.arrays import Bool, Float, Float32, Int32, UInt8

UNKNOWN, FREE, OCCUPIED = 0, 1, 2  # values of `DistanceField.state`
TILE = 8  # columns along a tile's edge in `DistanceField.changed`


@nb.njit(cache=True, inline="always")
def _cell(shape: int, coordinate: float) -> tuple[int, float]:
    """Lower voxel and fraction along one axis, clamped to the grid of voxel centres."""
    if coordinate <= 0.0:
        return 0, 0.0
    if coordinate >= shape - 1:
        return max(shape - 2, 0), 1.0 if shape > 1 else 0.0
    lower = int(coordinate)
    return lower, coordinate - lower


@nb.njit(cache=True, inline="always")
def value_at(distance: Float32, origin_m: Float, voxel_size_m: float, x: float, y: float, z: float) -> float:
    """Trilinear value at one point, clamped to the edge outside the grid."""
    nx, ny, nz = distance.shape
    i, fx = _cell(nx, (x - origin_m[0]) / voxel_size_m - 0.5)
    j, fy = _cell(ny, (y - origin_m[1]) / voxel_size_m - 0.5)
    k, fz = _cell(nz, (z - origin_m[2]) / voxel_size_m - 0.5)
    i1, j1, k1 = min(i + 1, nx - 1), min(j + 1, ny - 1), min(k + 1, nz - 1)
    d000, d001 = distance[i, j, k], distance[i, j, k1]
    d010, d011 = distance[i, j1, k], distance[i, j1, k1]
    d00, d01 = d000 + (distance[i1, j, k] - d000) * fx, d001 + (distance[i1, j, k1] - d001) * fx
    d10, d11 = d010 + (distance[i1, j1, k] - d010) * fx, d011 + (distance[i1, j1, k1] - d011) * fx
    d0, d1 = d00 + (d10 - d00) * fy, d01 + (d11 - d01) * fy
    return float(d0 + (d1 - d0) * fz)


@nb.njit(cache=True)
def interpolate(distance: Float32, origin_m: Float, voxel_size_m: float, points_m: Float) -> Float:
    """Trilinear value at points (N, 3) -> (N,)."""
    value = np.empty(points_m.shape[0])
    for n in range(points_m.shape[0]):
        value[n] = value_at(distance, origin_m, voxel_size_m, points_m[n, 0], points_m[n, 1], points_m[n, 2])
    return value


@nb.njit(cache=True)
def value_and_gradient(
    distance: Float32, origin_m: Float, voxel_size_m: float, points_m: Float
) -> tuple[Float, Float]:
    """Trilinear value (N,) and its exact gradient (N, 3) at points (N, 3).

    Outside the grid the value is clamped to the edge and the gradient along the clamped
    axis is zero.
    """
    count = points_m.shape[0]
    value = np.empty(count)
    gradient = np.empty((count, 3))
    nx, ny, nz = distance.shape
    for n in range(count):
        cx = (points_m[n, 0] - origin_m[0]) / voxel_size_m - 0.5
        cy = (points_m[n, 1] - origin_m[1]) / voxel_size_m - 0.5
        cz = (points_m[n, 2] - origin_m[2]) / voxel_size_m - 0.5
        i, fx = _cell(nx, cx)
        j, fy = _cell(ny, cy)
        k, fz = _cell(nz, cz)
        i1, j1, k1 = min(i + 1, nx - 1), min(j + 1, ny - 1), min(k + 1, nz - 1)
        d000, d001 = distance[i, j, k], distance[i, j, k1]
        d010, d011 = distance[i, j1, k], distance[i, j1, k1]
        d100, d101 = distance[i1, j, k], distance[i1, j, k1]
        d110, d111 = distance[i1, j1, k], distance[i1, j1, k1]
        d00, d01 = d000 + (d100 - d000) * fx, d001 + (d101 - d001) * fx
        d10, d11 = d010 + (d110 - d010) * fx, d011 + (d111 - d011) * fx
        d0, d1 = d00 + (d10 - d00) * fy, d01 + (d11 - d01) * fy
        value[n] = d0 + (d1 - d0) * fz
        gx0 = (d100 - d000) + ((d110 - d010) - (d100 - d000)) * fy
        gx1 = (d101 - d001) + ((d111 - d011) - (d101 - d001)) * fy
        inside_x = 0.0 <= cx <= nx - 1
        inside_y = 0.0 <= cy <= ny - 1
        inside_z = 0.0 <= cz <= nz - 1
        gradient[n, 0] = (gx0 + (gx1 - gx0) * fz) / voxel_size_m if inside_x else 0.0
        gradient[n, 1] = ((d10 - d00) + ((d11 - d01) - (d10 - d00)) * fz) / voxel_size_m if inside_y else 0.0
        gradient[n, 2] = (d1 - d0) / voxel_size_m if inside_z else 0.0
    return value, gradient


def gradient_at(distance: Float32, origin_m: Float, voxel_size_m: float, points_m: Float) -> Float:
    """Gradient of the trilinear field at points (N, 3) -> (N, 3)."""
    gradient: Float = value_and_gradient(distance, origin_m, voxel_size_m, points_m)[1]
    return gradient


@nb.njit(cache=True)
def observed_at(state: UInt8, origin_m: Float, voxel_size_m: float, points_m: Float) -> Bool:
    """Whether the voxel that holds each point (N, 3) is not unknown (0); False outside."""
    count = points_m.shape[0]
    seen = np.zeros(count, dtype=np.bool_)
    for n in range(count):
        i = int(np.floor((points_m[n, 0] - origin_m[0]) / voxel_size_m))
        j = int(np.floor((points_m[n, 1] - origin_m[1]) / voxel_size_m))
        k = int(np.floor((points_m[n, 2] - origin_m[2]) / voxel_size_m))
        if 0 <= i < state.shape[0] and 0 <= j < state.shape[1] and 0 <= k < state.shape[2]:
            seen[n] = state[i, j, k] != 0
    return seen


@dataclass(frozen=True, slots=True, kw_only=True)
class DistanceField:
    """Signed Euclidean distance to mapped obstacles on a voxel grid, with its gradient.

    distance = ±(exact distance between voxel centres - half a voxel), + in free and
    unknown space, - in obstacles, truncated at ±`max_distance_m`. Unknown is no obstacle.
    The arrays change with the map, and nobody can write into them here: do not keep them; `copy()` does.
    Voxel (i, j, k) has its centre at origin_m + (i + 0.5, j + 0.5, k + 0.5) * voxel_size_m.
    """

    origin_m: Float  # (3,) lower corner of voxel (0, 0, 0)
    voxel_size_m: float
    max_distance_m: float
    distance: Float32  # (X, Y, Z) signed distance at voxel centres, m
    state: UInt8  # (X, Y, Z) UNKNOWN, FREE or OCCUPIED
    # how often each tile of TILE x TILE columns has changed; empty: nothing ever does
    changed: Int32 = dataclasses.field(default_factory=lambda: np.zeros((0, 0), np.int32))

    def __post_init__(self) -> None:
        for name in ("distance", "state", "changed"):
            view = getattr(self, name).view()
            view.flags.writeable = False
            object.__setattr__(self, name, view)

    def distance_m(self, points_m: Float) -> Float:
        """Trilinear signed distance at points (N, 3) -> (N,); clamped to the grid's edge."""
        value: Float = interpolate(self.distance, self.origin_m, self.voxel_size_m, points_m)
        return value

    def gradient(self, points_m: Float) -> Float:
        """Exact gradient of the trilinear field at points (N, 3) -> (N, 3), unitless."""
        return gradient_at(self.distance, self.origin_m, self.voxel_size_m, points_m)

    def observed(self, points_m: Float) -> Bool:
        """Whether the voxel of each point (N, 3) -> (N,) was ever seen; False outside."""
        seen: Bool = observed_at(self.state, self.origin_m, self.voxel_size_m, points_m)
        return seen

    def copy(self) -> DistanceField:
        """Return a field that later map updates do not touch."""
        return DistanceField(
            origin_m=self.origin_m,
            voxel_size_m=self.voxel_size_m,
            max_distance_m=self.max_distance_m,
            distance=self.distance.copy(),
            state=self.state.copy(),
        )

    def voxel_centres_m(self, voxel: np.ndarray) -> Float:
        """Centres (N, 3) of flat C-order voxel indices (N,)."""
        index = np.stack(np.unravel_index(voxel, self.distance.shape), axis=-1)
        return np.asarray(self.origin_m + (index + 0.5) * self.voxel_size_m, dtype=np.float64)
