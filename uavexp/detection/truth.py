"""Detection that is told the truth: the yardstick for what sensing costs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavexp.mapping.base import DistanceField
from uavexp.types import Bodies, Limits, Scan, Tracks


@dataclass(slots=True, kw_only=True)
class Truth:
    """Every body is known, whether it is in sight or not."""

    def reset(self, limits: Limits, rng: np.random.Generator) -> None:
        """Begin a trial; draws nothing."""

    def detect(self, scan: Scan, field: DistanceField, truth: Bodies) -> tuple[Scan, Tracks]:
        """Return the tracks of all bodies."""
        count = len(truth)
        tracks = Tracks(
            time_s=scan.time_s,
            identity=np.arange(count),
            position_m=truth.position_m,
            velocity_mps=truth.velocity_mps,
            covariance=np.zeros((count, 6, 6)),
            half_size_m=truth.half_size_m,
        )
        return scan, tracks
