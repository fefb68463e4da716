"""Scipy's exact distance transform as the oracle of the one kept by windows."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import distance_transform_edt

from uavexp.field import OCCUPIED, UNKNOWN
from uavexp.mapping.esdf import SignedDistance, distance_table
from uavexp.types import MapUpdate

VOXEL_M = 0.1


def squared_distances(occupied: np.ndarray, cap: int) -> np.ndarray:
    """Signed squared voxel distances by scipy, capped: + outside, - inside."""

    def towards(source: np.ndarray) -> np.ndarray:
        if not source.any():  # scipy answers nonsense then
            return np.full(source.shape, cap)
        return np.minimum(np.rint(distance_transform_edt(~source) ** 2).astype(np.int64), cap)

    return towards(occupied) - towards(~occupied)


def exact_field(occupied: np.ndarray, max_distance_m: float) -> np.ndarray:
    """Signed distances, m, as the package defines them."""
    cap, table = distance_table(VOXEL_M, max_distance_m)
    return table[squared_distances(occupied, cap) + cap]


class Replay:
    """A field that is told of random edits of its state, with the state beside it."""

    def __init__(self, shape: tuple[int, int, int], max_distance_m: float = 1.0) -> None:
        self.state = np.zeros(shape, np.uint8)
        self.field = SignedDistance(shape, VOXEL_M, max_distance_m)

    def become(self, state: np.ndarray, rng: np.random.Generator | None = None) -> MapUpdate:
        flipped = np.flatnonzero((state == OCCUPIED) != (self.state == OCCUPIED)).astype(np.int32)
        first_seen = np.flatnonzero((state != UNKNOWN) & (self.state == UNKNOWN)).astype(np.int32)
        if rng is not None:
            rng.shuffle(flipped)
            rng.shuffle(first_seen)
        self.state = state.copy()
        return self.field.update(0.0, self.state, flipped, first_seen)
