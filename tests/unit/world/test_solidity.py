"""What is solid, free or outside is told right however a building is drawn: facts by construction."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from uavexp.arrays import Float32, Int32
from uavexp.space import FREE, OUTSIDE, SOLID, SURFACE, UNMEASURED
from uavexp.types import World
from uavexp.world.boxes import Boxes
from uavexp.world.corridors import Corridors
from uavexp.world.facility import Facility
from uavexp.world.multilevel import Multilevel
from uavexp.world.random_columns import RandomColumns
from uavexp.world.rooms import Rooms
from uavexp.world.solidity import space_after, space_of_cells, space_of_mesh, space_of_points
from uavexp.world.tunnel import Tunnel
from uavexp.world.warehouse import Warehouse

Mesh = tuple[Float32, Int32]
Corner = tuple[float, float, float]
HOUSE: tuple[Corner, Corner] = ((0.0, 0.0, 0.0), (8.0, 6.0, 3.0))
MACHINE: tuple[Corner, Corner] = ((3.0, 2.0, 0.0), (4.6, 3.6, 1.6))
IN_ROOM, IN_MACHINE, IN_YARD = (1.5, 4.5, 1.2), (3.8, 2.8, 0.8), (-1.5, 3.0, 1.2)
YARD: tuple[Corner, Corner] = ((-4.0, -4.0, -0.2), (12.0, 10.0, -0.1))


def boxes(*spans: tuple[Corner, Corner]) -> Mesh:
    """Boxes with outward normals; a box is twelve triangles, in the order -x +x -y +y -z +z."""
    made = Boxes()
    for low, high in spans:
        made.span(low, high)
    return made.mesh()


def without(mesh: Mesh, *sides: int) -> Mesh:
    """The mesh without sides of its first box."""
    keep = np.ones(len(mesh[1]), dtype=bool)
    for side in sides:
        keep[2 * side : 2 * side + 2] = False
    return mesh[0], np.ascontiguousarray(mesh[1][keep])


def turned(mesh: Mesh, count: int) -> Mesh:
    """The mesh with the normals of its first triangles turned."""
    triangles = mesh[1].copy()
    triangles[:count] = triangles[:count, ::-1]
    return mesh[0], triangles


def joined(*meshes: Mesh) -> Mesh:
    first, faces = np.cumsum([0, *(len(mesh[0]) for mesh in meshes)]), [mesh[1] for mesh in meshes]
    return (
        np.concatenate([mesh[0] for mesh in meshes]),
        np.concatenate([face + n for face, n in zip(faces, first, strict=False)]).astype(np.int32),
    )


def states(mesh: Mesh, *points: Sequence[float]) -> list[int]:
    return space_of_mesh(*mesh).state_at(np.array(points)).tolist()


SOLID_WALLS = boxes(
    ((-0.2, -0.2, -0.2), (8.2, 6.2, 0.0)),
    ((-0.2, -0.2, 3.0), (8.2, 6.2, 3.2)),
    ((-0.2, -0.2, 0.0), (0.0, 6.2, 3.0)),
    ((8.0, -0.2, 0.0), (8.2, 6.2, 3.0)),
    ((0.0, -0.2, 0.0), (8.0, 0.0, 3.0)),
    ((0.0, 6.0, 0.0), (8.0, 6.2, 3.0)),
)


@pytest.mark.parametrize(
    "shell",
    [boxes(HOUSE), turned(boxes(HOUSE), 12), SOLID_WALLS, without(boxes(HOUSE), 5), without(boxes(HOUSE), 0)],
    ids=["outward", "inward", "solid walls", "no roof", "a side open"],
)
def test_a_machine_in_a_room_is_solid_and_the_yard_is_outside(shell: Mesh) -> None:
    mesh = joined(shell, boxes(MACHINE, YARD))
    assert states(mesh, IN_ROOM, IN_MACHINE, IN_YARD) == [FREE, SOLID, OUTSIDE]


def test_a_machine_with_a_hole_that_no_body_passes_is_solid() -> None:
    mesh = joined(boxes(HOUSE), without(boxes(MACHINE), 5))
    lid = boxes(((3.0, 2.0, 1.6), (4.6, 3.3, 1.601)))  # 0.3 m of the top stay open
    assert states(joined(mesh, lid), IN_ROOM, IN_MACHINE) == [FREE, SOLID]


def test_a_hole_in_the_roof_lets_nothing_out() -> None:
    roof = boxes(((0.0, 0.0, 3.0), (8.0, 4.0, 3.1)))
    mesh = joined(without(boxes(HOUSE), 5), roof, boxes(YARD))
    assert states(mesh, (2.0, 5.0, 1.2), (2.0, 1.0, 1.2), (2.0, 5.0, 3.6)) == [FREE, FREE, OUTSIDE]


def test_the_corner_of_an_l_is_a_yard() -> None:
    wings = boxes(((0.0, 0.0, 0.0), (12.0, 4.0, 3.0)), ((0.0, 4.0, 0.0), (4.0, 12.0, 3.0)), YARD)
    assert states(wings, (2.0, 2.0, 1.2), (5.0, 5.0, 1.2), (9.0, 9.0, 1.2)) == [FREE, OUTSIDE, OUTSIDE]


def test_where_the_sides_say_nothing_a_body_decides() -> None:
    """A soup with both sides of every triangle: a large closed box may be a room, a small one is none."""
    small = ((6.0, 1.0, 0.0), (6.3, 1.3, 2.0))
    soup = boxes(HOUSE, MACHINE, small)
    soup = joined(soup, turned(soup, len(soup[1])))
    assert states(soup, IN_ROOM, IN_MACHINE, (6.15, 1.15, 1.0)) == [FREE, FREE, SOLID]


def test_rooms_that_are_not_joined_are_free() -> None:
    for wall in (boxes(((5.0, 0.0, 0.0), (5.2, 6.0, 3.0))), boxes(((5.0, 0.0, 0.0), (5.0001, 6.0, 3.0)))):
        for shell in (boxes(HOUSE), SOLID_WALLS):
            assert states(joined(shell, wall), (2.0, 3.0, 1.2), (6.6, 3.0, 1.2)) == [FREE, FREE]


def test_rooms_cut_into_rock_are_free() -> None:
    rock = boxes(((-14.0, -2.0, -1.0), (12.0, 8.0, 4.0)))
    cut = joined(rock, turned(boxes(HOUSE, ((-12.0, 2.0, 0.0), (-3.0, 4.0, 2.5))), 24))
    assert states(cut, IN_ROOM, (-8.0, 3.0, 1.2), (10.0, 3.0, 1.2)) == [FREE, FREE, SOLID]


def test_what_changes_leaves_the_unmeasured_unmeasured() -> None:
    state = np.full((60, 40, 1), UNMEASURED, np.uint8)
    state[20:30, 15:25] = SOLID
    state[21:29, 16:24] = FREE
    before = space_of_cells(state, np.zeros(3), np.array([0.5, 0.5, 2.5]), is_plan=True)
    room = turned(boxes(((10.5, 8.0, 0.0), (14.5, 12.0, 2.5))), 12)
    block = boxes(((12.0, 9.0, 0.0), (13.0, 10.0, 1.0)))
    mesh = joined(boxes(((0.0, 0.0, -0.1), (30.0, 20.0, 2.6))), room, block)
    after = space_after(before, *mesh, np.array([11.2, 11.0, 1.2]))
    points = np.array([[11.2, 11.0, 1.2], [12.5, 9.5, 0.5], [5.0, 5.0, 1.2], [10.25, 10.0, 1.2]])
    assert after.state_at(points).tolist() == [FREE, SOLID, UNMEASURED, SOLID]


def test_a_thick_wall_is_solid_and_a_point_near_a_surface_is_at_it() -> None:
    mesh = joined(SOLID_WALLS, boxes(((4.0, 0.0, 0.0), (5.0, 4.5, 3.0))))
    assert states(mesh, (4.5, 2.0, 1.5), (4.02, 2.0, 1.5), (6.0, 2.0, 1.5)) == [SOLID, SURFACE, FREE]


@pytest.mark.parametrize(
    "family",
    [Corridors, Facility, Multilevel, RandomColumns, Rooms, Tunnel, Warehouse],
    ids=lambda f: f.__name__,
)
def test_what_generated_worlds_are_built_of_is_solid_and_their_task_is_free(family: type) -> None:
    world: World = family().generate(np.random.default_rng(100))
    corners = world.vertices_m.reshape(-1, 8, 3).astype(np.float64)
    size = np.array([np.linalg.norm(corners[:, n] - corners[:, 0], axis=1) for n in (4, 2, 1)])
    state = world.space.state_at(corners.mean(axis=1)[size.min(axis=0) >= 0.4])
    assert state.size > 0
    assert not np.isin(state, [FREE, OUTSIDE]).any()
    assert world.space.is_inside(world.shortest_path).all()


def test_measured_cells_are_what_was_measured_and_a_map_ends_in_the_unmeasured() -> None:
    state = np.full((40, 30, 1), UNMEASURED, np.uint8)
    state[5:20, 5:20] = SOLID
    state[6:19, 6:19] = FREE
    low, cell = np.array([1.0, -2.0, 0.0]), np.array([0.5, 0.5, 2.5])
    space = space_of_cells(state, low, cell, is_plan=True)
    points = np.array(
        [[7.0, 4.0, 1.2], [3.6, 4.0, 1.2], [15.0, 5.0, 1.2], [-9.0, 0.0, 1.2], [7.0, 4.0, -0.05]]
    )
    assert space.state_at(points).tolist() == [FREE, SOLID, UNMEASURED, UNMEASURED, SOLID]
    quarter = space_of_cells(state, low, cell, np.pi / 2.0, is_plan=True)
    about = points - low
    again = np.column_stack([low[0] - about[:, 1], low[1] + about[:, 0], points[:, 2]])
    np.testing.assert_array_equal(quarter.state_at(again), space.state_at(points))


def test_white_paper_around_a_plan_is_outside() -> None:
    state = np.full((60, 40, 1), FREE, np.uint8)
    state[10:50, 10] = state[10:50, 29] = state[10, 10:30] = state[49, 10:30] = SOLID
    state[30, 10] = FREE  # a door
    space = space_of_cells(state, np.zeros(3), np.array([0.2, 0.2, 2.5]), is_plan=True)
    assert space.state_at(np.array([[6.0, 4.0, 1.0], [1.0, 4.0, 1.0], [6.0, 7.0, 1.0]])).tolist() == [
        FREE,
        OUTSIDE,
        OUTSIDE,
    ]


def test_points_of_a_scan_make_solids_and_what_they_shut_off_is_solid() -> None:
    occupied = np.zeros((60, 50, 30), dtype=bool)
    occupied[[0, -1]] = occupied[:, [0, -1]] = occupied[:, :, [0, -1]] = True
    occupied[20:24, 20:24, :12] = True
    occupied[21:23, 21:23, 1:11] = False  # a hollow post
    space = space_of_points(occupied, np.array([1.0, 1.0, 0.0]), 0.1)
    points = np.array([[2.0, 2.0, 1.0], [3.2, 3.2, 0.5], [3.05, 3.05, 0.5], [0.5, 2.0, 1.0]])
    assert space.state_at(points).tolist() == [FREE, SOLID, SOLID, OUTSIDE]
