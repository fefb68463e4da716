"""LiDAR with a rosette that never repeats in a flight: the Livox Mid-40's two turning prisms.

Two equal wedge prisms (Risley prisms) turn at different rates f1 > 0 > f2. Each of them bends
the beam by a quarter of the field of view towards its thick side; to first order the two add:

    a(t) = fov/4 (cos 2 pi f1 t + cos 2 pi f2 t),   b(t) = fov/4 (sin 2 pi f1 t + sin 2 pi f2 t),

the beam leaves at the angle rho = hypot(a, b) <= fov/2 from the axis, towards atan2(b, a)
around it. With the rates in no small ratio the curve is a rosette whose petals precess, so
that coverage grows with time: every scan is another part of the same curve.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from uavexp.arrays import Float, Float32
from uavexp.errors import require
from uavexp.scene import Scene
from uavexp.sensor.lidar import LidarParameters, take_scan
from uavexp.types import RayScan, State


def rosette(times_s: Float, field_of_view_deg: float, prism_rates_hz: tuple[float, float]) -> Float32:
    """Unit directions (N, 3), forward x, left y, up z, at times (N,) since both prisms pointed left."""
    quarter = np.radians(field_of_view_deg) / 4.0
    turn = 2.0 * np.pi * np.outer(times_s, prism_rates_hz)
    left, up = quarter * np.cos(turn).sum(axis=1), quarter * np.sin(turn).sum(axis=1)
    off = np.hypot(left, up)
    sine = np.sinc(off / np.pi)  # sin(off) / off
    return np.stack([np.cos(off), sine * left, sine * up], axis=1).astype(np.float32)


@dataclass(slots=True, kw_only=True)
class LidarRosette(LidarParameters):
    """Livox Mid-40, looking forward; a scan is the points of one scan period."""

    points_per_scan: int = 5000
    field_of_view_deg: float = 38.4
    first_prism_hz: float = 121.57
    second_prism_hz: float = -77.73
    _scene: Scene = field(init=False, repr=False)
    _rng: np.random.Generator = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check every parameter."""
        LidarParameters.__post_init__(self)
        count = self.points_per_scan
        require(
            isinstance(count, int) and not isinstance(count, bool) and 2 <= count <= 1_000_000,
            f"points_per_scan must be a whole number, 2 to 1000000, got {count}",
        )
        require(
            0.0 < self.field_of_view_deg < 180.0,
            f"field_of_view_deg must be > 0 and < 180 deg, got {self.field_of_view_deg}",
        )
        for name in ("first_prism_hz", "second_prism_hz"):
            rate = getattr(self, name)
            require(0.0 < abs(rate) < 1000.0, f"{name} must be other than 0 and within 1000 Hz, got {rate}")

    def reset(self, scene: Scene, rng: np.random.Generator) -> None:
        """Begin a trial in `scene`, drawing noise from `rng`."""
        self._scene, self._rng = scene, rng

    def capture(self, true_state: State, estimated_state: State, time_s: float) -> RayScan:
        """Measure from the true pose; the scan carries the pose believed (estimated)."""
        times_s = time_s + np.arange(self.points_per_scan) / (self.points_per_scan * self.rate_hz)
        direction = rosette(times_s, self.field_of_view_deg, (self.first_prism_hz, self.second_prism_hz))
        return take_scan(self, direction, self._scene, self._rng, (true_state, estimated_state), time_s)
