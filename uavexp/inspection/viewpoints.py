"""Viewpoints v = (p, yaw) of segments: a linear pattern, and what it leaves unseen.

Each segment gets rows of viewpoints along its principal direction, facing it, at the
stand-off; spaced so that neighbouring images share `overlap`. A viewpoint that does not lie
in reachable free space is moved: nearer to the surface, sideways or up and down, the
smallest move first; without any it is dropped. Viewpoints that add next to nothing to what
the others see are left out, those of small segments first [ours]. Where cells stay unseen
that some reachable place does see, viewpoints are added [ours].
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from uavexp.arrays import Bool, Float, Int
from uavexp.errors import require, require_positive
from uavexp.inspection.reference_surface import Surface
from uavexp.inspection.segmentation import Segment
from uavexp.inspection.visibility import Camera, Grid, Views, seen_by, views_of

Fits = Callable[[Float], Bool]  # whether the vehicle can be at points (N, 3) -> (N,)

NEARER = (1.0, 0.8, 0.6, 0.45)  # stand-offs tried, as shares of the wanted one
SHIFTS = (0.0, -0.15, 0.15, -0.3, 0.3)  # moves tried along and up, as shares of the footprint


@dataclass(frozen=True, slots=True, kw_only=True)
class Pattern:
    """How viewpoints stand before a segment.

    Attributes:
        stand_off_m: distance of the camera from the segment's box.
        overlap: share of an image that the next one repeats, along and upwards.
        least_new_m2: area that a viewpoint alone must see to be worth a visit.
    """

    stand_off_m: float = 1.8
    overlap: float = 0.3
    least_new_m2: float = 0.06

    def __post_init__(self) -> None:
        require_positive(stand_off_m=self.stand_off_m, least_new_m2=self.least_new_m2)
        require(0.0 <= self.overlap < 1.0, f"overlap must be >= 0 and < 1, got {self.overlap}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Viewpoints:
    """Places and yaws to look from, in the order in which they were made."""

    position_m: Float  # (V, 3)
    yaw_rad: Float  # (V,)
    segment: Int  # (V,) that each belongs to

    def __len__(self) -> int:
        return int(self.position_m.shape[0])

    def part(self, chosen: Bool | Int) -> Viewpoints:
        """Some of the viewpoints."""
        return Viewpoints(
            position_m=self.position_m[chosen], yaw_rad=self.yaw_rad[chosen], segment=self.segment[chosen]
        )


def joined(first: Viewpoints, second: Viewpoints) -> Viewpoints:
    """Viewpoints of both, one after the other."""
    return Viewpoints(
        position_m=np.concatenate([first.position_m, second.position_m]),
        yaw_rad=np.concatenate([first.yaw_rad, second.yaw_rad]),
        segment=np.concatenate([first.segment, second.segment]),
    )


def pattern_of(
    segments: tuple[Segment, ...], camera: Camera, pattern: Pattern, flight_bounds_m: Float, fits: Fits
) -> Viewpoints:
    """Pattern viewpoints of all segments, moved or dropped where the vehicle does not fit."""
    places, yaws, owners = [np.zeros((0, 3))], [np.zeros(0)], [np.zeros(0, dtype=np.int64)]
    for number, segment in enumerate(segments):
        stand_off = _stand_off(segment, camera, pattern, flight_bounds_m, fits)
        wanted, footprint = _grid_before(segment, camera, pattern, flight_bounds_m, stand_off)
        kept = _moved(wanted, segment, stand_off, footprint, flight_bounds_m, fits)
        places.append(kept)
        yaws.append(np.full(len(kept), _wrapped(segment.yaw_rad + math.pi)))
        owners.append(np.full(len(kept), number))
    return Viewpoints(
        position_m=np.concatenate(places), yaw_rad=np.concatenate(yaws), segment=np.concatenate(owners)
    )


def _stand_off(
    segment: Segment, camera: Camera, pattern: Pattern, flight_bounds_m: Float, fits: Fits
) -> float:
    """The largest stand-off at which half of the segment's pattern fits; the wanted one if none."""
    for share in NEARER:
        stand_off = share * pattern.stand_off_m
        wanted, _ = _grid_before(segment, camera, pattern, flight_bounds_m, stand_off)
        if 2 * int(np.count_nonzero(fits(wanted))) >= len(wanted):
            return stand_off
    return pattern.stand_off_m


def _grid_before(
    segment: Segment, camera: Camera, pattern: Pattern, flight_bounds_m: Float, stand_off_m: float
) -> tuple[Float, Float]:
    """Wanted places (N, 3) at a stand-off, row by row, and the image's width and height there (2,)."""
    angles = np.array([camera.horizontal_fov_rad, camera.vertical_fov_rad])
    footprint = 2.0 * stand_off_m * np.tan(0.5 * angles)
    across = _spread(segment.size_m[0], footprint[0], pattern.overlap)
    up = _spread(segment.size_m[2], footprint[1], pattern.overlap)
    height = np.clip(segment.centre_m[2] + up, flight_bounds_m[0, 2], flight_bounds_m[1, 2])
    height = np.unique(np.round(height, 6))
    middle = segment.centre_m + (0.5 * segment.size_m[1] + stand_off_m) * segment.facing
    places = middle + across[None, :, None] * segment.along
    places = np.repeat(places, len(height), axis=0)
    places[:, :, 2] = height[:, None]
    places[1::2] = places[1::2, ::-1]  # to and fro
    return places.reshape(-1, 3), footprint


def _spread(extent: float, image: float, overlap: float) -> Float:
    """Offsets from the middle of images that cover an extent, evenly, with at least the overlap."""
    count = 1 + max(0, math.ceil((extent - image) / (image * (1.0 - overlap)) - 1e-9))
    reach = max(0.0, 0.5 * (extent - image))
    return np.linspace(-reach, reach, count) if count > 1 else np.zeros(1)


def _moved(
    wanted: Float, segment: Segment, stand_off_m: float, footprint: Float, flight_bounds_m: Float, fits: Fits
) -> Float:
    """The places, each by the smallest move that makes it fit; those that none does are dropped."""
    moves = [
        (nearer - 1.0) * stand_off_m * segment.facing
        + across * footprint[0] * segment.along
        + np.array([0.0, 0.0, up * footprint[1]])
        for nearer in NEARER
        for across in SHIFTS
        for up in SHIFTS
    ]
    move = np.array(sorted(moves, key=lambda one: round(float(np.linalg.norm(one)), 9)))
    tried = wanted[:, None] + move
    tried[..., 2] = np.clip(tried[..., 2], flight_bounds_m[0, 2], flight_bounds_m[1, 2])
    good = fits(tried.reshape(-1, 3)).reshape(tried.shape[:2])
    first = good.argmax(axis=1)
    return np.asarray(tried[np.arange(len(wanted)), first][good.any(axis=1)])


def needed(views: Views, area_m2: Float, least_m2: float) -> Bool:
    """Viewpoints (V,) that are left when the last ones go first whose own share is too small.

    Viewpoints come with the largest segments first, so furniture goes before walls.

    Args:
        views: cells that each viewpoint sees.
        area_m2: of the cells (N,).
        least_m2: area that no other viewpoint left sees.
    """
    keep = np.ones(len(views.starts) - 1, dtype=np.bool_)
    count = np.bincount(views.cells, minlength=len(area_m2))
    for view in range(len(keep) - 1, -1, -1):
        cells = views.of(view)
        if area_m2[cells[count[cells] == 1]].sum() < least_m2:
            keep[view] = False
            count[cells] -= 1
    return keep


def added(
    surface: Surface,
    segment_of: Int,
    viewpoints: Viewpoints,
    views: Views,
    eyes_m: Float,
    witness: Int,
    grid: Grid,
    camera: Camera,
    pattern: Pattern,
    fits: Fits,
) -> Viewpoints:
    """More viewpoints for cells that none sees but some reachable place does.

    Candidates stand before every such cell at the tried stand-offs, and at its witness; the
    one that sees the most unseen area is taken, until it is less than `least_new_m2`.

    Args:
        surface: target cells (N,).
        segment_of: segment (N,) of each, -1 for none.
        viewpoints: so far.
        views: cells that each sees.
        eyes_m: places (E, 3) that were tried for every cell.
        witness: of these the first that sees each cell (N,); -1: none does.
        grid: what blocks sight.
        camera: that looks.
        pattern: stand-off and least area.
        fits: whether the vehicle can be somewhere.
    """
    unseen = np.flatnonzero(~seen_by(views, len(surface)) & (witness >= 0))
    point, normal = surface.point_m[unseen], surface.normal[unseen]
    facing = normal * np.array([1.0, 1.0, 0.0])
    facing /= np.maximum(np.linalg.norm(facing, axis=1), 1e-9)[:, None]
    places = [point + share * pattern.stand_off_m * facing for share in NEARER]
    for place in places:
        place[:, 2] = eyes_m[witness[unseen], 2]
    places.append(eyes_m[witness[unseen]])
    place = np.concatenate(places)
    towards = np.tile(point, (len(places), 1)) - place
    yaw = np.arctan2(towards[:, 1], towards[:, 0])
    kept = np.flatnonzero(fits(place))
    place, yaw = place[kept], yaw[kept]
    seen = views_of(grid, camera, place, yaw, point, normal)
    chosen, owner = _cover(seen, surface.area_m2[unseen], segment_of[unseen], pattern.least_new_m2)
    more = Viewpoints(position_m=place[chosen], yaw_rad=yaw[chosen], segment=owner)
    return joined(viewpoints, more)


def _cover(views: Views, area: Float, owner: Int, least: float) -> tuple[Int, Int]:
    """Views that greedily cover the area, and the segment that most of each one's gain belongs to.

    Gains only fall, so a view is weighed again only when it comes up (Minoux 1978).
    """
    count = len(views.starts) - 1
    open_ = np.ones(len(area), dtype=np.bool_)
    gain = np.array([area[views.of(view)].sum() for view in range(count)])
    chosen, owners = [], []
    while count > 0:
        best = int(np.argmax(gain))
        if gain[best] < least:
            break
        new = views.of(best)[open_[views.of(best)]]
        now = float(area[new].sum())
        if now < gain[best] - 1e-12:
            gain[best] = now
            continue
        chosen.append(best)
        owned = owner[new][owner[new] >= 0]
        owners.append(int(np.bincount(owned).argmax()) if len(owned) else -1)
        open_[new] = False
        gain[best] = 0.0
    return np.array(chosen, dtype=np.int64), np.array(owners, dtype=np.int64)


def _wrapped(angle_rad: float) -> float:
    """The angle within -pi to pi."""
    return math.remainder(angle_rad, 2.0 * math.pi)
