"""Points to voxels: each non-empty voxel keeps the centroid of its points (Liao et al., 3-1 and 3-2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavexp.arrays import Float, Int
from uavexp.cloud.cloud_file import CloudError

_CHUNK = 1_000_000  # points sorted into voxels at once
_BITS = 20  # of a voxel's index along an axis: a million voxels
_HALF = 1 << (_BITS - 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class CloudVoxels:
    """Non-empty voxels, in ascending order of their keys."""

    voxel_size_m: float
    key: Int  # (V,) three indices of 20 bits
    centroid_m: Float  # (V, 3)
    points: Int  # (V,) how many each holds

    @property
    def index(self) -> Int:
        """Indices (V, 3): voxel (i, j, k) spans [i l, (i + 1) l) and so on, l the edge."""
        return unpacked(self.key)


def packed(index: Int) -> Int:
    """One number (N,) for three indices (N, 3)."""
    shifted = index + _HALF
    return np.asarray((shifted[:, 0] << 2 * _BITS) | (shifted[:, 1] << _BITS) | shifted[:, 2])


def unpacked(key: Int) -> Int:
    """Indices (N, 3) of keys (N,)."""
    mask = (1 << _BITS) - 1
    return np.stack([key >> 2 * _BITS, key >> _BITS & mask, key & mask], axis=1) - _HALF


def voxelise(points_m: Float, voxel_size_m: float) -> CloudVoxels:
    """Sort points (N, 3) into voxels.

    Raises:
        CloudError: the cloud is wider than a million voxels.
    """
    if np.abs(points_m).max() / voxel_size_m >= _HALF - 2:
        reach = float(np.abs(points_m).max())
        raise CloudError(f"points {reach:g} m from the origin are too far for voxels of {voxel_size_m:g} m")
    keys = np.zeros(0, dtype=np.int64)
    sums = np.zeros((0, 4))
    for begin in range(0, len(points_m), _CHUNK):
        part = points_m[begin : begin + _CHUNK]
        mine = packed(np.floor(part / voxel_size_m).astype(np.int64))
        rows = np.concatenate([sums, np.column_stack([part, np.ones(len(part))])])
        keys, place = np.unique(np.concatenate([keys, mine]), return_inverse=True)
        columns = [np.bincount(place, rows[:, n], len(keys)) for n in range(4)]
        sums = np.column_stack(columns)
    return CloudVoxels(
        voxel_size_m=voxel_size_m,
        key=keys,
        centroid_m=sums[:, :3] / sums[:, 3:],
        points=sums[:, 3].astype(np.int64),
    )
