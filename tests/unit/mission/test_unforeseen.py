"""What is put into the truth stands free and cuts nothing off; what the reference is moved by is rigid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.inspections import boxes, two_rooms
from tests.logs import make_world
from uavexp.errors import WorldError
from uavexp.mission import unforeseen
from uavexp.scene import Scene
from uavexp.types import ReferenceMap, World
from uavexp.world import task

WIDTH_M, HEIGHT_M, CLEARANCE_M = (0.3, 0.6), (1.3, 1.8), 0.4
START_M = np.array([1.03, 1.02, 1.2])


@pytest.fixture(scope="module")
def hall() -> World:
    vertices, triangles = two_rooms()
    return replace(
        make_world([]),
        vertices_m=vertices,
        triangles=triangles,
        bounds_m=np.array([[-0.2, -0.2, -0.2], [6.2, 4.2, 2.8]]),
        flight_bounds_m=np.array([[0.3, 0.3, 0.4], [5.7, 3.7, 2.2]]),
        start_m=START_M,
    )


def blocked(world: World, count: int, seed: int) -> World:
    rng = np.random.default_rng(seed)
    return unforeseen.with_blocks(world, count, WIDTH_M, HEIGHT_M, CLEARANCE_M, rng)


def surface(world: World) -> ReferenceMap:
    count = len(world.triangles)
    return ReferenceMap(
        vertices_m=world.vertices_m, triangles=world.triangles, inspected=np.ones(count, np.bool_)
    )


@pytest.mark.parametrize("seed", range(4))
def test_blocks_stand_free_of_everything_known_and_of_the_start(hall: World, seed: int) -> None:
    world = blocked(hall, 2, seed)
    assert len(world.triangles) == len(hall.triangles) + 2 * 12
    corners = world.vertices_m[len(hall.vertices_m) :].astype(np.float64)
    assert Scene(hall).distance_m(corners).min() > 0.0
    assert corners[:, 2].min() == pytest.approx(unforeseen.LIFT_M, abs=1e-5)  # on the floor
    middles = corners.reshape(2, 8, 3).mean(axis=1)
    assert np.linalg.norm(middles[:, :2] - START_M[:2], axis=1).min() > unforeseen.KEEP_M


@pytest.mark.parametrize("seed", range(4))
def test_blocks_cut_no_free_place_off(hall: World, seed: int) -> None:
    world = blocked(hall, 2, seed)
    layer = task.free_layer(Scene(world), world.flight_bounds_m, START_M[2], CLEARANCE_M)
    assert len(layer[2]) == 1  # the hall's two rooms were one part, and what is left still is


def test_the_doorway_is_never_blocked(hall: World) -> None:
    for seed in range(12):  # 1.4 m wide: a block of 0.6 m in its middle would close it
        corners = blocked(hall, 1, seed).vertices_m[len(hall.vertices_m) :]
        middle = corners.mean(axis=0)
        assert not (2.9 < middle[0] < 3.2 and 3.0 < middle[1] < 3.6)


def test_more_blocks_than_fit_are_refused(hall: World) -> None:
    with pytest.raises(WorldError, match="no room for block"):
        blocked(hall, 60, 0)


def test_the_same_draw_gives_the_same_world(hall: World) -> None:
    assert blocked(hall, 1, 3).digest == blocked(hall, 1, 3).digest != blocked(hall, 1, 4).digest


def test_parts_are_what_shares_vertices() -> None:
    _, triangles = boxes(((0, 0, 0), (1, 1, 1)), ((2, 0, 0), (3, 1, 1)), ((5, 5, 5), (6, 6, 6)))
    np.testing.assert_array_equal(unforeseen.parts_of(triangles, 24), np.repeat([0, 1, 2], 12))


def test_the_shell_stays_whatever_is_dropped(hall: World) -> None:
    mesh, rng = (hall.vertices_m, hall.triangles), np.random.default_rng(0)
    (_, none), kept = unforeseen.dropped(mesh, hall.bounds_m, 0.0, rng)
    np.testing.assert_array_equal(none, hall.triangles)
    assert kept.all()
    (_, rest), kept = unforeseen.dropped(mesh, hall.bounds_m, 1.0, rng)
    np.testing.assert_array_equal(rest, hall.triangles[: 6 * 12])  # all but the partition
    np.testing.assert_array_equal(kept, np.arange(84) < 72)


@settings(deadline=None, max_examples=20)
@given(shift_m=st.floats(0.0, 1.0), turn_rad=st.floats(0.0, 0.3), seed=st.integers(0, 9))
def test_the_reference_moves_as_a_whole(shift_m: float, turn_rad: float, seed: int) -> None:
    known = surface(make_world([([0.0, 0.0, 0.0], [4.0, 3.0, 2.0])]))
    after = unforeseen.moved(known, shift_m, turn_rad, np.random.default_rng(seed)).vertices_m
    before = known.vertices_m
    sides = [np.linalg.norm(each[:, None] - each[None], axis=2) for each in (before, after)]
    np.testing.assert_allclose(sides[1], sides[0], atol=1e-4)
    np.testing.assert_allclose(after[:, 2], before[:, 2], atol=1e-5)
    middles = [0.5 * (each.min(axis=0) + each.max(axis=0)) for each in (before, after)]
    assert np.linalg.norm(middles[1] - middles[0]) == pytest.approx(shift_m, abs=1e-4)
    edge = after[4] - after[0]  # along x before
    assert abs(np.arctan2(edge[1], edge[0])) == pytest.approx(turn_rad, abs=1e-4)


def test_the_reference_is_part_of_the_digest(hall: World) -> None:
    known = surface(hall)
    other = replace(known, inspected=~known.inspected)
    world = unforeseen.with_reference(hall, known)
    assert world.reference is known
    assert len({hall.digest, world.digest, unforeseen.with_reference(hall, other).digest}) == 3
