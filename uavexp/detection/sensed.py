"""Detection by sensing: what is seen where the map says free must have moved there (paper 2, §4).

A return counts as out of place when its voxel is known to be free, farther than `free_m` from
any mapped obstacle, or was so `memory_s` to 2 `memory_s` ago (a mover gets into the map before
it is recognised). What the map has never observed is fixed until seen free: a wall first
seen is never taken for a mover. Such returns are clustered and tracked (`tracker`).

- Returns of a mover are taken out of the scan from the moment its track is known to move;
  until then they are mapped like anything else, which is safe, and the map forgets them as
  soon as it sees through there again.
- A mover that stands for `standing_s` is given back to the map, and stays a track until the
  map has had it for `memory_s` and then for `coast_s`; when it walks off it is a new object that moves.
- One slower than about `free_m` in the time the map needs for a surface (0.2 s at 10 Hz) and
  `memory_s` is carried by the map as a fixed obstacle, which follows it.
- One that is hidden coasts at its last velocity for `coast_s`, as far as no obstacle is in its way.
- A filter with a state that is not finite, or too fast or too uncertain to be true, is dropped
  and counted (`Tracks.dropped`).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from uavexp.arrays import Bool, Float
from uavexp.detection.clusters import cluster, split
from uavexp.detection.kalman import Estimate, Motion
from uavexp.detection.returns import free_at, returns, viewpoint_m, without
from uavexp.detection.tracker import Tracker, TrackRule
from uavexp.errors import require, require_non_negative, require_option, require_positive
from uavexp.field import DistanceField
from uavexp.types import Bodies, Limits, Scan, Tracks


@dataclass(slots=True, kw_only=True)
class Sensed:
    """Movers told from the map by the scan alone; never looks at the truth."""

    free_m: float = 0.2
    memory_s: float = 0.5
    cluster_m: float = 0.6
    min_points: int = 3
    max_size_m: float = 2.5
    gate: float = 4.0
    confirm_hits: int = 3
    moved_m: float = 0.25
    standing_mps: float = 0.12
    standing_s: float = 1.0
    coast_s: float = 3.0
    max_speed_mps: float = 6.0
    max_deviation_m: float = 2.0
    position_noise_m: float = 0.08
    acceleration_density: float = 0.1
    adaptivity: float = 20.0
    estimate: Estimate = Estimate.KALMAN
    _tracker: Tracker | None = field(init=False, repr=False, default=None)
    _time_s: float = field(init=False, repr=False, default=np.nan)
    _before: tuple[DistanceField, DistanceField] | None = field(init=False, repr=False, default=None)
    _kept_s: float = field(init=False, repr=False, default=-np.inf)

    def __post_init__(self) -> None:
        require_positive(
            free_m=self.free_m,
            memory_s=self.memory_s,
            cluster_m=self.cluster_m,
            max_size_m=self.max_size_m,
            gate=self.gate,
            moved_m=self.moved_m,
            standing_s=self.standing_s,
            max_speed_mps=self.max_speed_mps,
            max_deviation_m=self.max_deviation_m,
            position_noise_m=self.position_noise_m,
            acceleration_density=self.acceleration_density,
        )
        require_non_negative(standing_mps=self.standing_mps, coast_s=self.coast_s)
        require(1.0 <= self.adaptivity < np.inf, f"adaptivity must be >= 1 and finite, got {self.adaptivity}")
        self.estimate = require_option("estimate", self.estimate, Estimate)
        for name in ("min_points", "confirm_hits"):
            value = getattr(self, name)
            require(isinstance(value, int) and value >= 1, f"{name} must be a whole number >= 1, got {value}")

    def reset(self, limits: Limits, rng: np.random.Generator) -> None:
        """Begin a trial with no track; draws nothing."""
        rule = TrackRule(
            gate=self.gate,
            confirm_hits=self.confirm_hits,
            moved_m=self.moved_m,
            standing_mps=self.standing_mps,
            standing_s=self.standing_s,
            coast_s=self.coast_s,
            max_speed_mps=self.max_speed_mps,
            max_deviation_m=self.max_deviation_m,
            motion=Motion(
                position_noise_m=self.position_noise_m,
                acceleration_density=self.acceleration_density,
                adaptivity=self.adaptivity,
            ),
            estimate=self.estimate,
        )
        self._tracker, self._time_s, self._before, self._kept_s = Tracker(rule), np.nan, None, -np.inf

    def detect(self, scan: Scan, field: DistanceField, truth: Bodies) -> tuple[Scan, Tracks]:
        """Return the scan without the returns of movers, and the tracks."""
        if self._tracker is None:
            raise RuntimeError("reset() must come first")
        self._remember(field, scan.time_s)
        seen = returns(scan)
        loose = self._is_out_of_place(seen.points_m, field)
        points_m = seen.points_m[loose]
        period_s = 0.0 if np.isnan(self._time_s) else max(scan.time_s - self._time_s, 0.0)
        self._time_s = scan.time_s
        sensor_m = viewpoint_m(scan)
        clusters = cluster(points_m, sensor_m, self.cluster_m, self.min_points, self.max_size_m)
        clusters = split(clusters, points_m, sensor_m, *self._tracker.predict(period_s, field))
        moving = self._tracker.observe(clusters, scan, period_s)
        taken = np.append(moving, False)[clusters.label]
        return without(scan, seen.where[loose][taken]), self._tracker.published(scan.time_s)

    def _remember(self, now: DistanceField, time_s: float) -> None:
        """Keep the map of at least `memory_s` ago, from where there is one."""
        if time_s - self._kept_s < self.memory_s - 1e-9:
            return
        copy = now.copy()
        self._before = (self._before[1], copy) if self._before else (copy, copy)
        self._kept_s = time_s

    def _is_out_of_place(self, points_m: Float, now: DistanceField) -> Bool:
        """Which points (N, 3) lie where nothing is mapped, or was when a mover could have come since."""
        assert self._before is not None
        out = np.zeros(len(points_m), dtype=np.bool_)
        for map_ in (now, self._before[0]):
            grid = (map_.distance, map_.state, map_.origin_m, map_.voxel_size_m)
            out |= free_at(*grid, points_m, self.free_m)
        return out
