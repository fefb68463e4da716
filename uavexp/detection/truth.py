"""Detection that is told the truth: the yardstick for what sensing costs."""

from __future__ import annotations

import numpy as np

from uavexp.bodies import present
from uavexp.detection.returns import without_bodies
from uavexp.field import DistanceField
from uavexp.parameters import NonNegative, option
from uavexp.scan import Scan
from uavexp.types import Bodies, Limits, Tracks


@option
class Truth:
    """Every body is known, whether it is in sight or not; returns within `margin_m` of one are its own."""

    margin_m: NonNegative = 0.1  # m, returns so near to a mover are taken for its own:
    # three sigma of the sensors' noise [ours]

    def reset(self, limits: Limits, rng: np.random.Generator) -> None:
        """Begin a trial; draws nothing."""

    def detect(self, scan: Scan, field: DistanceField, truth: Bodies) -> tuple[Scan, Tracks]:
        """Return the scan without the returns of bodies, and the tracks of all that are there."""
        there = np.flatnonzero(present(truth.position_m))
        tracks = Tracks(
            time_s=scan.time_s,
            identity=there,
            position_m=truth.position_m[there],
            velocity_mps=truth.velocity_mps[there],
            covariance=np.zeros((len(there), 6, 6)),
            half_size_m=truth.half_size_m[there],
        )
        if not len(there):
            return scan, tracks
        return without_bodies(scan, truth, self.margin_m), tracks
