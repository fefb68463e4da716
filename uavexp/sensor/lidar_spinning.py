"""Spinning LiDAR: rings of rays at fixed elevations, all around."""

from __future__ import annotations

from dataclasses import field
from typing import Annotated

import numpy as np

from uavexp.arrays import Float32
from uavexp.errors import require
from uavexp.parameters import between, option
from uavexp.scan import RayScan
from uavexp.scene import Scene
from uavexp.sensor.lidar import LidarParameters, take_scan
from uavexp.types import State


@option
class LidarSpinning(LidarParameters):
    """A full turn a scan; rings evenly spaced over the vertical field, its ends included."""

    rings: Annotated[int, between(2, 256)] = 16  # elevations; a common size [ours]
    azimuths: Annotated[int, between(2, 8192)] = 360  # rays a turn in each ring, one a degree [ours]
    lowest_deg: float = -20.0  # deg, elevation of the lowest ring [ours: a ring is level, at flight height]
    highest_deg: float = 10.0  # deg, elevation of the highest ring [ours]
    _scene: Scene = field(init=False, repr=False)
    _rng: np.random.Generator = field(init=False, repr=False)
    _direction: Float32 = field(init=False, repr=False)

    def __post_init__(self) -> None:
        LidarParameters.__post_init__(self)
        require(
            -90.0 < self.lowest_deg < self.highest_deg < 90.0,
            "-90 < lowest_deg < highest_deg < 90 must hold, got "
            f"lowest_deg {self.lowest_deg}, highest_deg {self.highest_deg}",
        )

    def reset(self, scene: Scene, rng: np.random.Generator) -> None:
        """Begin a trial in `scene`, drawing noise from `rng`."""
        self._scene, self._rng = scene, rng
        elevation, azimuth = np.meshgrid(
            np.radians(np.linspace(self.lowest_deg, self.highest_deg, self.rings)),
            2.0 * np.pi * np.arange(self.azimuths) / self.azimuths,
        )
        level = np.cos(elevation)
        grid = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=-1)
        self._direction = grid.reshape(-1, 3).astype(np.float32)

    def capture(self, true_state: State, estimated_state: State, time_s: float) -> RayScan:
        """Measure from the true pose; the scan carries the pose believed (estimated)."""
        return take_scan(self, self._direction, self._scene, self._rng, (true_state, estimated_state), time_s)
