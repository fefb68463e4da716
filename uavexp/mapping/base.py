"""Mapping role: scans in, a signed distance field and its change log out."""

from __future__ import annotations

from typing import Protocol

from uavexp.arrays import Float
from uavexp.field import DistanceField
from uavexp.scan import Scan
from uavexp.scene import Scene
from uavexp.types import MapUpdate


class MapBackend(Protocol):
    """Fuses scans into a TSDF and keeps its ESDF; built fresh for every trial."""

    voxel_size_m: float
    max_distance_m: float  # truncation of its field
    esdf_rate_hz: float

    def reset(self, bounds_m: Float, scene: Scene) -> None:
        """Begin a trial inside `bounds_m` (2, 3) with everything unknown.

        `scene` is the true geometry: a map that is known from the start is made of it, one that
        has to be measured does not look at it.
        """

    def mark_free(self, centre_m: Float, radius_m: float) -> None:
        """Declare a ball known free (the start bubble); measured surfaces override it."""

    def note_obstacle(self, centre_m: Float, radius_m: float) -> None:
        """Declare a ball an obstacle that was felt, not seen; no measurement overrides it."""

    def integrate(self, scan: Scan) -> None:
        """Fuse one scan (sensor rate)."""

    def update(self, time_s: float) -> MapUpdate:
        """Bring the ESDF up to date (ESDF rate) and return what changed since the last call."""

    @property
    def field(self) -> DistanceField:
        """The live distance field, as of the last `update`."""
