"""Region growing on normals and curvature, and the upright box of each segment."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba as nb
import numpy as np

from uavexp.arrays import Float, Int, Int32
from uavexp.errors import require, require_positive
from uavexp.inspection.normals import neighbours
from uavexp.inspection.reference_surface import Surface

MAX_NEIGHBOURS = 32


@dataclass(frozen=True, slots=True, kw_only=True)
class Growing:
    """When a cell belongs to a region (Rabbani et al. 2006), with a bound on how far one bends.

    Attributes:
        radius_m: within which cells are neighbours.
        max_step_rad: greatest angle between the normals of neighbours in one region.
        max_bend_rad: greatest angle of a normal to that of the region's seed: a tunnel's
            lining becomes several facets, each of which one yaw can face [ours].
        max_curvature: above it a cell joins a region but does not carry it on.
        min_area_m2: smaller regions are given to their neighbours.
    """

    radius_m: float = 0.36
    max_step_rad: float = math.radians(20.0)
    max_bend_rad: float = math.radians(40.0)
    max_curvature: float = 0.08
    min_area_m2: float = 0.3

    def __post_init__(self) -> None:
        require_positive(
            radius_m=self.radius_m,
            max_step_rad=self.max_step_rad,
            max_curvature=self.max_curvature,
            min_area_m2=self.min_area_m2,
        )
        require(
            self.max_step_rad <= self.max_bend_rad < math.pi,
            f"max_bend_rad must be >= max_step_rad and < pi, got {self.max_bend_rad}",
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """A piece of surface that faces one way, in an upright box.

    The box's principal direction is horizontal and perpendicular to `yaw_rad`.
    """

    cells: Int  # ascending
    yaw_rad: float  # direction the surface faces, into free space
    centre_m: Float  # (3,) of the box
    size_m: Float  # (3,) along the principal direction, along the normal, upwards
    area_m2: float

    @property
    def facing(self) -> Float:
        """Horizontal unit vector (3,) out of the surface."""
        return np.array([math.cos(self.yaw_rad), math.sin(self.yaw_rad), 0.0])

    @property
    def along(self) -> Float:
        """Horizontal unit vector (3,) of the principal direction."""
        return np.array([-math.sin(self.yaw_rad), math.cos(self.yaw_rad), 0.0])


def segments_of(surface: Surface, growing: Growing | None = None) -> tuple[Segment, ...]:
    """Segments of a surface, largest first; cells that belong to none are in no segment."""
    growing = growing or Growing()
    if len(surface) == 0:
        return ()
    region = regions(surface, growing)
    made = [_boxed(surface, np.flatnonzero(region == n)) for n in range(region.max() + 1)]
    order = np.lexsort((np.arange(len(made)), -np.round([one.area_m2 for one in made], 9)))
    return tuple(made[n] for n in order)


def regions(surface: Surface, growing: Growing) -> Int:
    """Region of each cell (N,), from 0, -1 for none."""
    near = neighbours(surface.point_m, growing.radius_m, MAX_NEIGHBOURS)
    order = np.lexsort((np.arange(len(surface)), surface.curvature))
    region = _grow(
        surface.normal,
        surface.curvature,
        near,
        order,
        math.cos(growing.max_step_rad),
        math.cos(growing.max_bend_rad),
        growing.max_curvature,
    )
    area = np.bincount(region, surface.area_m2)
    region[area[region] < growing.min_area_m2] = -1
    _adopt(surface.normal, near, region, math.cos(1.5 * growing.max_bend_rad))
    kept, compact = np.unique(region, return_inverse=True)
    return np.asarray(compact - (1 if kept[0] < 0 else 0), dtype=np.int64)


@nb.njit(cache=True)
def _grow(
    normal: Float, curvature: Float, near: Int32, order: Int, step: float, bend: float, max_curvature: float
) -> Int:
    """Region of each cell; seeds in the given order, neighbours breadth first."""
    cells = normal.shape[0]
    region = np.full(cells, -1, dtype=np.int64)
    queue = np.empty(cells, dtype=np.int64)
    count = 0
    for seed in order:
        if region[seed] >= 0:
            continue
        region[seed] = count
        queue[0] = seed
        head, tail = 0, 1
        while head < tail:
            here = queue[head]
            head += 1
            for other in near[here]:
                if other < 0 or region[other] >= 0:
                    continue
                turn, bent = 0.0, 0.0
                for axis in range(3):
                    turn += normal[here, axis] * normal[other, axis]
                    bent += normal[seed, axis] * normal[other, axis]
                if turn < step or bent < bend:
                    continue
                region[other] = count
                if curvature[other] <= max_curvature:
                    queue[tail] = other
                    tail += 1
        count += 1
    return region


@nb.njit(cache=True)
def _adopt(normal: Float, near: Int32, region: Int, least: float) -> None:
    """Give cells without a region that of the neighbour most alike, round by round."""
    changed = True
    while changed:
        changed = False
        before = region.copy()
        for cell in range(region.shape[0]):
            if before[cell] >= 0:
                continue
            best = least
            for other in near[cell]:
                if other >= 0 and before[other] >= 0:
                    alike = 0.0
                    for axis in range(3):
                        alike += normal[cell, axis] * normal[other, axis]
                    if alike > best:
                        best = alike
                        region[cell] = before[other]
                        changed = True


def _boxed(surface: Surface, cells: Int) -> Segment:
    """A segment of these cells; its yaw is that of their mean normal, weighted by area."""
    area = surface.area_m2[cells]
    mean = (surface.normal[cells] * area[:, None]).sum(axis=0)
    yaw = math.atan2(mean[1], mean[0])
    facing, along = (
        np.array([math.cos(yaw), math.sin(yaw), 0.0]),
        np.array([-math.sin(yaw), math.cos(yaw), 0.0]),
    )
    frame = np.stack([along, facing, np.array([0.0, 0.0, 1.0])])
    inside = surface.point_m[cells] @ frame.T
    low, high = inside.min(axis=0), inside.max(axis=0)
    return Segment(
        cells=cells,
        yaw_rad=yaw,
        centre_m=0.5 * (low + high) @ frame,
        size_m=high - low,
        area_m2=float(area.sum()),
    )
