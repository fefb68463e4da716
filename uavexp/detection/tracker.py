"""Clusters over time: association, birth, confirmation, coasting and death of tracks.

Association is global nearest neighbour: the assignment of greatest likelihood, nothing beyond the
gate (Bar-Shalom, Li and Kirubarajan 2001). What a track observes
is the centre of its whole body, not of the part in sight (`centres_m`).

A confirmed track that no cluster fits may have turned: what its speed would let it reach is its own
if nobody else's. Else it is kept while its place is hidden, out of view or covered by something, and
given up where the sensor sees through it. It does not walk on into an obstacle: it stays where it
meets that, at the speed it had, for nobody knows where to it turned.

A track is one of three things. New: it has not moved yet. A new object may just as well be a
piece of the fixed world that the map got wrong, so its returns stay in the scan. Moving: it
has been seen often enough and has left the place of its birth. Standing: it was moving and
has stood for a while; the map may have it now. Moving and standing ones are published.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from uavexp.arrays import Bool, Float, Int
from uavexp.detection.clusters import Clusters
from uavexp.detection.filters import MoverFilter, new_filter
from uavexp.detection.kalman import Estimate, MotionModel
from uavexp.detection.returns import viewpoint_m
from uavexp.detection.sight import seen_empty
from uavexp.field import DistanceField
from uavexp.scan import Scan
from uavexp.types import Tracks

_NEW_MISSES = 2  # a new track that misses more in a row is forgotten
_EMPTY = 2  # a confirmed one that is seen to be gone more often in a row, too
_NOISES = 3.0  # standard deviations of an observed centre that a turn is allowed besides
_GROWTH = 0.4  # share of a greater size that is believed at once: it may be two bodies that meet
_FAR = 1e6  # cost of a pair outside the gate


class TrackRule(NamedTuple):
    """When tracks are born, confirmed, stopped and given up; meaning in `sensed`."""

    gate: float
    confirm_hits: int
    moved_m: float
    standing_mps: float
    standing_s: float
    coast_s: float
    max_speed_mps: float
    max_deviation_m: float
    motion: MotionModel
    estimate: Estimate = Estimate.KALMAN


@dataclass(slots=True)
class Track:
    """One mover, as far as it is known."""

    identity: int
    filter: MoverFilter
    half_size_m: Float  # (3,) largest seen
    place_m: Float  # (3,) where it was born or last stood
    hits: int = 1
    misses: int = 0  # observations missed in a row
    empty: int = 0  # of them, those that saw through its place
    unseen_s: float = 0.0
    still_s: float = 0.0
    moving: bool = False
    confirmed: bool = False  # has ever been moving

    def grow(self, half_m: Float) -> None:
        """Approach the largest size seen."""
        self.half_size_m = self.half_size_m + _GROWTH * np.maximum(half_m - self.half_size_m, 0.0)

    def predict(self, period_s: float, field: DistanceField) -> None:
        """Move on by a period > 0 s; one that is not in sight stays where it meets an obstacle."""
        before_m = self.filter.position_m.copy()
        self.filter.predict(period_s, self.half_size_m, field)
        if self.unseen_s > 0.0:
            after_m = np.append(self.filter.position_m[:2], before_m[2])  # the floor is in nobody's way
            free_m = field.distance_m(np.stack([before_m, after_m]))
            if free_m[1] < min(free_m[0], float(self.half_size_m[:2].min())):
                self.filter.stay(before_m)

    def judge(self, rule: TrackRule, period_s: float) -> None:
        """Decide whether it moves, after an observation."""
        speed_mps = float(np.linalg.norm(self.filter.velocity_mps))
        self.still_s = 0.0 if speed_mps >= rule.standing_mps else self.still_s + period_s
        gone_m = float(np.linalg.norm(self.filter.position_m - self.place_m))
        if self.moving and self.still_s >= rule.standing_s:
            self.moving, self.place_m = False, self.filter.position_m.copy()
        elif self.hits >= rule.confirm_hits and gone_m >= rule.moved_m and speed_mps >= rule.standing_mps:
            self.moving = self.confirmed = True


@dataclass(slots=True)
class Tracker:
    """The tracks of one flight."""

    rule: TrackRule
    tracks: list[Track] = field(default_factory=list)
    dropped: int = 0
    _born: int = 0

    def predict(self, period_s: float, field: DistanceField) -> tuple[Float, Float]:
        """Move all tracks on by a period >= 0 s; returns both corners (M, 3) of where movers are expected."""
        for track in self.tracks if period_s > 0.0 else ():
            track.predict(period_s, field)
        known = [track for track in self.tracks if track.confirmed]
        centre = np.array([track.filter.position_m for track in known]).reshape(-1, 3)
        half_m = np.array([track.half_size_m for track in known]).reshape(-1, 3)
        return centre - half_m, centre + half_m

    def observe(self, clusters: Clusters, scan: Scan, period_s: float) -> Bool:
        """Take in one scan's clusters, after `predict`.

        Args:
            clusters: what is where the map says free.
            scan: in which they were found.
            period_s: since the last scan; 0 at the first.

        Returns:
            Whether each cluster (K,) belongs to a mover.
        """
        half_m, sensor_m = half_sizes_m(clusters), viewpoint_m(scan)
        owner, observed_m = self._associate(clusters, half_m, sensor_m, period_s)
        self._miss([track for n, track in enumerate(self.tracks) if n not in observed_m], scan, period_s)
        for index, (k, centre_m) in observed_m.items():
            track = self.tracks[index]
            track.grow(half_m[k])
            track.filter.observe(centre_m)
            track.hits, track.misses, track.empty, track.unseen_s = track.hits + 1, 0, 0, 0.0
            track.judge(self.rule, period_s)
        moving = np.array([track.moving for track in self.tracks] + [False])[owner]
        self._bear(clusters, half_m, np.flatnonzero(owner < 0), sensor_m)
        self._bury()
        return moving

    @staticmethod
    def _miss(tracks: list[Track], scan: Scan, period_s: float) -> None:
        """Note that these were not observed."""
        for track in tracks:
            track.misses, track.unseen_s = track.misses + 1, track.unseen_s + period_s
        known = [track for track in tracks if track.confirmed]
        centre_m = np.array([track.filter.position_m for track in known]).reshape(-1, 3)
        half_m = np.array([track.half_size_m for track in known]).reshape(-1, 3)
        for track, empty in zip(known, seen_empty(scan, centre_m, half_m), strict=True):
            track.empty = track.empty + 1 if empty else 0

    def published(self, time_s: float, field: DistanceField) -> Tracks:
        """The movers that are believed to be there, and where they go in this map."""
        known = [track for track in self.tracks if track.confirmed]
        if not known:
            return replace(Tracks.none(time_s), dropped=self.dropped)
        position_m, velocity_mps = zip(
            *(track.filter.estimate(self.rule.estimate) for track in known), strict=True
        )
        return Tracks(
            time_s=time_s,
            identity=np.array([track.identity for track in known]),
            position_m=np.stack(position_m),
            velocity_mps=np.stack(velocity_mps),
            covariance=np.stack([track.filter.covariance for track in known]),
            half_size_m=np.stack([track.half_size_m for track in known]),
            swerve_m=np.stack([track.filter.swerve_m(track.half_size_m, field) for track in known]),
            dropped=self.dropped,
        )

    def _associate(
        self, clusters: Clusters, half_m: Float, sensor_m: Float, period_s: float
    ) -> tuple[Int, dict[int, tuple[int, Float]]]:
        """Index of the track that each cluster (K,) belongs to, -1: to none; each track's cluster and centre.

        The assignment first; then confirmed tracks that fit none take what is left, near enough to where
        they were last seen and no piece of a body just assigned; then clusters inside the predicted box of a
        track are more of the same body.
        """
        owner = np.full(len(clusters), -1)
        if not (self.tracks and len(clusters)):
            return owner, {}
        predicted_m = np.stack([track.filter.position_m for track in self.tracks])[:, None]
        known_m = np.stack([track.half_size_m for track in self.tracks])[:, None]
        seen_m = centres_m(clusters, np.maximum(known_m, half_m), predicted_m, sensor_m)  # (T, K, 3)
        apart_m = seen_m - predicted_m
        spread = np.stack([track.filter.innovation_covariance for track in self.tracks])
        squared = ((apart_m @ np.linalg.inv(spread)) * apart_m).sum(axis=2)
        unlikely = squared + np.linalg.slogdet(spread)[1][:, None]  # -2 log likelihood: or the lost win all
        cost = np.where(squared <= self.rule.gate**2, unlikely, _FAR)
        pairs = _assigned(cost)
        from_m = np.stack([track.filter.seen_m for track in self.tracks])[:, None]
        turned_m = np.linalg.norm(seen_m - from_m, axis=2)
        free = np.isin(np.arange(len(self.tracks)), [t for t, _ in pairs], invert=True)[:, None]
        free = free & np.isin(np.arange(len(clusters)), [k for _, k in pairs], invert=True)
        middle_m = 0.5 * (clusters.low_m + clusters.high_m)
        apart_m = np.abs(middle_m - predicted_m)
        noise_m = _NOISES * self.rule.motion.position_noise_m
        in_box: Bool = np.asarray((apart_m <= known_m + noise_m).all(axis=2))
        free = free & ~in_box[[t for t, _ in pairs]].any(
            axis=0
        )  # another piece of a body that has been seen is nobody's turn
        pairs += _assigned(np.where(free & (turned_m <= self._reach_m(period_s)[:, None]), turned_m, _FAR))
        for t, k in pairs:
            owner[k] = t
        inside: Bool = np.asarray((apart_m <= known_m).all(axis=2))
        more = (owner < 0) & inside.any(axis=0)
        owner[more] = np.argmax(inside[:, more], axis=0)
        return owner, {t: (k, seen_m[t, k]) for t, k in pairs}

    def _reach_m(self, period_s: float) -> Float:
        """How far (T,) from where it was last seen each track may be by now; new ones: -1."""
        noise_m = _NOISES * self.rule.motion.position_noise_m
        return np.array([
            float(np.linalg.norm(track.filter.velocity_mps)) * (track.unseen_s + period_s) + noise_m
            if track.confirmed
            else -1.0
            for track in self.tracks
        ])  # fmt: skip

    def _bear(self, clusters: Clusters, half_m: Float, new: Int, sensor_m: Float) -> None:
        """Begin a track at each of these clusters."""
        nothing = np.full((len(clusters), 3), np.nan)
        centre_m = centres_m(clusters, half_m, nothing, sensor_m)
        for k in new:
            filter_ = new_filter(centre_m[k], self.rule.motion, self.rule.estimate)
            self.tracks.append(Track(self._born, filter_, half_m[k], centre_m[k]))
            self._born += 1

    def _bury(self) -> None:
        """Give up what was not seen for long, and filters that diverged."""
        rule = self.rule
        self.tracks = [
            track
            for track in self.tracks
            if (track.empty <= _EMPTY if track.confirmed else track.misses <= _NEW_MISSES)
            and track.unseen_s <= rule.coast_s
        ]
        sound = [
            track for track in self.tracks if track.filter.is_sound(rule.max_speed_mps, rule.max_deviation_m)
        ]
        self.dropped += len(self.tracks) - len(sound)
        self.tracks = sound


def _assigned(cost: Float) -> list[tuple[int, int]]:
    """Pairs of row and column of the least total cost; none that costs `_FAR`."""
    from scipy.optimize import linear_sum_assignment

    pairs = zip(*linear_sum_assignment(cost), strict=True)
    return [(int(t), int(k)) for t, k in pairs if cost[t, k] < _FAR]


def centres_m(clusters: Clusters, half_m: Float, predicted_m: Float, sensor_m: Float) -> Float:
    """Centres (..., K, 3) of bodies of which the clusters are the part in sight.

    A body is as wide as deep, so its centre is half its width behind the nearest point. Across
    the line of sight and upwards the part in sight lies within the body: of the centres for
    which it does, the one nearest to the prediction (a body half hidden does not seem to slow
    down); the middle when the part is larger than the body was believed to be.

    Args:
        clusters: K of them.
        half_m: (..., K, 3) of the whole bodies.
        predicted_m: (..., K, 3) of their centres; NaN: the middle.
        sensor_m: (3,).
    """
    near, right, left, low, high = clusters.span_m.T
    ahead, across = clusters.sight, clusters.sight[:, ::-1] * [-1.0, 1.0]
    wide_m, tall_m = half_m[..., 0], half_m[..., 2]
    expected_m = ((predicted_m - sensor_m)[..., :2] * across).sum(axis=-1)
    sideways_m = _within(expected_m, left - wide_m, right + wide_m)[..., None]
    level_m = sensor_m[:2] + (near + wide_m)[..., None] * ahead + sideways_m * across
    height_m = _within(predicted_m[..., 2], high - tall_m, low + tall_m)
    return np.concatenate([level_m, height_m[..., None]], axis=-1)


def _within(expected: Float, low: Float, high: Float) -> Float:
    """The expected value cut to [low, high]; their mean when that is empty or nothing is expected."""
    inside = np.minimum(np.maximum(expected, low), high)
    return np.where((low < high) & np.isfinite(expected), inside, 0.5 * (low + high))


def half_sizes_m(clusters: Clusters) -> Float:
    """Half sizes (K, 3) of what is in sight; the footprint is square, for only the width is seen whole."""
    _, right, left, low, high = clusters.span_m.T
    return 0.5 * np.stack([left - right, left - right, high - low], axis=1)
