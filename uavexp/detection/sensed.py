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

from dataclasses import field

import numpy as np

from uavexp.arrays import Bool, Float
from uavexp.detection.clusters import cluster, split
from uavexp.detection.kalman import FilterParameters, MotionModel
from uavexp.detection.returns import free_at, returns, viewpoint_m, without
from uavexp.detection.tracker import Tracker, TrackRule
from uavexp.field import DistanceField
from uavexp.parameters import Count, NonNegative, Positive, option
from uavexp.scan import Scan
from uavexp.types import Bodies, Limits, Tracks


@option
class Sensed(FilterParameters):
    """Movers told from the map by the scan alone; never looks at the truth."""

    free_m: Positive = 0.2  # m, a return farther than this from every mapped obstacle is out of place:
    # two voxels [ours]
    memory_s: Positive = 0.5  # s, what was free so long ago (at most twice as long)
    # still counts as free [ours]
    cluster_m: Positive = 0.6  # m, returns so near to each other are of one body:
    # two rings of the LiDAR at 10 m are 0.35 m apart [ours]
    min_points: Count = 3  # returns that make a body [ours]
    max_size_m: Positive = 2.5  # m, what is longer is no mover but a mistake of the map [ours]
    gate: Positive = 4.0  # standard deviations between a track and what may be its observation [ours]
    confirm_hits: Count = 3  # observations before a track may be moving [ours]
    moved_m: Positive = 0.25  # m, from the place of its birth before a track is moving [ours]
    standing_mps: NonNegative = 0.12  # m/s, slower is standing [ours]
    standing_s: Positive = 1.0  # s, a mover that stood so long is given back to the map [ours]
    coast_s: NonNegative = 3.0  # s, a mover that is hidden or out of view is predicted for so long [ours;
    # paper: its horizon, 1.2]
    max_speed_mps: Positive = 6.0  # m/s, a faster track has diverged [ours]
    max_deviation_m: Positive = 2.0  # m, standard deviation of a position;
    # a track less certain has diverged [ours]
    _tracker: Tracker | None = field(init=False, repr=False, default=None)
    _time_s: float = field(init=False, repr=False, default=np.nan)
    _before: tuple[DistanceField, DistanceField] | None = field(init=False, repr=False, default=None)
    _kept_s: float = field(init=False, repr=False, default=-np.inf)

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
            motion=MotionModel(
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
        return without(scan, seen.where[loose][taken]), self._tracker.published(scan.time_s, field)

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
