"""The global planner of paper 3 (algorithm 1): reference map in, ordered viewpoints out."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from uavexp.arrays import Bool, Float, Int
from uavexp.errors import require
from uavexp.field import DistanceField
from uavexp.inspection import tour_clusters as runs
from uavexp.inspection.reference_surface import Surface
from uavexp.inspection.segmentation import Growing, Segment, segments_of
from uavexp.inspection.tour import open_tour
from uavexp.inspection.travel import is_reachable, travel_lengths, travel_matrix
from uavexp.inspection.travel_lattice import Lattice, lattice_of
from uavexp.inspection.viewpoints import Pattern, Viewpoints, added, needed, pattern_of
from uavexp.inspection.visibility import Camera, Grid, Views, seen_by, views_of, witnesses
from uavexp.space import UNMEASURED, Space

EYE_SPACING = 2  # of the places tried for coverable cells, in cells of the lattice


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Parameters of the global planner.

    Attributes:
        growing: of the segments.
        pattern: of the viewpoints.
        max_tilt_rad: surface whose normal rises or falls more than this is no target: a
            level camera looks at walls.
        clearance_m: of the vehicle's centre at viewpoints and on the way.
        cell_m: horizontal spacing of the travel lattice.
        layer_m: vertical spacing of the travel lattice.
        largest_outlier: tau_max; clusters smaller than it are merged.
        max_lengthening: share by which merging may lengthen the visit; .inf is the paper's
            algorithm, which sets no limit.
        seed: of the tour.
    """

    growing: Growing = field(default_factory=Growing)
    pattern: Pattern = field(default_factory=Pattern)
    max_tilt_rad: float = 0.785398
    clearance_m: float = 0.45
    cell_m: float = 0.2
    layer_m: float = 0.4
    largest_outlier: int = 3
    max_lengthening: float = 0.05
    seed: int = 0

    def __post_init__(self) -> None:
        require(
            0.0 < self.max_tilt_rad <= 1.5708, f"max_tilt_rad must be 0 to pi / 2, got {self.max_tilt_rad}"
        )
        require(self.max_lengthening >= 0.0, f"max_lengthening must be >= 0, got {self.max_lengthening}")
        require(self.largest_outlier >= 1, f"largest_outlier must be >= 1, got {self.largest_outlier}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Statistics:
    """Lengths (from the start, m) and segment switches after each stage."""

    tour_m: float
    tour_switches: int
    merged_m: float
    merged_switches: int
    reordered_m: float
    reordered_switches: int

    @property
    def lengthening(self) -> float:
        """Length after merging and reordering over that of the tour, less 1."""
        return self.reordered_m / self.tour_m - 1.0 if self.tour_m > 0.0 else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class InspectionPlan:
    """What to look at, from where, and in which order; empty when no viewpoint can be reached."""

    surface: Surface  # target cells
    coverable: Bool  # (N,) seen from some reachable place with some yaw, or from a viewpoint
    segments: tuple[Segment, ...]
    viewpoints: Viewpoints
    views: Views  # target cells that each viewpoint sees in M_R
    clusters: runs.Clusters
    travel_m: Float  # (V, V) between viewpoints
    start_travel_m: Float  # (V,) from the start
    lattice: Lattice
    statistics: Statistics

    @property
    def order(self) -> Int:
        """Viewpoints in the order of visit (V,)."""
        return np.array([v for run in self.clusters for v in run], dtype=np.int64)

    @property
    def planned_coverage(self) -> float:
        """Share of the coverable area that the viewpoints see in M_R; 1 when nothing is coverable."""
        area = self.surface.area_m2
        total = float(area[self.coverable].sum())
        seen = seen_by(self.views, len(area))
        return float(area[seen & self.coverable].sum()) / total if total > 0.0 else 1.0


def plan_inspection(
    surface: Surface,
    field_: DistanceField,
    camera: Camera,
    start_m: Float,
    flight_bounds_m: Float,
    settings: Settings | None = None,
    space: Space | None = None,
) -> InspectionPlan:
    """Plan the inspection of a reference map.

    Args:
        surface: of M_R (`reference.surface_of_mesh`, `surface_of_cloud`).
        field_: of M_R.
        camera: that earns coverage.
        start_m: (3,) position of the vehicle.
        flight_bounds_m: (2, 3).
        settings: parameters.
        space: nothing is looked at from where it was never measured.
    """
    settings, space = settings or Settings(), space or Space.all_free()
    targets = upright(surface, settings.max_tilt_rad)
    segments = segments_of(targets, settings.growing)
    lattice = lattice_of(
        field_, flight_bounds_m, start_m, settings.clearance_m, settings.cell_m, settings.layer_m
    )
    grid = Grid(field_.state, field_.origin_m, field_.voxel_size_m)
    eyes = sparse_places(lattice)
    eyes = eyes[space.state_at(eyes) != UNMEASURED]
    witness = witnesses(grid, camera.optics, eyes, targets.point_m, targets.normal)

    def fits(points_m: Float) -> Bool:
        inside = ((points_m >= flight_bounds_m[0]) & (points_m <= flight_bounds_m[1])).all(axis=1)
        measured = space.state_at(points_m) != UNMEASURED
        return np.asarray(inside & measured & is_reachable(lattice, points_m))

    viewpoints = pattern_of(segments, camera, settings.pattern, flight_bounds_m, fits)
    views = _views(grid, camera, viewpoints, targets)
    viewpoints = viewpoints.part(needed(views, targets.area_m2, settings.pattern.least_new_m2))
    views = _views(grid, camera, viewpoints, targets)
    segment_of = np.full(len(targets), -1)
    for number, segment in enumerate(segments):
        segment_of[segment.cells] = number
    viewpoints = added(
        targets, segment_of, viewpoints, views, eyes, witness, grid, camera, settings.pattern, fits
    )
    views = _views(grid, camera, viewpoints, targets)
    travel = travel_matrix(lattice, viewpoints.position_m)
    start_travel = travel_lengths(lattice, start_m[None], viewpoints.position_m)[0]
    clusters, statistics = _ordered(viewpoints.segment, travel, start_travel, settings)
    return InspectionPlan(
        surface=targets,
        coverable=(witness >= 0) | seen_by(views, len(targets)),
        segments=segments,
        viewpoints=viewpoints,
        views=views,
        clusters=clusters,
        travel_m=travel,
        start_travel_m=start_travel,
        lattice=lattice,
        statistics=statistics,
    )


def upright(surface: Surface, max_tilt_rad: float) -> Surface:
    """Its cells whose normal rises or falls no more than this."""
    return surface.part(np.abs(surface.normal[:, 2]) <= np.sin(max_tilt_rad))


def sparse_places(lattice: Lattice) -> Float:
    """Every second node of the lattice along x and y (E, 3): where cells are looked for from."""
    number = lattice.node[::EYE_SPACING, ::EYE_SPACING]
    return np.asarray(lattice.position_m[number[number >= 0]])


def _views(grid: Grid, camera: Camera, viewpoints: Viewpoints, surface: Surface) -> Views:
    return views_of(grid, camera, viewpoints.position_m, viewpoints.yaw_rad, surface.point_m, surface.normal)


def _ordered(
    segment: Int, travel_m: Float, start_m: Float, settings: Settings
) -> tuple[runs.Clusters, Statistics]:
    """Tour, remap, merge, reorder; with what each stage costs and buys."""
    limits = settings.largest_outlier, settings.max_lengthening
    stages = [runs.clusters_of(path_from(start_m, travel_m, settings.seed), segment)]
    stages.append(runs.merge_outliers(stages[0], segment, travel_m, start_m, *limits))
    stages.append(runs.reordered(stages[1], travel_m, start_m))
    lengths = [runs.visit_length_m(stage, travel_m, start_m) for stage in stages]
    changes = [runs.switches(stage) for stage in stages]
    return stages[2], Statistics(
        tour_m=lengths[0],
        tour_switches=changes[0],
        merged_m=lengths[1],
        merged_switches=changes[1],
        reordered_m=lengths[2],
        reordered_switches=changes[2],
    )


def path_from(start_m: Float, travel_m: Float, seed: int) -> Int:
    """All viewpoints in the order of a short path that begins at the vehicle.

    Args:
        start_m: travel lengths from the vehicle to each viewpoint (V,).
        travel_m: between viewpoints (V, V).
        seed: of the search.
    """
    count = len(start_m)
    cost = np.zeros((count + 1, count + 1))
    cost[1:, 1:] = travel_m
    cost[0, 1:] = cost[1:, 0] = start_m
    return open_tour(cost, seed=seed)[1:] - 1


def visited_by_nearest(plan: InspectionPlan, settings: Settings) -> InspectionPlan:
    """The plan with its viewpoints in the order of nearest neighbours, merged and reordered like any."""
    segment, travel, start = plan.viewpoints.segment, plan.travel_m, plan.start_travel_m
    limits = settings.largest_outlier, settings.max_lengthening
    visit = runs.clusters_of(nearest_order(start, travel), segment)
    visit = runs.merge_outliers(visit, segment, travel, start, *limits)
    return replace(plan, clusters=runs.reordered(visit, travel, start))


def nearest_order(start_m: Float, travel_m: Float) -> Int:
    """Always to the nearest viewpoint that is left (V,).

    Args:
        start_m: travel lengths from the vehicle to each viewpoint (V,).
        travel_m: between viewpoints (V, V).
    """
    order: list[int] = []
    cost = start_m.copy()
    for _ in range(len(start_m)):
        cost[order] = np.inf
        order.append(int(np.argmin(cost)))
        cost = travel_m[order[-1]].copy()
    return np.array(order, dtype=np.int64)


def adapt_order(
    plan: InspectionPlan,
    order: Int,
    done: Iterable[int],
    unreachable: Iterable[int],
    position_m: Float,
    worth: float = 0.05,
    seed: int = 0,
) -> Int:
    """Order of the viewpoints that are left, changed only when it is worth it.

    Args:
        plan: of the inspection.
        order: the visit so far, as in `plan.order` or as returned last.
        done: viewpoints already visited.
        unreachable: viewpoints that the live map has turned out to block.
        position_m: (3,) of the vehicle; off the lattice the old order is kept.
        worth: share of the remaining length that a new order must save.
        seed: of the search.
    """
    gone = np.array(sorted({*done, *unreachable}), dtype=np.int64)
    left = order[~np.isin(order, gone)]
    start = travel_lengths(plan.lattice, position_m[None], plan.viewpoints.position_m[left])[0]
    if len(left) < 2 or not np.isfinite(start).all():
        return left
    travel = plan.travel_m[np.ix_(left, left)]
    way = path_from(start, travel, seed)
    kept = runs.visit_length_m((tuple(range(len(left))),), travel, start)
    return left[way] if runs.visit_length_m((tuple(way),), travel, start) < (1.0 - worth) * kept else left
