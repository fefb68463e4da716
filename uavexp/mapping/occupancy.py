"""From truncated signed distances to unknown, free and occupied, and from there to the ESDF.

Every observation of a voxel is a signed distance d along the optical axis from the voxel
to the measured surface, positive in front of it, cut off at the truncation. It is fused,
D <- (w D + d) / (w + 1) with capped w (Curless and Levoy 1996), and judged:

- The judged value is the fused D while d agrees with it, so that the sensor's noise is
  averaged out, and d itself where the two contradict each other, so that what appears or
  disappears is not held back by a long history.
- Below `occupied_below_m` it is a hit, above `free_above_m` a miss; in between a miss for a
  voxel that is not occupied, and neither for one that is. Hits and misses move a small clamped
  counter (as the clamped log-odds of Hornung et al. 2013); a voxel becomes occupied when the
  counter reaches `occupied_evidence` and ceases to be when it is back at zero. One hit is not
  enough, so a speckle makes no obstacle; a voxel hit once is not called free either, so no
  first sight of a surface is lost. A hit counts more than a miss: an object narrower than a
  pixel, hit in more than a third of the frames, stands.
- The two limits lie 3/4 of a voxel apart and their sum exceeds a voxel. So a board thinner
  than a voxel, even a sheet, keeps an occupied voxel from either side: if its nearest voxel
  lies s behind the front, then s in front of the back, and min(s, voxel - s) is below half a
  voxel. This holds up to about 60 degrees between the surface's normal and the optical axis,
  beyond which distances along the axis exceed twice the true ones.
- What lies more than `free_above_m` behind a surface is only inferred to be solid: it does not
  overwrite a voxel that was measured to be free. Without this, a thin wall seen from behind
  fills the room in front of it.
- Deeper than `solid_depth_m` behind a surface nothing is judged, and beyond the truncation
  nothing is touched: it stays unknown. The margin between the two keeps noise from deepening
  walls layer by layer, as voxels just beyond the truncation are touched now and then.
- Where evidence fades (`forget_s`, for a vehicle whose position drifts), the weight of every voxel
  sinks by one each `forget_s / max_weight`, and what has none left is unknown again: the longer a
  voxel was in view, the longer it is remembered. What was declared free does not fade.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Float, Float32, Int, Int32, UInt8
from uavexp.errors import WorldError
from uavexp.field import FREE, OCCUPIED, UNKNOWN, DistanceField
from uavexp.mapping.esdf import SignedDistance
from uavexp.mapping.tiles import count_changes, no_changes
from uavexp.memory import blank
from uavexp.types import MapUpdate

# bits of a live voxel's byte: 0-1 state, 2 on the list of changes, 3-7 evidence
_STATE, _LISTED, _EVIDENCE = 3, 4, 3
LARGEST_EVIDENCE = 31
_LONGEST = 30_000  # voxels along an axis: kernels count them in 16 bits
_BYTES_PER_VOXEL = 26  # of a voxel that was seen: TSDF and state 7, ESDF 19; lists are as long as needed


class FusionRule(NamedTuple):
    """The fusion and occupancy rule in the form that kernels take; see the module's text."""

    truncation_m: np.float32
    max_weight: int
    occupied_below_m: np.float32
    free_above_m: np.float32
    solid_depth_m: np.float32
    hit_evidence: int
    miss_evidence: int
    occupied_evidence: int
    max_evidence: int


class Voxels(NamedTuple):
    """The arrays of a map that kernels write, flat, C order."""

    shape: tuple[int, int, int]
    tsdf_m: Float32  # (N,) fused distance
    weight: UInt8  # (N,) of the fused distance
    live: UInt8  # (N,) state and evidence as of now
    state: UInt8  # (N,) as of the last publication
    changes: Int32  # (N,) voxels whose live state has left the published one; a count tells how many


@nb.njit(cache=True, inline="always")
def keeps_free(observed_m: float, fused_m: float, weight: int, byte: int, rule: FusionRule) -> bool:
    """Whether an observation from behind a surface must not touch a voxel measured to be free."""
    measured_free = (fused_m > rule.free_above_m) & (weight >= 2) & ((byte >> _EVIDENCE) == 0)
    return bool(measured_free & (observed_m < -rule.free_above_m))


@nb.njit(cache=True, inline="always")
def judge(
    observed_m: float, fused_before_m: float, weight_before: int, fused_m: float, byte: int, rule: FusionRule
) -> int:
    """Return a voxel's byte after one observation: evidence and state moved, list bit kept."""
    agrees = (weight_before == 0) | (abs(observed_m - fused_before_m) <= rule.free_above_m)
    judged = fused_m if agrees else observed_m
    evidence, state = byte >> _EVIDENCE, byte & _STATE
    hit = min(evidence + rule.hit_evidence, rule.max_evidence)
    missed = (judged > rule.free_above_m) | (state != OCCUPIED)
    miss = max(evidence - rule.miss_evidence, 0) if missed else evidence
    evidence = hit if judged < rule.occupied_below_m else miss
    state = OCCUPIED if evidence >= rule.occupied_evidence else (FREE if evidence == 0 else state)
    return (evidence << _EVIDENCE) | (byte & _LISTED) | state if judged >= -rule.solid_depth_m else byte


@nb.njit(cache=True, inline="always")
def hit_again(byte: int, rule: FusionRule) -> int:
    """Return a voxel's byte after a hit that outweighs the miss its centre may be in the same scan."""
    evidence = min((byte >> _EVIDENCE) + rule.hit_evidence + rule.miss_evidence, rule.max_evidence)
    state = OCCUPIED if evidence >= rule.occupied_evidence else byte & _STATE
    return (evidence << _EVIDENCE) | (byte & _LISTED) | state


@nb.njit(cache=True, error_model="numpy", inline="always")
def fuse(
    observed_m: np.float32, before_m: np.float32, weight: int, byte: int, rule: FusionRule
) -> tuple[np.float32, int, int]:
    """Distance, weight and byte of a voxel after one observation (-inf: none), without a branch."""
    told = (observed_m > -np.inf) & (not keeps_free(observed_m, before_m, weight, byte, rule))
    had = np.float32(weight)
    after_m = (had * before_m + observed_m) / (had + np.float32(1.0))
    moved = judge(observed_m, before_m, weight, after_m, byte, rule)
    more = min(weight + 1, rule.max_weight)
    return after_m if told else before_m, more if told else weight, moved if told else byte


@nb.njit(cache=True, inline="always")
def enlist(voxels: Voxels, at: int, byte: int, count: int) -> int:
    """Store a voxel's byte; list the voxel if its state left the published one. Returns the new count."""
    if (byte & _LISTED) == 0 and (byte & _STATE) != voxels.state[at]:
        byte |= _LISTED
        voxels.changes[count] = at
        count += 1
    voxels.live[at] = byte
    return count


@nb.njit(cache=True)
def _mark_ball(voxels: Voxels, centre: Float, radius: float, count: int) -> int:
    """Make unknown voxels free whose centres lie within `radius` of `centre` (voxel units)."""
    nx, ny, nz = voxels.shape
    for x in range(max(int(centre[0] - radius), 0), min(int(centre[0] + radius) + 1, nx)):
        for y in range(max(int(centre[1] - radius), 0), min(int(centre[1] + radius) + 1, ny)):
            for z in range(max(int(centre[2] - radius), 0), min(int(centre[2] + radius) + 1, nz)):
                dx, dy, dz = x + 0.5 - centre[0], y + 0.5 - centre[1], z + 0.5 - centre[2]
                at = (x * ny + y) * nz + z
                byte = np.int64(voxels.live[at])
                if dx * dx + dy * dy + dz * dz <= radius * radius and (byte & _STATE) == UNKNOWN:
                    count = enlist(voxels, at, byte | FREE, count)
    return count


@nb.njit(cache=True)
def _fade(voxels: Voxels, faded: Int32, by: int, count: int) -> int:
    """Take `by` off the weight of voxels (N,), and what is known of those that have none left."""
    for n in range(faded.shape[0]):
        at = faded[n]
        left: int = max(int(voxels.weight[at]) - by, 0)
        voxels.weight[at] = left
        if left == 0:
            count = enlist(voxels, at, np.int64(voxels.live[at]) & _LISTED | UNKNOWN, count)
    return count


@nb.njit(cache=True)
def _publish(voxels: Voxels, count: int, flipped: Int32, first_seen: Int32) -> tuple[int, int]:
    """Carry listed changes from `live` to `state`; list voxels that flipped and that were first seen."""
    live, state, flips, firsts = voxels.live, voxels.state, 0, 0
    for n in range(count):
        at = voxels.changes[n]
        live[at] = np.int64(live[at]) & ~_LISTED
        before, after = np.int64(state[at]), np.int64(live[at]) & _STATE
        if before == after:
            continue
        if before == UNKNOWN:
            first_seen[firsts] = at
            firsts += 1
        if (before == OCCUPIED) != (after == OCCUPIED):
            flipped[flips] = at
            flips += 1
        state[at] = after
    return flips, firsts


def ball(field: DistanceField, centre_m: Float, radius_m: float) -> Int:
    """Flat indices (N,) of the voxels with their centres in a ball; no other ones are looked at."""
    shape = np.array(field.state.shape)
    low, high = (
        np.clip(np.floor((centre_m + sign * radius_m - field.origin_m) / field.voxel_size_m), 0, shape - 1)
        for sign in (-1.0, 1.0)
    )
    index = np.stack(np.meshgrid(*map(np.arange, low, high + 1), indexing="ij"), axis=-1).reshape(-1, 3)
    voxel = np.asarray(np.ravel_multi_index(tuple(index.astype(np.int64).T), field.state.shape))
    near = np.linalg.norm(field.voxel_centres_m(voxel) - centre_m, axis=1) <= radius_m
    return np.asarray(voxel[near], dtype=np.int64)


def grid_shape(
    bounds_m: Float, voxel_size_m: float, max_memory_mb: float, bytes_per_voxel: int = _BYTES_PER_VOXEL
) -> tuple[int, int, int]:
    """Voxels along each axis that cover `bounds_m`.

    Args:
        bounds_m: (2, 3) lower and upper corner.
        voxel_size_m: edge of a voxel, m.
        max_memory_mb: refuse grids that need more, 10^6 bytes.
        bytes_per_voxel: of everything kept for a voxel; where nothing was seen, little of it is used.

    Raises:
        WorldError: the bounds are not a box, or the grid would need too much memory.
    """
    size = np.asarray(bounds_m, dtype=np.float64)
    if size.shape != (2, 3) or not np.isfinite(size).all() or np.any(size[1] <= size[0]):
        raise WorldError(f"bounds_m must be a finite box (2, 3), lower < upper, got {np.asarray(bounds_m)}")
    count = np.ceil((size[1] - size[0]) / voxel_size_m - 1e-6).clip(1)
    if count.max() > _LONGEST:
        raise WorldError(f"a map may be {_LONGEST} voxels long at most, got {count.max():.0f}")
    need_mb = float(np.prod(count)) * bytes_per_voxel / 1e6
    if need_mb > max_memory_mb or float(np.prod(count)) > 2**31 - 1:
        extent = " x ".join(f"{edge:.6g}" for edge in size[1] - size[0])
        fits_m = math.ceil(100.0 * voxel_size_m * (need_mb / max_memory_mb) ** (1.0 / 3.0) + 0.5) / 100.0
        raise WorldError(
            f"a map of {extent} m at voxel_size_m {voxel_size_m} needs {need_mb:,.0f} MB, allowed are "
            f"{max_memory_mb:,.0f} MB: mapping.voxel_size_m={fits_m:g} fits, or "
            f"mapping.max_memory_mb={math.ceil(need_mb):d}, or give smaller world.flight_bounds_m"
        )
    return int(count[0]), int(count[1]), int(count[2])


class OccupancyMap:
    """TSDF, occupancy and ESDF of one trial on a dense grid; kernels of the backends write the arrays.

    `live` runs ahead with every scan; `state` and the field change at `publish` only.
    """

    def __init__(
        self,
        bounds_m: Float,
        voxel_size_m: float,
        max_distance_m: float,
        max_memory_mb: float,
        fade_s: float = math.inf,
    ) -> None:
        """Begin with everything unknown; weights sink by one each `fade_s`. Refuses as `grid_shape`."""
        self.shape = grid_shape(bounds_m, voxel_size_m, max_memory_mb)
        size = self.shape[0] * self.shape[1] * self.shape[2]
        self.origin_m: Float = np.array(bounds_m[0], dtype=np.float64)
        self.voxel_size_m = voxel_size_m
        self.voxels = Voxels(
            shape=self.shape,
            tsdf_m=blank(size, np.float32),
            weight=blank(size, np.uint8),
            live=blank(size, np.uint8),
            state=blank(size, np.uint8),
            changes=np.empty(size, np.int32),
        )
        self._noted = np.zeros(0, np.int64)  # voxels that are occupied whatever is measured
        self.changed = 0  # how many of the voxels' `changes` are in use
        self._fade_s, self._fades = fade_s, 0  # and how often they have
        self._flipped: Int32 = np.empty(size, np.int32)
        self._first_seen: Int32 = np.empty(size, np.int32)
        self._rays: tuple[Float32, Int32] | None = None
        self._esdf = SignedDistance(self.shape, voxel_size_m, max_distance_m)
        self._tiles = no_changes(self.shape)
        self.field = DistanceField(
            origin_m=self.origin_m,
            voxel_size_m=voxel_size_m,
            max_distance_m=max_distance_m,
            distance=self._esdf.distance,
            state=self.voxels.state.reshape(self.shape),
            changed=self._tiles,
        )

    def mark_free(self, centre_m: Float, radius_m: float) -> None:
        """Make what is still unknown in a ball free; measurements override it like any other."""
        centre = (np.asarray(centre_m, dtype=np.float64) - self.origin_m) / self.voxel_size_m
        self.changed = _mark_ball(self.voxels, centre, radius_m / self.voxel_size_m, self.changed)

    def note_obstacle(self, centre_m: Float, radius_m: float) -> None:
        """Make a ball occupied, for good."""
        noted = ball(self.field, centre_m, radius_m)
        self._noted = np.unique(np.concatenate([self._noted, noted]))

    def ray_arrays(self) -> tuple[Float32, Int32]:
        """Scratch of `rays`, made at first use: observations (N,), all inf, and a list of voxels (N,)."""
        if self._rays is None:
            size = self.voxels.tsdf_m.size
            self._rays = np.full(size, np.inf, np.float32), np.empty(size, np.int32)
        return self._rays

    def fade(self, time_s: float) -> Int32:
        """Let evidence fade up to now; returns the voxels (N,) whose weight sank, flat and ascending."""
        by = int(time_s / self._fade_s) - self._fades
        if by <= 0:
            return np.empty(0, np.int32)
        self._fades += by
        faded = np.flatnonzero(self.voxels.weight).astype(np.int32)
        self.changed = _fade(self.voxels, faded, by, self.changed)
        count_changes(faded[self.voxels.weight[faded] == 0], self.shape, self._tiles)
        return faded

    def publish(self, time_s: float) -> MapUpdate:
        """Bring state and field up to what was integrated; return what changed since last time."""
        for at in self._noted.tolist():
            byte = (LARGEST_EVIDENCE << _EVIDENCE) | OCCUPIED | (int(self.voxels.live[at]) & _LISTED)
            self.changed = enlist(self.voxels, at, byte, self.changed)
        flips, firsts = _publish(self.voxels, self.changed, self._flipped, self._first_seen)
        self.changed = 0
        state = self.voxels.state.reshape(self.shape)
        update = self._esdf.update(time_s, state, self._flipped[:flips], self._first_seen[:firsts])
        count_changes(update.voxel, self.shape, self._tiles)
        return update
