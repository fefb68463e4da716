"""What counts as seen in truth, and the figures of it, against closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.inspections import START_M, boxes, building, surface_in
from tests.logs import make_log, make_world
from uavexp.arrays import Bool, Float
from uavexp.geometry import quaternion_from_yaw
from uavexp.inspection.reference_surface import Surface, reference_field
from uavexp.inspection.visibility import Camera
from uavexp.log import TrialLog
from uavexp.metrics import coverage as figures
from uavexp.metrics.metric import Flight, measured
from uavexp.mission.cells_seen import Coverage, reachable_m, visible_anywhere
from uavexp.mission.eye import RayEye, is_met
from uavexp.scene import Scene
from uavexp.types import Bodies, Outcome, Shape, World

WALL_X_M, EYE_M = 3.0, np.array([1.0, 0.0, 1.0])


@pytest.fixture
def scene() -> Scene:
    return Scene.from_mesh(*boxes(((WALL_X_M, -4.0, -3.0), (WALL_X_M + 0.2, 4.0, 5.0))))


def wall_cells(x_m: float = WALL_X_M) -> Surface:
    y, z = np.meshgrid(np.arange(-2.9, 3.0, 0.2), np.arange(-0.9, 3.0, 0.2), indexing="ij")
    point = np.stack([np.full(y.size, x_m), y.ravel(), z.ravel()], axis=1)
    return Surface(
        point_m=point,
        normal=np.tile([-1.0, 0.0, 0.0], (len(point), 1)),
        area_m2=np.full(len(point), 0.04),
        curvature=np.zeros(len(point)),
    )


def met(scene: Scene, cells: Surface) -> Float:
    return is_met(scene, EYE_M, cells.point_m, cells.normal, 0.15)


@pytest.mark.parametrize("off_m", [-0.14, 0.0, 0.14])
def test_a_cell_is_met_when_the_true_surface_is_near_it(scene: Scene, off_m: float) -> None:
    assert met(scene, wall_cells(WALL_X_M + off_m)).all()


@pytest.mark.parametrize("off_m", [-0.16, 0.16])
def test_a_cell_is_not_met_where_the_surface_stands_elsewhere(scene: Scene, off_m: float) -> None:
    assert not met(scene, wall_cells(WALL_X_M + off_m)).any()


def test_a_person_hides_exactly_its_shadow(scene: Scene) -> None:
    radius_m = 0.3
    person = Bodies(
        time_s=0.0,
        shape=np.array([Shape.CYLINDER], dtype=np.uint8),
        half_size_m=np.array([[radius_m, radius_m, 9.0]]),
        position_m=np.array([[2.0, 0.0, 1.0]]),
        velocity_mps=np.zeros((1, 3)),
    )
    scene.place(person)
    cells = wall_cells()
    bearing = np.abs(np.arctan2(cells.point_m[:, 1], WALL_X_M - EYE_M[0]))
    np.testing.assert_array_equal(met(scene, cells), bearing > math.asin(radius_m / 1.0))


def test_only_what_is_framed_counts_and_the_first_time_stays(scene: Scene) -> None:
    camera, cells = Camera(max_incidence_rad=math.radians(80.0)), wall_cells()
    eye = RayEye(scene=scene, camera=camera, tolerance_m=0.15)
    seen = Coverage(surface=cells, seen_s=np.full(len(cells), np.inf))

    def look(time_s: float, yaw_rad: float) -> None:
        eye.look(EYE_M, quaternion_from_yaw(yaw_rad), time_s)
        seen.count(eye, time_s)

    look(1.0, math.pi)
    assert np.isinf(seen.seen_s).all()
    look(2.0, 0.0)
    x, y, z = (cells.point_m - EYE_M).T
    framed = (np.abs(y) <= x) & (np.abs(z) <= math.tan(0.5 * camera.vertical_fov_rad) * x)
    np.testing.assert_array_equal(np.isfinite(seen.seen_s), framed)
    look(3.0, 0.3)
    assert (seen.seen_s[framed] == 2.0).all()
    assert (seen.seen_s == 3.0).any()


def visible(world: World, surface: Surface) -> Bool:
    field = reference_field(world.vertices_m, world.triangles, world.bounds_m)
    eyes_m = reachable_m(field, world, 0.45)
    return visible_anywhere(field, Scene(world), Camera(), surface, eyes_m, 0.15)


def test_all_of_an_empty_hall_is_visible_and_nothing_that_is_gone() -> None:
    hall = building()
    world = replace(
        make_world([]),
        vertices_m=hall.vertices_m,
        triangles=hall.triangles,
        bounds_m=np.array([[-0.2, -0.2, -0.2], [6.2, 4.2, 2.8]]),
        flight_bounds_m=hall.flight_bounds_m,
        start_m=START_M,
    )
    surface = surface_in(hall)
    walls = surface.part(np.abs(surface.normal[:, 2]) < 0.5)
    seen = visible(world, walls)
    assert seen.mean() > 0.97
    without = replace(world, triangles=world.triangles[: 6 * 12])  # less the partition
    after = visible(without, walls)
    inner = (np.abs(walls.point_m[:, 0] - 3.06) < 0.1) & (walls.point_m[:, 1] < 2.4)
    inner &= walls.point_m[:, 1] > 0.2
    inner &= np.abs(walls.point_m[:, 2] - 1.3) < 1.0
    assert inner.sum() > 50
    assert seen[inner].mean() > 0.9
    assert not after[inner].any()


def inspected(outcome: Outcome = Outcome.INSPECTED) -> tuple[TrialLog, World]:
    log = make_log(
        lambda t: np.stack([t, 0.0 * t, 0.0 * t + 1.0], axis=1),
        lambda t: np.tile([1.0, 0.0, 0.0], (len(t), 1)),
        outcome=outcome,
        cell_m=np.zeros((5, 3), dtype=np.float32),
        cell_seen_s=np.array([1.0, 2.0, np.inf, 4.0, np.inf]),
        cell_visible=np.array([True, True, True, True, False]),
        true_cell_seen_s=np.array([1.0, np.inf, np.inf, np.inf, 2.0]),
        true_cell_visible=np.array([True, True, True, False, True]),
        viewpoint_m=np.array([[1.0, 9.0, 1.2], [4.0, 9.0, 1.2], [4.0, 5.0, 1.2]]),
        viewpoint_yaw_rad=np.zeros(3),
        viewpoint_segment=np.array([0, 0, 1]),
        viewpoint_visited_s=np.array([1.0, np.inf, 3.0]),
    )
    return log, make_world([])


def test_figures_of_an_inspection() -> None:
    log, world = inspected()
    assert measured(figures.METRICS, Flight(log=log, world=world)) == {
        "coverage": 0.6,
        "coverage_visible": 0.75,
        "coverage_truth": 0.5,
        "viewpoints": 3,
        "visited": 2,
        "unreachable": 1.0,
        "segment_switches": 1,
        "tour_length_m": 3.0 + 3.0 + 4.0,
        "scene_kind": "",
    }
    np.testing.assert_array_equal(
        figures.over_time(log, np.array([0.0, 1.0, 3.9, 4.0, 9.0])), [0.0, 0.25, 0.5, 0.75, 0.75]
    )


def test_a_flight_that_ran_out_of_time_knows_nothing_unreachable() -> None:
    assert math.isnan(figures.unreachable(inspected(Outcome.TIMEOUT)[0]))


def test_other_missions_have_no_coverage() -> None:
    log = make_log(lambda t: np.zeros((len(t), 3)), lambda t: np.zeros((len(t), 3)))
    measures = measured(figures.METRICS, Flight(log=log, world=make_world([])))
    assert math.isnan(measures["coverage"])
    assert math.isnan(measures["coverage_visible"])
    assert measures["viewpoints"] == 0
    assert measures["scene_kind"] == ""
