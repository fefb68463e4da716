"""The map of a stored flight as voxels, also of logs that kept its occupied centres alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavexp.arrays import Bool, Float, Int
from uavexp.log import TrialLog
from uavexp.map_grid import free_voxels

_VOXEL_M = 0.1  # where neither grid nor two centres tell


@dataclass(frozen=True, slots=True, kw_only=True)
class MapVoxels:
    """A map at the end of a flight."""

    origin_m: Float  # (3,) lower corner of voxel (0, 0, 0)
    voxel_size_m: float
    occupied: Bool  # (X, Y, Z)
    free: Bool  # (X, Y, Z); nowhere where the log did not note it


def map_voxels(log: TrialLog) -> MapVoxels:
    """The map of a log; of an older log just around its occupied voxels, all others unknown."""
    centres_m = log.mapped_m.reshape(-1, 3).astype(np.float64)
    if log.grid.shape.size:
        origin_m, size_m, free = log.grid.origin_m, log.grid.voxel_size_m, free_voxels(log.grid)
    else:
        size_m = spacing_m(centres_m)
        low_m = centres_m.min(axis=0) if len(centres_m) else np.zeros(3)
        high_m = centres_m.max(axis=0) if len(centres_m) else np.zeros(3)
        origin_m = np.rint(low_m / size_m - 0.5) * size_m
        free = np.zeros(tuple(np.rint((high_m - low_m) / size_m).astype(int) + 1), dtype=np.bool_)
    occupied = np.zeros_like(free)
    occupied[tuple(_index(centres_m, origin_m, size_m).T)] = True
    return MapVoxels(origin_m=origin_m, voxel_size_m=size_m, occupied=occupied, free=free)


def spacing_m(centres_m: Float) -> float:
    """Edge of a voxel: the least distance of two different coordinates of centres (N, 3)."""
    gaps_m = np.concatenate([np.diff(np.unique(np.round(axis, 3))) for axis in centres_m.T])
    return float(np.round(gaps_m.min(), 3)) if gaps_m.size else _VOXEL_M


def mapped_until_m(log: TrialLog, time_s: float) -> Float:
    """Centres (N, 3) mapped as occupied by a time; of an older log all of them, always."""
    if len(log.grid.occupied_s) != len(log.mapped_m):
        return log.mapped_m.astype(np.float64)
    return log.mapped_m[log.grid.occupied_s <= time_s].astype(np.float64)


def _index(centres_m: Float, origin_m: Float, size_m: float) -> Int:
    return np.rint((centres_m - origin_m) / size_m - 0.5).astype(np.int64)
