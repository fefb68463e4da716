"""LiDAR with a rosette that never repeats in a flight: the Livox Mid-40's two turning prisms.

Two equal wedge prisms (Risley prisms) turn at different rates f1 > 0 > f2. Each of them bends
the beam by a quarter of the field of view towards its thick side; to first order the two add:

    a(t) = fov/4 (cos 2 pi f1 t + cos 2 pi f2 t),   b(t) = fov/4 (sin 2 pi f1 t + sin 2 pi f2 t),

the beam leaves at the angle rho = hypot(a, b) <= fov/2 from the axis, towards atan2(b, a)
around it. With the rates in no small ratio the curve is a rosette whose petals precess, so
that coverage grows with time: every scan is another part of the same curve.
"""

from __future__ import annotations

from dataclasses import field
from typing import Annotated

import numpy as np

from uavexp.arrays import Float, Float32
from uavexp.parameters import Constraint, above, below, between, option
from uavexp.scan import RayScan
from uavexp.scene import Scene
from uavexp.sensor.lidar import LidarParameters, take_scan
from uavexp.types import State


def rosette(times_s: Float, field_of_view_deg: float, prism_rates_hz: tuple[float, float]) -> Float32:
    """Unit directions (N, 3), forward x, left y, up z, at times (N,) since both prisms pointed left."""
    quarter = np.radians(field_of_view_deg) / 4.0
    turn = 2.0 * np.pi * np.outer(times_s, prism_rates_hz)
    left, up = quarter * np.cos(turn).sum(axis=1), quarter * np.sin(turn).sum(axis=1)
    off = np.hypot(left, up)
    sine = np.sinc(off / np.pi)  # sin(off) / off
    return np.stack([np.cos(off), sine * left, sine * up], axis=1).astype(np.float32)


PrismRate = Annotated[
    float, Constraint("other than 0 and within 1000 Hz", lambda rate_hz: 0.0 < abs(rate_hz) < 1000.0)
]


@option
class LidarRosette(LidarParameters):
    """Livox Mid-40, looking forward; a scan is the points of one scan period."""

    points_per_scan: Annotated[int, between(2, 1_000_000)] = 5000  # of the 10,000 that the real 100,000 a
    # second make at 10 Hz: half the time, for a map of 0.1 m [ours]
    field_of_view_deg: Annotated[float, above(0), below(180)] = 38.4  # deg, circular; Livox Mid-40
    first_prism_hz: PrismRate = 121.57  # Hz, turns of the first prism [ours: the maker gives none]
    second_prism_hz: PrismRate = -77.73  # Hz, of the second one, the other way round [ours]
    _scene: Scene = field(init=False, repr=False)
    _rng: np.random.Generator = field(init=False, repr=False)

    def reset(self, scene: Scene, rng: np.random.Generator) -> None:
        """Begin a trial in `scene`, drawing noise from `rng`."""
        self._scene, self._rng = scene, rng

    def capture(self, true_state: State, estimated_state: State, time_s: float) -> RayScan:
        """Measure from the true pose; the scan carries the pose believed (estimated)."""
        times_s = time_s + np.arange(self.points_per_scan) / (self.points_per_scan * self.rate_hz)
        direction = rosette(times_s, self.field_of_view_deg, (self.first_prism_hz, self.second_prism_hz))
        return take_scan(self, direction, self._scene, self._rng, (true_state, estimated_state), time_s)
