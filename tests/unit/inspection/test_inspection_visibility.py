"""Lines of sight against dense sampling, and the yaw that sees most against all yaws."""

from __future__ import annotations

import math

import numpy as np
import pytest

from uavexp.arrays import Float
from uavexp.check.fields import box, empty, field_from
from uavexp.inspection.reference_surface import Surface
from uavexp.inspection.view_angle import Weights, blocked_viewpoints, cell_weights, choose_yaw
from uavexp.inspection.viewpoints import Viewpoints
from uavexp.inspection.visibility import (
    Camera,
    Grid,
    Views,
    is_clear,
    sighted_cells,
    views_of,
    visible_cells,
    witnesses,
)

ROOM = empty((6.0, 6.0, 3.0))
box(ROOM, (3.0, 0.0, 0.0), (3.2, 4.0, 3.0))
FIELD = field_from(ROOM)
GRID = Grid(FIELD.state, FIELD.origin_m, FIELD.voxel_size_m)
EYE = np.array([1.52, 2.03, 1.51])


def cells(points: list[list[float]], normals: list[list[float]]) -> Surface:
    return Surface(
        point_m=np.array(points),
        normal=np.array(normals),
        area_m2=np.ones(len(points)),
        curvature=np.zeros(len(points)),
    )


def sighted(camera: Camera, eye: Float, surface: Surface) -> list[int]:
    """Cells that some yaw sees."""
    every = np.ones(len(surface), dtype=np.bool_)
    return sighted_cells(GRID, camera.optics, eye, surface.point_m, surface.normal, every).tolist()


def visible(camera: Camera, eye: Float, yaw: float, surface: Surface) -> list[int]:
    """Cells that a yaw sees."""
    every = np.ones(len(surface), dtype=np.bool_)
    return visible_cells(GRID, camera.optics, eye, yaw, surface.point_m, surface.normal, every).tolist()


def test_sight_agrees_with_dense_samples_of_the_line() -> None:
    rng = np.random.default_rng(100)
    blocked = 0
    for _ in range(400):
        a, b = rng.uniform(0.05, [5.95, 5.95, 2.95], (2, 3))
        if ROOM[tuple((a / 0.1).astype(int))]:
            continue
        points = a + np.linspace(0.0, 1.0, 4000)[:, None] * (b - a)
        inside = ROOM[tuple((points / 0.1).astype(int).T)].mean()
        clear = is_clear(GRID, a, b, 0.0)
        if inside > 0.002 or inside == 0.0:  # a corner may be cut between two samples
            blocked += inside > 0.0
            assert clear == (inside == 0.0)
    assert blocked > 50


def test_the_last_part_of_a_line_need_not_be_free() -> None:
    point = np.array([3.05, 2.03, 1.51])
    assert not is_clear(GRID, EYE, point, 0.0)
    assert is_clear(GRID, EYE, point, 0.1)
    assert not is_clear(GRID, EYE, np.array([3.4, 2.03, 1.51]), 0.1)


@pytest.mark.parametrize(
    ("point", "normal", "seen"),
    [
        ([3.0, 2.0, 1.5], [-1.0, 0.0, 0.0], True),
        ([3.0, 2.0, 1.5], [1.0, 0.0, 0.0], False),  # its back
        ([3.0, 5.0, 1.5], [0.0, -1.0, 0.0], True),
        ([1.5, 0.5, 1.5], [0.0, 1.0, 0.0], False),  # 90° to the right of the image
        ([2.5, 2.0, 2.9], [-1.0, 0.0, 0.0], False),  # above the image
        ([5.5, 2.0, 1.5], [-1.0, 0.0, 0.0], False),  # behind the wall
    ],
)
def test_range_angle_and_walls_decide_what_is_seen(
    point: list[float], normal: list[float], seen: bool
) -> None:
    surface = cells([point], [normal])
    camera = Camera(max_range_m=5.0, horizontal_fov_rad=math.radians(130.0))
    found = visible(camera, EYE, 0.0, surface)
    assert (len(found) == 1) == seen
    short = visible(Camera(max_range_m=0.5), EYE, 0.0, surface)
    assert len(short) == 0


def test_incidence_has_a_limit() -> None:
    surface = cells([[3.0, 3.9, 1.51]], [[-1.0, 0.0, 0.0]])  # met at 51.6°
    for limit, seen in ((51.0, 0), (52.5, 1)):
        camera = Camera(max_incidence_rad=math.radians(limit))
        assert len(sighted(camera, EYE, surface)) == seen


def wall_cells() -> Surface:
    y, z = np.meshgrid(np.arange(0.1, 4.0, 0.2), np.arange(0.1, 3.0, 0.2))
    point = np.stack([np.full(y.size, 3.0), y.ravel(), z.ravel()], axis=1)
    return cells(point.tolist(), [[-1.0, 0.0, 0.0]] * y.size)


def test_what_some_yaw_sees_is_the_union_over_yaws_that_fit_the_height() -> None:
    surface, camera = wall_cells(), Camera()
    union: set[int] = set()
    for yaw in np.linspace(-np.pi, np.pi, 720):
        union |= set(visible(camera, EYE, float(yaw), surface))
    assert union == set(sighted(camera, EYE, surface))


def test_views_and_witnesses_are_those_of_single_cameras() -> None:
    surface, camera = wall_cells(), Camera()
    eyes = np.array([[0.5, 0.5, 1.5], EYE, [5.0, 2.0, 1.5]])
    yaws = np.array([0.3, -0.4, 3.0])
    views = views_of(GRID, camera, eyes, yaws, surface.point_m, surface.normal)
    for n in range(3):
        alone = visible(camera, eyes[n], yaws[n], surface)
        assert np.array_equal(views.of(n), alone)
    witness = witnesses(GRID, camera.optics, eyes, surface.point_m, surface.normal)
    sets = [set(sighted(camera, eye, surface)) for eye in eyes]
    for cell, first in enumerate(witness):
        assert first == next((n for n in range(3) if cell in sets[n]), -1)


def test_the_chosen_yaw_is_the_best_of_all() -> None:
    surface, camera = wall_cells(), Camera(horizontal_fov_rad=math.radians(50.0))
    weight = np.random.default_rng(102).random(len(surface))
    choice = choose_yaw(GRID, camera, surface, weight, EYE, 0.2, candidates=24)
    totals = [
        weight[visible(camera, EYE, 0.2 + turn, surface)].sum() for turn in np.arange(24) * 2.0 * np.pi / 24
    ]
    assert choice.score == pytest.approx(max(totals))
    assert choice.yaw_rad == pytest.approx(
        math.remainder(0.2 + np.argmax(totals) * 2.0 * np.pi / 24, 2.0 * np.pi)
    )


def test_only_what_is_sought_is_found() -> None:
    surface, camera = wall_cells(), Camera()
    sought = np.random.default_rng(103).random(len(surface)) < 0.5
    geometry = (surface.point_m, surface.normal, sought)
    found = sighted_cells(GRID, camera.optics, EYE, *geometry)
    assert found.tolist() == [n for n in sighted(camera, EYE, surface) if sought[n]]
    framed = visible_cells(GRID, camera.optics, EYE, 0.3, *geometry)
    assert 0 < len(framed) < len(found)
    assert framed.tolist() == [n for n in visible(camera, EYE, 0.3, surface) if sought[n]]


def test_with_nothing_to_see_the_nominal_yaw_stays() -> None:
    surface = wall_cells()
    choice = choose_yaw(GRID, Camera(), surface, np.zeros(len(surface)), EYE, 1.3)
    assert choice.yaw_rad == pytest.approx(1.3)


def test_weights_rank_occluded_over_plain_over_scanned() -> None:
    surface = cells([[0.0, 0.0, 0.0]] * 4, [[1.0, 0.0, 0.0]] * 4)
    views = Views(np.array([0, 2, 3]), np.array([0, 1, 2], dtype=np.int32))
    scanned = np.array([True, False, False, False])
    weight = cell_weights(surface, views, np.array([True, False]), scanned, Weights())
    assert weight.tolist() == [0.02, 5.0, 1.0, 1.0]


def test_a_viewpoint_in_a_new_obstacle_is_blocked() -> None:
    places = np.array([[1.5, 2.0, 1.5], [2.9, 2.0, 1.5]])
    points = Viewpoints(position_m=places, yaw_rad=np.zeros(2), segment=np.zeros(2, dtype=np.int64))
    assert blocked_viewpoints(FIELD, points, 0.3).tolist() == [False, True]
