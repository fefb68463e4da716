"""Detection role: tells what moves from what stands still, and tracks it."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from uavexp.field import DistanceField
from uavexp.scan import Scan
from uavexp.types import Bodies, Limits, Tracks


class Detection(Protocol):
    """Sees every scan before the map does; built fresh for every trial.

    Flights without movers leave it out: there is nothing to tell apart.
    """

    def reset(self, limits: Limits, rng: np.random.Generator) -> None:
        """Begin a trial with no track."""

    def detect(self, scan: Scan, field: DistanceField, truth: Bodies) -> tuple[Scan, Tracks]:
        """Split a scan into what the map may fuse and what moves.

        Args:
            scan: as the sensor took it.
            field: the map as of its last update.
            truth: the bodies that really are there; a detector that senses does not look at it.

        Returns:
            The scan with the returns of movers taken out (NaN: no measurement), and the tracks
            at the scan's time.
        """
