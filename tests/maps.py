"""Maps that fuse scans, begun in one hall, and what stands in them."""

from __future__ import annotations

import numpy as np

from uavexp.field import OCCUPIED
from uavexp.mapping.base import MapBackend
from uavexp.mapping.dense import Dense
from uavexp.mapping.voxel_block_grid import VoxelBlockGrid
from uavexp.scene import Scene

BOUNDS_M = np.array([[0.0, 0.0, 0.0], [8.0, 6.0, 3.0]])
NOTHING = Scene.from_mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32))
FUSING = {"dense": Dense, "voxel_block_grid": VoxelBlockGrid}


def begin(option: str, **changes: object) -> MapBackend:
    backend = FUSING[option](**changes)
    backend.reset(BOUNDS_M, NOTHING)
    return backend


def occupied(backend: MapBackend) -> np.ndarray:
    return backend.field.state == OCCUPIED


def centres(backend: MapBackend) -> np.ndarray:
    shape = backend.field.distance.shape
    return backend.field.voxel_centres_m(np.arange(np.prod(shape))).reshape(*shape, 3)
