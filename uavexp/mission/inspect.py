"""See the surface of a building that is known beforehand, but not quite as it is (paper 3)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np

from uavexp.arrays import Float
from uavexp.errors import WorldError, require, require_non_negative, require_option, require_positive
from uavexp.explorer.base import Explorer
from uavexp.geometry import yaw_of
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
from uavexp.mission.coverage import Coverage, reachable_m, visible_anywhere
from uavexp.mission.tour_guide import Look, TourGuide
from uavexp.scene import Scene
from uavexp.types import Limits, Observation, Outcome, State, Surface, World

LOOK_S = 0.2  # between the instants at which the camera earns coverage


class Tour(StrEnum):
    """How the viewpoints are ordered before they are merged and reordered."""

    LIN_KERNIGHAN = "lin_kernighan"
    NEAREST_NEIGHBOUR = "nearest_neighbour"


@dataclass(slots=True, kw_only=True)
class Inspect:
    """Inspected = every viewpoint was visited, or found to be blocked, out of reach or kept by movers.

    The reference map is the world's own, or its geometry before blocks were put into it. The
    plan is made on it once, before the flight; the flight knows the truth by its live map only.

    Attributes:
        blocks: boxes that stand in the truth and not in the reference.
        block_width_m: least and greatest side of a block.
        block_height_m: least and greatest height of a block.
        shift_m: of the reference against the truth, level, in a drawn direction.
        turn_deg: of the reference against the truth, about the vertical, in a drawn sense.
        unknown_share: of the parts inside the building that the reference lacks.
        gone_share: of the parts inside the building that the reference has and the truth lacks.
        horizontal_fov_deg: of the inspecting camera, level along the vehicle's yaw.
        vertical_fov_deg: of the same.
        range_m: farthest distance at which a cell counts as seen.
        incidence_deg: greatest angle of the line of sight to a cell's normal.
        cell_m: edge of the cells of the surface.
        cell_tolerance_m: between a cell and the true surface that is seen in its place.
        stand_off_m: of viewpoints from the surface.
        overlap: of neighbouring images, as a share.
        least_new_m2: area that must be new for a view to be worth it.
        clearance_m: of the vehicle's centre at viewpoints.
        tour: how the viewpoints are ordered.
        largest_outlier: tau_max; clusters smaller than it are merged; 1: none is.
        max_lengthening: of the visit by merging, as a share.
        view_adaptation: whether the yaw is chosen anew in flight (algorithm 2).
        look: between viewpoints: ahead, or where the adapted yaw looks (needs a sensor all around).
        occluded_weight: of a cell that a blocked viewpoint would have seen; others weigh 1.
        arrive_m: distance from a viewpoint at which the vehicle has arrived.
        yaw_tolerance_deg: from the planned yaw at which it has turned there.
        dwell_s: longest stay at a viewpoint.
        again_after_s: from putting a viewpoint off until it is tried again.
        blocked_below_m: mapped distance below which a viewpoint is blocked.
        rounds: of more viewpoints, by the live map, for what the plan's have left unseen.
        rate_hz: of the choice of viewpoint and yaw.
        keep_m: of the body from predicted movers at a viewpoint; while one comes nearer, others are
            visited first, or the vehicle steps aside.
        patience_s: longest wait for movers on the way to a viewpoint, in all, until it is put off.
        time_base_s: time limit = this ...
        time_per_viewpoint_s: ... plus this for each viewpoint ...
        time_per_path_spm: ... plus this for each metre of the tour.
    """

    blocks: int = 4
    block_width_m: Sequence[float] = (0.3, 0.8)
    block_height_m: Sequence[float] = (0.6, 2.0)
    shift_m: float = 0.0
    turn_deg: float = 0.0
    unknown_share: float = 0.0
    gone_share: float = 0.0
    horizontal_fov_deg: float = 90.0
    vertical_fov_deg: float = 73.7
    range_m: float = 5.0
    incidence_deg: float = 70.0
    cell_m: float = 0.2
    cell_tolerance_m: float = 0.15
    stand_off_m: float = 1.8
    overlap: float = 0.3
    least_new_m2: float = 0.1
    clearance_m: float = 0.45
    tour: Tour = Tour.LIN_KERNIGHAN
    largest_outlier: int = 3
    max_lengthening: float = 0.05
    view_adaptation: bool = True
    look: Look = Look.AHEAD
    occluded_weight: float = 5.0
    arrive_m: float = 0.35
    yaw_tolerance_deg: float = 4.0
    dwell_s: float = 6.0
    again_after_s: float = 3.0
    blocked_below_m: float = 0.3
    rounds: int = 1
    rate_hz: float = 5.0
    keep_m: float = 0.5
    patience_s: float = 8.0
    time_base_s: float = 120.0
    time_per_viewpoint_s: float = 8.0
    time_per_path_spm: float = 4.0
    _guide: TourGuide | None = field(init=False, repr=False, default=None)
    _coverage: Coverage = field(init=False, repr=False)  # of the reference's surface
    _visible: Any = field(init=False, repr=False)  # (N,) cells that can be seen in truth
    _true_coverage: Coverage = field(init=False, repr=False)  # of the true surface, blocks included
    _true_visible: Any = field(init=False, repr=False)  # (M,)
    _scene: Scene = field(init=False, repr=False)
    _time_limit_s: float = field(init=False, repr=False, default=0.0)
    _next_look_s: float = field(init=False, repr=False, default=0.0)

    def __post_init__(self) -> None:
        self.tour = require_option("tour", self.tour, Tour)
        self.look = require_option("look", self.look, Look)
        for name in ("blocks", "rounds"):
            require(0 <= getattr(self, name) <= 100, f"{name} must be 0 to 100, got {getattr(self, name)}")
        for name in ("block_width_m", "block_height_m"):
            pair = [float(value) for value in getattr(self, name)]
            require(
                len(pair) == 2 and 0.0 < pair[0] <= pair[1] < math.inf,
                f"{name} must be [least, greatest] > 0, got {pair}",
            )
        for name in ("unknown_share", "gone_share"):
            require(0.0 <= getattr(self, name) <= 1.0, f"{name} must be 0 to 1, got {getattr(self, name)}")
        require_positive(
            cell_m=self.cell_m,
            cell_tolerance_m=self.cell_tolerance_m,
            clearance_m=self.clearance_m,
            arrive_m=self.arrive_m,
            yaw_tolerance_deg=self.yaw_tolerance_deg,
            dwell_s=self.dwell_s,
            rate_hz=self.rate_hz,
            patience_s=self.patience_s,
            time_base_s=self.time_base_s,
        )
        require_non_negative(
            shift_m=self.shift_m,
            turn_deg=self.turn_deg,
            again_after_s=self.again_after_s,
            blocked_below_m=self.blocked_below_m,
            keep_m=self.keep_m,
            time_per_viewpoint_s=self.time_per_viewpoint_s,
            time_per_path_spm=self.time_per_path_spm,
        )
        self._camera(), self._settings(), self._weights()  # each checks what it is made of

    def requires(self, *, stuck_s: float, **_: object) -> None:
        """Refuse a wait that looks like being stuck; a stop is put off once before it is given up."""
        wait_s = 2.0 * self.patience_s
        require(wait_s < stuck_s, f"patience_s must be < stuck_s / 2 = {stuck_s / 2}, got {self.patience_s}")

    def prepare(self, world: World, rng: np.random.Generator) -> World:
        """The world with blocks and without what is gone; its reference as it is known."""
        known = world.reference or Surface(
            vertices_m=world.vertices_m,
            triangles=world.triangles,
            inspected=np.ones(len(world.triangles), dtype=np.bool_),
        )
        mesh, kept = unforeseen.dropped(
            (known.vertices_m, known.triangles), world.bounds_m, self.unknown_share, rng
        )
        known = Surface(vertices_m=mesh[0], triangles=mesh[1], inspected=known.inspected[kept])
        known = unforeseen.moved(known, self.shift_m, math.radians(self.turn_deg), rng)
        truth, _ = unforeseen.dropped(
            (world.vertices_m, world.triangles), world.bounds_m, self.gone_share, rng
        )
        world = unforeseen.with_mesh(world, truth)
        world = unforeseen.with_blocks(
            world, self.blocks, self.block_width_m, self.block_height_m, self.clearance_m, rng
        )
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
        self._scene = scene
        self._coverage, self._true_coverage = (
            Coverage(
                surface=cells,
                camera=camera,
                tolerance_m=self.cell_tolerance_m,
                seen_s=np.full(len(cells), np.inf),
            )
            for cells in (plan.surface, surface)
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
            look=Look(self.look),
            view_adaptation=self.view_adaptation,
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

    def outcome(self, true_state: State, observation: Observation) -> Outcome | None:
        """INSPECTED when no viewpoint is left; counts what the camera sees on the way."""
        if observation.time_s >= self._next_look_s - 1e-9:
            self._next_look_s += LOOK_S
            yaw_rad = yaw_of(true_state.quaternion_wxyz)
            for coverage in (self._coverage, self._true_coverage):
                coverage.look(self._scene, observation.time_s, true_state.position_m, yaw_rad)
        return Outcome.INSPECTED if self._begun().finished else None

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

    def _plan(self, world: World) -> InspectionPlan:
        """The plan on the reference map; without one, the truth is known."""
        known = world.reference
        vertices = world.vertices_m if known is None else known.vertices_m
        triangles = world.triangles if known is None else known.triangles
        target = triangles if known is None else triangles[known.inspected]
        settings, start_m = self._settings(), world.start_m
        map_ = reference_field(vertices, triangles, world.bounds_m)
        surface = surface_of_mesh(vertices, target, map_, start_m, self.cell_m)
        plan = plan_inspection(surface, map_, self._camera(), start_m, world.flight_bounds_m, settings)
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
