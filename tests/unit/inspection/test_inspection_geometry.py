"""Reference surface, segments and viewpoints of buildings whose walls are known exactly."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.inspections import START_M, boxes, building, surface_in, two_rooms
from uavexp.arrays import Bool, Float
from uavexp.errors import ConfigError
from uavexp.inspection.reference_surface import surface_of_cloud
from uavexp.inspection.segmentation import Growing, segments_of
from uavexp.inspection.viewpoints import Pattern, needed, pattern_of
from uavexp.inspection.visibility import Camera, Views

HALL = building()
SURFACE = surface_in(HALL)
WALLS = SURFACE.part(np.abs(SURFACE.normal[:, 2]) < 0.7)
WALL_AREA_M2 = 2.0 * (6.0 + 4.0) * 2.6 + 2.0 * 2.6 * 2.6 + 0.12 * 2.6


def everywhere(points_m: Float) -> Bool:
    return np.ones(len(points_m), dtype=np.bool_)


def test_area_of_the_walls_is_that_of_the_inner_sides_only() -> None:
    assert WALLS.area_m2.sum() == pytest.approx(WALL_AREA_M2, rel=0.04)


def test_normals_point_into_the_hall() -> None:
    ahead = HALL.field.distance_m(WALLS.point_m + 0.25 * WALLS.normal)
    behind = HALL.field.distance_m(WALLS.point_m - 0.05 * WALLS.normal)
    assert np.mean(ahead > behind) > 0.99


def test_flipped_and_shuffled_triangles_give_the_same_cells() -> None:
    rng = np.random.default_rng(100)
    flipped = HALL.triangles[:, ::-1].copy()
    flipped[::2] = HALL.triangles[::2]
    other = HALL._replace(triangles=rng.permutation(flipped))
    found = surface_in(other)
    np.testing.assert_allclose(found.point_m, SURFACE.point_m, atol=1e-6)
    np.testing.assert_allclose(np.abs((found.normal * SURFACE.normal).sum(axis=1)), 1.0, atol=1e-6)


def test_a_corner_that_is_not_a_number_costs_only_its_triangles() -> None:
    vertices, triangles = two_rooms()
    broken = np.concatenate([vertices, np.full((1, 3), np.nan, dtype=np.float32)])
    more = np.concatenate([triangles, [[0, 1, len(vertices)]]]).astype(np.int32)
    found = surface_in(HALL._replace(vertices_m=broken, triangles=more))
    assert np.array_equal(found.point_m, SURFACE.point_m)


def test_a_sheet_without_thickness_has_two_sides() -> None:
    vertices, triangles = two_rooms()
    sheet = np.array([[1, 2, 0.5], [2, 2, 0.5], [2, 2, 2.0], [1, 2, 2.0]], dtype=np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3]]) + len(vertices)
    place = building((np.concatenate([vertices, sheet]), np.concatenate([triangles, faces]).astype(np.int32)))
    found = surface_in(place)
    on_it = (
        (np.abs(found.point_m[:, 1] - 2.0) < 0.06) & (found.point_m[:, 0] < 2.1) & (found.point_m[:, 0] > 0.9)
    )
    assert found.area_m2[on_it & (found.normal[:, 1] > 0.9)].sum() == pytest.approx(1.5, rel=0.2)
    assert found.area_m2[on_it & (found.normal[:, 1] < -0.9)].sum() == pytest.approx(1.5, rel=0.2)


def test_a_hall_with_a_hole_in_its_wall_still_has_its_walls() -> None:
    vertices, triangles = two_rooms()
    place = building((vertices, triangles[:-14]))  # without partition and the wall at y = 4 m
    walls = surface_in(place)
    facing = walls.normal[:, 1] > 0.9
    assert walls.area_m2[facing & (walls.point_m[:, 1] < 0.1)].sum() == pytest.approx(6.0 * 2.6, rel=0.1)


def test_a_cloud_gives_the_same_walls_as_its_mesh() -> None:
    rng = np.random.default_rng(101)
    x, z = rng.uniform(0.0, 6.0, 20_000), rng.uniform(0.0, 2.6, 20_000)
    wall = np.stack([x, np.zeros_like(x), z], axis=1)
    cloud = np.concatenate([wall, [[np.nan, 0.0, 0.0], [1e12, 0.0, 0.0]]])
    found = surface_of_cloud(cloud, HALL.field, START_M)
    facing = found.normal[:, 1] > 0.9
    assert found.area_m2[facing].sum() == pytest.approx(6.0 * 2.6, rel=0.15)


def test_nothing_is_looked_at_from_inside_an_obstacle() -> None:
    assert len(surface_in(HALL, np.array([0.0, 1.0, 1.0]))) == 0
    assert segments_of(surface_in(HALL, np.array([99.0, 1.0, 1.0]))) == ()


def test_every_wall_is_one_segment() -> None:
    segments = segments_of(WALLS)
    large = [one for one in segments if one.area_m2 > 2.0]
    facing = sorted(round(math.degrees(one.yaw_rad) / 90.0) % 4 for one in large)
    assert facing == [0, 0, 1, 1, 2, 2, 3]  # the partition halves the wall at y = 0
    assert sum(one.area_m2 for one in large) > 0.95 * WALLS.area_m2.sum()
    longest = max(large, key=lambda one: one.size_m[0])
    np.testing.assert_allclose(longest.size_m, [6.0, 0.0, 2.6], atol=0.3)


def test_cells_belong_to_one_segment_at_most() -> None:
    cells = np.concatenate([one.cells for one in segments_of(WALLS)])
    assert len(np.unique(cells)) == len(cells)


def test_a_round_column_becomes_facets() -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 61)[:-1]
    rim = np.stack([3.0 + 0.8 * np.cos(angle), 2.0 + 0.8 * np.sin(angle)], axis=1)
    bottom, top = (np.insert(rim, 2, z, axis=1) for z in (0.0, 2.6))
    n = np.arange(60)
    m = (n + 1) % 60
    sides = np.concatenate([np.stack([n, m, m + 60], axis=1), np.stack([n, m + 60, n + 60], axis=1)])
    shell = two_rooms()
    shell = shell[0][:-8], shell[1][:-12]
    vertices = np.concatenate([shell[0], bottom, top]).astype(np.float32)
    place = building((vertices, np.concatenate([shell[1], sides + len(shell[0])]).astype(np.int32)))
    found = surface_in(place)
    column = np.hypot(found.point_m[:, 0] - 3.0, found.point_m[:, 1] - 2.0) < 0.95
    facets = segments_of(found.part(column & (np.abs(found.normal[:, 2]) < 0.7)))
    bend = Growing().max_bend_rad
    for one in facets:
        turn = found.part(column & (np.abs(found.normal[:, 2]) < 0.7)).normal[one.cells]
        assert np.quantile(turn @ one.facing, 0.1) > math.cos(1.5 * bend)
    assert 4 <= len(facets) <= 14


def test_a_wall_gets_one_row_that_covers_it_with_the_overlap() -> None:
    (wall,) = (one for one in segments_of(WALLS) if one.size_m[0] > 5.0)
    camera, pattern = Camera(), Pattern(stand_off_m=1.8, overlap=0.3)
    found = pattern_of((wall,), camera, pattern, HALL.flight_bounds_m, everywhere)
    image = 2.0 * 1.8 * math.tan(0.5 * camera.horizontal_fov_rad)
    along = np.sort(found.position_m @ wall.along)
    assert np.all(np.diff(along) <= image * 0.7 + 1e-9)
    ends = wall.centre_m @ wall.along + np.array([-0.5, 0.5]) * wall.size_m[0]
    assert along[0] - 0.5 * image <= ends[0] + 1e-9
    assert along[-1] + 0.5 * image >= ends[1] - 1e-9
    np.testing.assert_allclose(np.cos(found.yaw_rad - wall.yaw_rad), -1.0, atol=1e-12)
    np.testing.assert_allclose((found.position_m - wall.centre_m) @ wall.facing - 0.5 * wall.size_m[1], 1.8)


def test_viewpoints_that_do_not_fit_move_or_go() -> None:
    segments = segments_of(WALLS)

    def near(points_m: Float) -> Bool:
        return np.asarray(HALL.field.distance_m(points_m) > 0.45)

    moved = pattern_of(segments, Camera(), Pattern(stand_off_m=2.6), HALL.flight_bounds_m, near)
    assert len(moved) > 0
    assert near(moved.position_m).all()
    none = pattern_of(
        segments, Camera(), Pattern(), HALL.flight_bounds_m, lambda p: np.zeros(len(p), dtype=bool)
    )
    assert len(none) == 0


def test_a_viewpoint_whose_cells_others_see_is_left_out() -> None:
    views = Views(np.array([0, 3, 5, 7]), np.array([0, 1, 2, 1, 2, 3, 4], dtype=np.int32))
    assert needed(views, np.ones(5), 0.5).tolist() == [True, False, True]


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: Growing(radius_m=0.0), "radius_m"),
        (lambda: Growing(max_bend_rad=0.1), "max_bend_rad"),
        (lambda: Pattern(overlap=1.0), "overlap"),
        (lambda: Camera(max_range_m=0.1), "min_range_m"),
        (lambda: Camera(horizontal_fov_rad=4.0), "horizontal_fov_rad"),
    ],
)
def test_bad_parameters_are_named(make, word: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ConfigError, match=word):
        make()


def test_boxes_are_closed() -> None:
    vertices, triangles = boxes(((0.0, 0.0, 0.0), (1.0, 2.0, 3.0)))
    corner = vertices[triangles].astype(float)
    volume = np.einsum("ij,ij->i", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])).sum() / 6.0
    assert volume == pytest.approx(6.0)
