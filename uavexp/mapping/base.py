"""Mapping role: scans in, a signed distance field and its change log out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from uavexp.mapping.field import gradient_at, interpolate, observed_at
from uavexp.scene import Scene
from uavexp.types import Bool, Float, Float32, MapUpdate, Scan, UInt8

UNKNOWN, FREE, OCCUPIED = 0, 1, 2  # values of `DistanceField.state`


@dataclass(frozen=True, slots=True, kw_only=True)
class DistanceField:
    """Signed Euclidean distance to mapped obstacles on a voxel grid, with its gradient.

    distance = ±(exact distance between voxel centres - half a voxel), + in free and
    unknown space, - in obstacles, truncated at ±`max_distance_m`. Unknown is no obstacle.
    The arrays are the map's own and change with it: read, do not keep; `copy()` to keep.
    Voxel (i, j, k) has its centre at origin_m + (i + 0.5, j + 0.5, k + 0.5) * voxel_size_m.
    """

    origin_m: Float  # (3,) lower corner of voxel (0, 0, 0)
    voxel_size_m: float
    max_distance_m: float
    distance: Float32  # (X, Y, Z) signed distance at voxel centres, m
    state: UInt8  # (X, Y, Z) UNKNOWN, FREE or OCCUPIED

    def distance_m(self, points_m: Float) -> Float:
        """Trilinear signed distance at points (N, 3) -> (N,); clamped to the grid's edge."""
        return interpolate(self.distance, self.origin_m, self.voxel_size_m, points_m)

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


class MapBackend(Protocol):
    """Fuses scans into a TSDF and keeps its ESDF; built fresh for every trial."""

    voxel_size_m: float
    esdf_rate_hz: float

    def reset(self, bounds_m: Float, scene: Scene) -> None:
        """Begin a trial inside `bounds_m` (2, 3) with everything unknown.

        `scene` is the true geometry: a map that is known from the start is made of it, one that
        has to be measured does not look at it.
        """
        ...

    def mark_free(self, centre_m: Float, radius_m: float) -> None:
        """Declare a ball known free (the start bubble); measured surfaces override it."""
        ...

    def integrate(self, scan: Scan) -> None:
        """Fuse one scan (sensor rate)."""
        ...

    def update(self, time_s: float) -> MapUpdate:
        """Bring the ESDF up to date (ESDF rate) and return what changed since the last call."""
        ...

    @property
    def field(self) -> DistanceField:
        """The live distance field, as of the last `update`."""
        ...
