"""The known map against the true distance of boxes and sheets."""

from __future__ import annotations

import numpy as np
import pytest

from uavexp.errors import ConfigError
from uavexp.field import FREE, OCCUPIED, UNKNOWN
from uavexp.mapping.known import Known
from uavexp.scene import Scene
from uavexp.types import Bodies, Shape
from uavexp.world.boxes import Boxes

BOUNDS_M = np.array([[0.0, 0.0, 0.0], [6.0, 4.0, 2.5]])
START_M = np.array([0.75, 2.05, 1.25])


def scene_of(*boxes) -> Scene:
    made = Boxes()
    for low, high in boxes:
        made.span(low, high)
    return Scene.from_mesh(*made.mesh())


def known(scene: Scene) -> Known:
    backend = Known()
    backend.reset(BOUNDS_M, scene)
    backend.mark_free(START_M, 0.6)
    return backend


def centres(backend):
    shape = backend.field.distance.shape
    return backend.field.voxel_centres_m(np.arange(np.prod(shape))).reshape(*shape, 3)


@pytest.mark.parametrize("shift_m", [0.0, 0.01, 0.03, 0.05, 0.08])
def test_a_solid_is_occupied_inside_and_its_distance_is_true(shift_m):
    low, high = np.array([2.0, 1.0, 0.5]) + shift_m, np.array([3.2, 2.6, 1.7]) + shift_m
    backend = known(scene_of((tuple(low), tuple(high))))
    backend.update(0.0)
    at, state = centres(backend), backend.field.state
    outside = np.linalg.norm(np.maximum(np.maximum(low - at, at - high), 0.0), axis=-1)
    assert (state[outside == 0.0] == OCCUPIED).all()
    assert (state[outside > 0.0251] == FREE).all()
    assert (state != UNKNOWN).all()
    within = (outside > 0.1) & (outside < 1.8)
    error = backend.field.distance[within] - outside[within]
    assert np.abs(error).max() < 0.09  # a voxel's: see `mapping.base`
    deep = ((at > low + 0.25) & (at < high - 0.25)).all(axis=-1)
    assert (backend.field.distance[deep] < -0.15).all()


@pytest.mark.parametrize("x_m", [2.0, 2.02, 2.05, 2.09])
def test_a_sheet_without_thickness_has_no_hole(x_m):
    corners = np.array([[x_m, 1.0, 0.3], [x_m, 3.0, 0.3], [x_m, 3.0, 2.2], [x_m, 1.0, 2.2]], np.float32)
    backend = known(Scene.from_mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32)))
    backend.update(0.0)
    occupied = backend.field.state == OCCUPIED
    across = occupied[:, 11:29, 4:21].any(axis=0)
    assert across.all()
    where = centres(backend)[occupied]
    assert np.abs(where[:, 0] - x_m).max() < 0.051
    assert (occupied[:, 11:29, 4:21].sum(axis=0) <= 2).all()


def test_what_a_closed_wall_hides_is_solid():
    backend = known(scene_of(((3.0, -1.0, -1.0), (3.1, 5.0, 4.0))))
    backend.update(0.0)
    x = centres(backend)[..., 0]
    assert (backend.field.state[x > 3.0] == OCCUPIED).all()
    assert (backend.field.state[x < 3.0] == FREE).all()


def test_all_is_first_seen_at_the_first_update_and_nothing_after():
    backend = known(scene_of(((2.0, 1.0, 0.5), (3.2, 2.6, 1.7))))
    assert (backend.field.state == UNKNOWN).all()
    first = backend.update(0.0)
    assert first.voxel.size == backend.field.state.size
    assert first.first_seen.all()
    np.testing.assert_array_equal(
        first.occupied.reshape(backend.field.state.shape), backend.field.state == OCCUPIED
    )
    backend.integrate(None)  # type: ignore[arg-type]  # whatever it is
    assert backend.update(0.1).voxel.size == 0


def test_without_a_free_ball_nothing_is_known():
    backend = Known()
    backend.reset(BOUNDS_M, scene_of(((2.0, 1.0, 0.5), (3.2, 2.6, 1.7))))
    assert backend.update(0.0).voxel.size == 0


def test_movers_are_not_in_it():
    scene = scene_of(((2.0, 1.0, 0.5), (3.2, 2.6, 1.7)))
    empty = known(scene)
    scene.place(
        Bodies(
            time_s=0.0,
            shape=np.array([Shape.BOX], np.uint8),
            half_size_m=np.full((1, 3), 0.4),
            position_m=np.array([[4.5, 2.0, 1.2]]),
            velocity_mps=np.zeros((1, 3)),
        )
    )
    crowded = known(scene)
    for backend in (empty, crowded):
        backend.update(0.0)
    np.testing.assert_array_equal(empty.field.state, crowded.field.state)


@pytest.mark.parametrize("value", [-0.01, 0.05, float("nan")])
def test_bad_parameters_are_refused_by_name(value):
    with pytest.raises(ConfigError, match="occupied_below_m"):
        Known(occupied_below_m=value)
