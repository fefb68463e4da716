"""Detection that sees every mover's centre up to noise: what filtering and prediction are worth alone.

No mover is hidden or mistaken for another; the noise is Gaussian and drawn anew for each scan. One
filter each, as in `sensed`.
"""

from __future__ import annotations

from dataclasses import field

import numpy as np

from uavexp.arrays import Int
from uavexp.bodies import present
from uavexp.detection.filters import MoverFilter, new_filter
from uavexp.detection.kalman import FilterParameters, MotionModel
from uavexp.detection.returns import without_bodies
from uavexp.field import DistanceField
from uavexp.parameters import NonNegative, option
from uavexp.scan import Scan
from uavexp.types import Bodies, Limits, Tracks


@option
class Noisy(FilterParameters):
    """Every body is seen, its centre with noise; returns within `margin_m` of one are its own."""

    margin_m: NonNegative = 0.1  # m, returns so near to a mover are taken for its own:
    # three sigma of the sensors' noise [ours]
    _rng: np.random.Generator | None = field(init=False, repr=False, default=None)
    _filters: dict[int, MoverFilter] = field(init=False, repr=False, default_factory=dict)
    _time_s: float = field(init=False, repr=False, default=np.nan)

    def reset(self, limits: Limits, rng: np.random.Generator) -> None:
        """Begin a trial; draws nothing yet."""
        self._rng, self._filters, self._time_s = rng, {}, np.nan

    def detect(self, scan: Scan, field: DistanceField, truth: Bodies) -> tuple[Scan, Tracks]:
        """Return the scan without the returns of bodies, and a track of each that is there."""
        there = np.flatnonzero(present(truth.position_m))
        self._observe(scan.time_s, truth, there, field)
        filters = [self._filters[int(body)] for body in there]
        if not filters:
            return scan, Tracks.none(scan.time_s)
        position_m, velocity_mps = zip(*(one.estimate(self.estimate) for one in filters), strict=True)
        tracks = Tracks(
            time_s=scan.time_s,
            identity=there,
            position_m=np.stack(position_m),
            velocity_mps=np.stack(velocity_mps),
            covariance=np.stack([one.covariance for one in filters]),
            half_size_m=truth.half_size_m[there],
            swerve_m=np.stack([self._filters[int(b)].swerve_m(truth.half_size_m[b], field) for b in there]),
        )
        return without_bodies(scan, truth, self.margin_m), tracks

    def _observe(self, time_s: float, truth: Bodies, there: Int, field: DistanceField) -> None:
        """Filter the bodies that are there on; forget those that are not."""
        if self._rng is None:
            raise RuntimeError("reset() must come first")
        noise_m = self._rng.normal(0.0, self.position_noise_m, truth.position_m.shape)
        motion = MotionModel(
            position_noise_m=self.position_noise_m,
            height_noise_m=self.position_noise_m,
            acceleration_density=self.acceleration_density,
            adaptivity=self.adaptivity,
        )
        known, self._filters = self._filters, {}
        for body in map(int, there):
            seen_m = truth.position_m[body] + noise_m[body]
            filter_ = known.get(body)
            if filter_ is None:
                filter_ = new_filter(seen_m, motion, self.estimate)
            elif time_s > self._time_s:
                filter_.predict(time_s - self._time_s, truth.half_size_m[body], field)
                filter_.observe(seen_m)
            self._filters[body] = filter_
        self._time_s = time_s
