"""See the surface of a building that is known beforehand, but not quite as it is (paper 3)."""

from __future__ import annotations

import math
from dataclasses import field, replace
from enum import StrEnum
from typing import Annotated, Any, ClassVar

import numpy as np

from uavexp.arrays import Float
from uavexp.errors import WorldError, require
from uavexp.explorer.base import Explorer
from uavexp.inspection.inspection_plan import (
    InspectionPlan,
    Settings,
    plan_inspection,
    upright,
    visited_by_nearest,
)
from uavexp.inspection.reference_surface import reference_field, surface_of_mesh
from uavexp.inspection.view_angle import Weights
from uavexp.inspection.viewpoints import Pattern
from uavexp.inspection.visibility import Camera
from uavexp.log import Inspection
from uavexp.mission import unforeseen
from uavexp.mission.base import Flown
from uavexp.mission.cells_seen import Coverage, reachable_m, visible_anywhere
from uavexp.mission.eye import Eye, ImageEye, RayEye, SeenBy, lens_of
from uavexp.mission.tour_guide import Look, TourGuide
from uavexp.parameters import Count, NonNegative, Positive, Range, Share, between, option
from uavexp.scene import Scene
from uavexp.sensor.depth_camera import Pixels
from uavexp.types import Limits, Observation, Outcome, ReferenceMap, World


class Tour(StrEnum):
    """How the viewpoints are ordered before they are merged and reordered."""

    LIN_KERNIGHAN = "lin_kernighan"
    NEAREST_NEIGHBOUR = "nearest_neighbour"


@option
class Inspect:
    """Inspected = every viewpoint was visited, or found to be blocked, out of reach or kept by movers.

    The reference map is the world's own, or its geometry before blocks were put into it. The
    plan is made on it once, before the flight; the flight knows the truth by its live map only.
    """

    defaults_list: ClassVar[tuple[str, ...]] = ("override /world@_global_.world: facility", "_self_")  # In
    # the facility unless another world is named: its inspection is short
    blocks: Annotated[int, between(0, 100)] = 4  # boxes that stand in the truth and not in the
    # reference [ours]
    block_width_m: Range = (0.3, 0.8)  # m, least and greatest side of a block [ours]
    block_height_m: Range = (0.6, 2.0)  # m, least and greatest height of a block [ours]
    shift_m: NonNegative = 0.0  # m, of the reference against the truth, level, in a drawn direction [ours]
    turn_deg: NonNegative = 0.0  # deg, of the reference against the truth, about the vertical,
    # in a drawn sense [ours]
    unknown_share: Share = 0.0  # of the parts inside the building that the reference lacks [ours]
    gone_share: Share = 0.0  # of the parts inside the building that the reference has and the
    # truth lacks [ours]
    horizontal_fov_deg: Positive = 90.0  # deg, of the inspecting camera, level along the vehicle's yaw [ours]
    vertical_fov_deg: Positive = 73.7  # deg, of the same [ours]
    range_m: Positive = 5.0  # m, farthest distance at which a cell counts as seen [ours]
    incidence_deg: Positive = 70.0  # deg, greatest angle of the line of sight to a cell's normal [ours]
    seen_by: SeenBy = SeenBy.RAYS  # rays: a cell counts as seen when an ideal ray meets it; image: when
    # a depth image shows it, with the noise and frame rate of sensor=rgbd and the vehicle's true attitude;
    # the vehicle, too, then believes its images [ours]
    image_width_px: Pixels = 96  # px, of that image, as of sensor=rgbd; its height follows from the
    # angles [ours]
    cell_m: Positive = 0.2  # m, edge of the cells of the surface [ours]
    cell_tolerance_m: Positive = 0.15  # m, between a cell and the true surface that is seen in
    # its place [ours]
    stand_off_m: Positive = 1.8  # m, of viewpoints from the surface [ours]
    overlap: float = 0.3  # of neighbouring images, as a share [ours]
    least_new_m2: float = 0.1  # m², area that must be new for a view to be worth it [ours]
    clearance_m: Positive = 0.45  # m, of the vehicle's centre at viewpoints [ours]
    tour: Tour = Tour.LIN_KERNIGHAN  # lin_kernighan | nearest_neighbour,
    # how the viewpoints are ordered [ours]
    largest_outlier: Count = 3  # tau_max; clusters smaller than it are merged; 1: none is [ours]
    max_lengthening: float = 0.05  # of the visit by merging, as a share [ours]
    view_adaptation: bool = True  # whether the yaw is chosen anew in flight (algorithm 2) [ours]
    look: Look = Look.AHEAD  # ahead | adaptive, between viewpoints: ahead, or where the adapted yaw looks
    # (needs a sensor all around) [ours]
    occluded_weight: float = 5.0  # of a cell that a blocked viewpoint would have seen; others weigh 1 [ours]
    arrive_m: Positive = 0.35  # m, distance from a viewpoint at which the vehicle has arrived [ours]
    yaw_tolerance_deg: Positive = 4.0  # deg, from the planned yaw at which it has turned there [ours]
    dwell_s: Positive = 6.0  # s, longest stay at a viewpoint [ours]
    again_after_s: NonNegative = 3.0  # s, from putting a viewpoint off until it is tried again [ours]
    blocked_below_m: NonNegative = 0.3  # m, mapped distance below which a viewpoint is blocked [ours]
    rounds: Annotated[int, between(0, 100)] = 1  # of more viewpoints, by the live map,
    # for what the plan's have left unseen [ours]
    rate_hz: Positive = 5.0  # Hz, of the choice of viewpoint and yaw [ours]
    keep_m: NonNegative = 0.5  # m, of the body from predicted movers at a viewpoint; else others come first,
    # or it steps aside [ours]
    patience_s: Positive = 8.0  # s, longest wait for movers on the way to a viewpoint, in all,
    # until it is put off [ours]
    time_base_s: Positive = 120.0  # s, time limit = this ... [ours]
    time_per_viewpoint_s: NonNegative = 8.0  # s, ... plus this for each viewpoint ... [ours]
    time_per_path_spm: NonNegative = 4.0  # s/m, ... plus this for each metre of the tour [ours]
    _guide: TourGuide | None = field(init=False, repr=False, default=None)
    _coverage: Coverage = field(init=False, repr=False)  # of the reference's surface
    _visible: Any = field(init=False, repr=False)  # (N,) cells that can be seen in truth
    _true_coverage: Coverage = field(init=False, repr=False)  # of the true surface, blocks included
    _true_visible: Any = field(init=False, repr=False)  # (M,)
    _eye: Eye = field(init=False, repr=False)
    _rng: np.random.Generator = field(init=False, repr=False)  # of the images' noise
    _time_limit_s: float = field(init=False, repr=False, default=0.0)
    _next_look_s: float = field(init=False, repr=False, default=0.0)

    def __post_init__(self) -> None:
        self._camera(), self._settings(), self._weights()  # each checks what it is made of

    def requires(self, *, stuck_s: float, **_: object) -> None:
        """Refuse a wait that looks like being stuck; a stop is put off once before it is given up."""
        wait_s = 2.0 * self.patience_s
        require(wait_s < stuck_s, f"patience_s must be < stuck_s / 2 = {stuck_s / 2}, got {self.patience_s}")

    def prepare(self, world: World, rng: np.random.Generator) -> World:
        """The world with blocks and without what is gone; its reference as it is known."""
        self._rng = rng
        known = world.reference or ReferenceMap(
            vertices_m=world.vertices_m,
            triangles=world.triangles,
            inspected=np.ones(len(world.triangles), dtype=np.bool_),
        )
        mesh, kept = unforeseen.dropped(
            (known.vertices_m, known.triangles), world.bounds_m, self.unknown_share, rng
        )
        known = ReferenceMap(vertices_m=mesh[0], triangles=mesh[1], inspected=known.inspected[kept])
        known = unforeseen.moved(known, self.shift_m, math.radians(self.turn_deg), rng)
        truth, _ = unforeseen.dropped(
            (world.vertices_m, world.triangles), world.bounds_m, self.gone_share, rng
        )
        world = unforeseen.with_mesh(world, truth)
        world = unforeseen.with_blocks(
            world, self.blocks, self.block_width_m, self.block_height_m, self.clearance_m, rng
        )
        if self.blocks or self.gone_share > 0.0:
            world = unforeseen.with_space(world)
        return unforeseen.with_reference(world, known)

    def reset(self, world: World, scene: Scene, limits: Limits) -> None:
        """Begin a trial in `world`: plan the inspection on its reference map.

        Raises:
            WorldError: no viewpoint can be reached.
        """
        plan = self._plan(world)
        if len(plan.viewpoints) == 0:
            message = (
                f"mission: no viewpoint is within reach of the start with {self.clearance_m:g} m to spare"
            )
            raise WorldError(message)
        camera, settings = self._camera(), self._settings()
        truth = reference_field(world.vertices_m, world.triangles, world.bounds_m)
        surface = surface_of_mesh(world.vertices_m, world.triangles, truth, world.start_m, self.cell_m)
        surface = upright(surface, settings.max_tilt_rad)  # what a level camera looks at, as of the plan's
        self._eye = self._begin_eye(scene)
        self._coverage, self._true_coverage = (
            Coverage(surface=cells, seen_s=np.full(len(cells), np.inf)) for cells in (plan.surface, surface)
        )
        eyes_m = reachable_m(truth, world, self.clearance_m)
        self._visible, self._true_visible = (
            visible_anywhere(truth, scene, camera, cells, eyes_m, self.cell_tolerance_m)
            for cells in (plan.surface, surface)
        )
        self._guide = TourGuide(
            plan=plan,
            camera=camera,
            settings=settings,
            look=self.look,
            view_adaptation=self.view_adaptation,
            believes_rays=self.seen_by is SeenBy.RAYS,
            arrive_m=self.arrive_m,
            yaw_tolerance_rad=math.radians(self.yaw_tolerance_deg),
            dwell_s=self.dwell_s,
            again_after_s=self.again_after_s,
            blocked_below_m=self.blocked_below_m,
            rounds=self.rounds,
            weights=self._weights(),
            rate_hz=self.rate_hz,
            keep_m=self.keep_m,
            patience_s=self.patience_s,
        )
        self._time_limit_s = (
            self.time_base_s
            + self.time_per_viewpoint_s * len(plan.viewpoints)
            + self.time_per_path_spm * plan.statistics.reordered_m
        )
        self._next_look_s = 0.0

    def guide(self, explorer: Explorer) -> Explorer:
        """The tour: no exploration is needed."""
        return self._begun()

    @property
    def target_m(self) -> Float | None:
        """None: the flight ends where the tour does."""
        return None

    @property
    def time_limit_s(self) -> float:
        """Base time plus a time for each viewpoint and for each metre of the tour."""
        return self._time_limit_s

    def outcome(self, flown: Flown, observation: Observation) -> tuple[int, Outcome] | None:
        """INSPECTED when no viewpoint is left; counts what the camera sees on the way."""
        is_over = self._begun().finished
        for k, time_s in enumerate(flown.time_s[:1] if is_over else flown.time_s):
            if time_s >= self._next_look_s - 1e-9:
                self._next_look_s += self._eye.period_s
                self._eye.look(flown.position_m[k], flown.quaternion_wxyz[k], float(time_s))
                for coverage in (self._coverage, self._true_coverage):
                    coverage.count(self._eye, float(time_s))
                if self.seen_by is SeenBy.IMAGE:
                    self._believe(flown.estimated_position_m[k] - flown.position_m[k])
        return (0, Outcome.INSPECTED) if is_over else None

    def findings(self) -> Inspection:
        """Cells and when they were seen, viewpoints and when they were visited."""
        guide, coverage, true = self._begun(), self._coverage, self._true_coverage
        order, viewpoints = guide.plan.order, guide.plan.viewpoints
        return Inspection(
            cell_m=coverage.surface.point_m.astype(np.float32),
            cell_seen_s=coverage.seen_s,
            cell_visible=self._visible | np.isfinite(coverage.seen_s),
            true_cell_seen_s=true.seen_s,
            true_cell_visible=self._true_visible | np.isfinite(true.seen_s),
            viewpoint_m=viewpoints.position_m[order],
            viewpoint_yaw_rad=viewpoints.yaw_rad[order],
            viewpoint_segment=viewpoints.segment[order],
            viewpoint_visited_s=guide.visited_s[order],
        )

    def _believe(self, off_m: Float) -> None:
        """Tell the guide what the last image shows to one who takes himself to be off by (3,)."""
        guide = self._begun()
        surface = replace(guide.plan.surface, point_m=guide.plan.surface.point_m - off_m)
        guide.scanned[self._eye.sees(surface, ~guide.scanned)] = True

    def _begin_eye(self, scene: Scene) -> Eye:
        camera = self._camera()
        if self.seen_by is SeenBy.RAYS:
            return RayEye(scene=scene, camera=camera, tolerance_m=self.cell_tolerance_m)
        lens = lens_of(camera, self.image_width_px)
        lens.reset(scene, self._rng)
        return ImageEye(lens=lens, camera=camera, tolerance_m=self.cell_tolerance_m)

    def _plan(self, world: World) -> InspectionPlan:
        """The plan on the reference map; without one, the truth is known."""
        known = world.reference
        vertices = world.vertices_m if known is None else known.vertices_m
        triangles = world.triangles if known is None else known.triangles
        target = triangles if known is None else triangles[known.inspected]
        settings, start_m = self._settings(), world.start_m
        map_ = reference_field(vertices, triangles, world.bounds_m)
        surface = surface_of_mesh(vertices, target, map_, start_m, self.cell_m)
        plan = plan_inspection(
            surface, map_, self._camera(), start_m, world.flight_bounds_m, settings, world.space
        )
        return plan if self.tour is Tour.LIN_KERNIGHAN else visited_by_nearest(plan, settings)

    def _camera(self) -> Camera:
        return Camera(
            horizontal_fov_rad=math.radians(self.horizontal_fov_deg),
            vertical_fov_rad=math.radians(self.vertical_fov_deg),
            max_range_m=self.range_m,
            max_incidence_rad=math.radians(self.incidence_deg),
        )

    def _settings(self) -> Settings:
        return Settings(
            pattern=Pattern(
                stand_off_m=self.stand_off_m, overlap=self.overlap, least_new_m2=self.least_new_m2
            ),
            clearance_m=self.clearance_m,
            largest_outlier=self.largest_outlier,
            max_lengthening=self.max_lengthening,
        )

    def _weights(self) -> Weights:
        """What has been seen is worth nothing here: else much of it would hide a little that is new."""
        return Weights(occluded=self.occluded_weight, scanned=0.0)

    def _begun(self) -> TourGuide:
        if self._guide is None:
            raise RuntimeError("reset(world) first")
        return self._guide
