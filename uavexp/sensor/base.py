"""Sensor role: measures the true geometry."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from uavexp.scan import Scan
from uavexp.scene import Scene
from uavexp.types import State


class Sensor(Protocol):
    """Takes scans at `rate_hz`; built fresh for every trial."""

    rate_hz: float

    def reset(self, scene: Scene, rng: np.random.Generator) -> None:
        """Begin a trial in `scene`, drawing noise from `rng`."""

    def capture(self, true_state: State, estimated_state: State, time_s: float) -> Scan:
        """Measure from the true pose; the scan carries the pose believed (estimated)."""
