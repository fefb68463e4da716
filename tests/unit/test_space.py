"""Which space is free is looked up cell by cell, however the cells are turned."""

import dataclasses
import io
import math

import numpy as np

from uavexp.check.building import building
from uavexp.space import FREE, OUTSIDE, SOLID, SURFACE, UNMEASURED, Space
from uavexp.store.worlds import read_world, world_bytes


def turned_cells() -> Space:
    state = np.array([UNMEASURED, FREE, SOLID, OUTSIDE, SURFACE, FREE], np.uint8).reshape(3, 2, 1)
    return Space(
        state=state, low_m=np.array([1.0, 2.0, 0.5]), cell_m=np.array([0.5, 0.25, 2.0]), yaw_rad=math.pi / 2
    )


def test_cells_are_found_along_turned_axes() -> None:
    space = turned_cells()
    i, j = (item.ravel() for item in np.meshgrid(range(3), range(2), indexing="ij"))
    x, y = (i + 0.5) * 0.5, (j + 0.5) * 0.25
    points = np.column_stack([1.0 - y, 2.0 + x, np.full(6, 1.5)])  # a quarter turn to the left
    np.testing.assert_array_equal(space.state_at(points), space.state[i, j, 0])
    np.testing.assert_array_equal(space.is_free(points), [False, True, False, True, False, True])
    np.testing.assert_array_equal(space.is_inside(points), [False, True, False, False, False, True])
    np.testing.assert_array_equal(space.is_solid(points), [True, False, True, False, False, False])
    crossed = dataclasses.replace(space, unmeasured_is_solid=False)
    np.testing.assert_array_equal(crossed.is_solid(points), [False, False, True, False, False, False])


def test_the_outermost_cells_stand_for_what_lies_beyond() -> None:
    space = dataclasses.replace(turned_cells(), yaw_rad=0.0)
    beyond = np.array([[-9.0, 2.1, 1.0], [99.0, 99.0, -99.0]])
    np.testing.assert_array_equal(space.state_at(beyond), [UNMEASURED, FREE])


def test_a_world_keeps_its_space_and_its_notes() -> None:
    world = dataclasses.replace(building(), space=turned_cells(), notes=("60 % was never measured", "ü"))
    again = read_world(io.BytesIO(world_bytes(world)))
    assert again.notes == world.notes
    assert again.space.yaw_rad == world.space.yaw_rad
    assert again.space.unmeasured_is_solid
    np.testing.assert_array_equal(again.space.state, world.space.state)
    assert read_world(io.BytesIO(world_bytes(building()))).notes == ()
