"""The corridor: convex, free by construction, and around its path."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.ndimage import binary_erosion
from scipy.spatial import cKDTree

from uavexp.arrays import Float
from uavexp.check.fields import bounds, box, empty, field_from, warehouse
from uavexp.check.hall import LIMITS
from uavexp.check.requests import ask
from uavexp.planner.constraints import Constraints
from uavexp.planner.find.free_space import free_space, straight_is_free
from uavexp.planner.find.grid import Grid
from uavexp.planner.shape.flight_corridor import Corridor, make_corridor
from uavexp.planner.shape.shortcut import shortcut
from uavexp.planner.shape.timing import resample

CLEARANCE_M = 0.26


def region(corridor: Corridor, m: int) -> tuple[Float, Float]:
    faces = slice(corridor.first[m], corridor.first[m + 1])
    return corridor.normal[faces], corridor.offset[faces]


def paths(seed: int, count: int) -> tuple[np.ndarray, list[Float]]:
    """Occupancy of a hall with shelves, and searched paths through it, 0.8 m between points."""
    grid = warehouse(seed)
    field, rng = field_from(grid), np.random.default_rng(seed)
    search = Grid()
    kept = Constraints(
        limits=LIMITS,
        min_clearance_m=CLEARANCE_M,
        safe_clearance_m=0.75,
        z_band_m=0.3,
        known_only=False,
    )
    found: list[Float] = []
    while len(found) < count:
        ends = rng.uniform([1.0, 1.0, 1.1], [25.0, 15.0, 1.6], (2, 3))
        path = search.find(ask(field, *ends), kept, rng).path_m
        if len(path) > 20:
            found.append(resample(path, 0.8))
    return grid, found


@pytest.mark.parametrize("seed", range(2))
def test_every_point_of_every_region_keeps_the_clearance(seed: int) -> None:
    """Against the distance to the nearest occupied voxel centre, by a k-d tree: no field in between."""
    grid, routes = paths(seed, 3)
    surface = grid & ~binary_erosion(grid)
    tree, rng = cKDTree((np.argwhere(surface) + 0.5) * 0.1), np.random.default_rng(0)
    checked = 0
    for route in routes:
        corridor = make_corridor(field_from(grid), route, bounds(grid), CLEARANCE_M, False)
        assert corridor.whole
        for m in range(len(route) - 1):
            normal, offset = region(corridor, m)
            np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, atol=1e-12)
            ends = route[m : m + 2]
            away = tree.query(np.linspace(*ends, 30))[0].min() - 0.05
            if away < CLEARANCE_M:  # a chord that cuts a corner: the final check's business
                continue
            assert (ends @ normal.T <= offset + 1e-9).all()  # neighbours share the point between them
            points = rng.uniform(ends.min(axis=0) - 1.2, ends.max(axis=0) + 1.2, (500, 3))
            inside = points[(points @ normal.T <= offset).all(axis=1)]
            if len(inside):
                assert tree.query(inside)[0].min() - 0.05 >= CLEARANCE_M - 1e-5
            checked += len(inside)
    assert checked > 400


def test_regions_are_as_wide_as_a_corridor_allows() -> None:
    """Between two walls, 2 m apart: the walls less half a voxel's slack and the clearance; and no more."""
    grid = empty((6.0, 3.0, 3.0))
    box(grid, (0.0, 0.0, 0.0), (6.0, 0.5, 3.0))
    box(grid, (0.0, 2.5, 0.0), (6.0, 3.0, 3.0))
    ends = np.array([[2.0, 1.4, 1.5], [3.0, 1.4, 1.5]])
    corridor = make_corridor(field_from(grid), ends, bounds(grid), 0.3, False)
    normal, offset = region(corridor, 0)
    across = np.stack([np.full(400, 2.5), np.linspace(0.0, 3.0, 400), np.full(400, 1.5)], axis=1)
    inside = across[(across @ normal.T <= offset).all(axis=1), 1]
    assert inside.min() == pytest.approx(0.5 + 0.3, abs=0.02)
    assert inside.max() == pytest.approx(2.5 - 0.3, abs=0.02)


def test_unknown_voxels_are_kept_out_only_when_asked() -> None:
    grid = empty((4.0, 4.0, 2.0))
    unknown = np.zeros_like(grid)
    unknown[25:] = True
    field, ends = field_from(grid, unknown=unknown), np.array([[1.0, 2.0, 1.0], [2.0, 2.0, 1.0]])
    sheet = np.array([[0.0, y, z] for y in np.linspace(1.2, 2.8, 9) for z in np.linspace(0.2, 1.8, 9)])
    before, beyond = (sheet + np.array([x, 0.0, 0.0]) for x in (2.4, 2.51))
    closed, opened = (
        region(make_corridor(field, ends, bounds(grid), 0.3, known), 0) for known in (True, False)
    )
    assert not (beyond @ closed[0].T <= closed[1]).all(axis=1).any()
    assert (before @ closed[0].T <= closed[1]).all(axis=1).mean() > 0.5
    assert (beyond @ opened[0].T <= opened[1]).all()


def test_flight_bounds_hold_the_region_but_let_an_outside_start_in() -> None:
    grid, low = empty((4.0, 4.0, 2.0)), np.array([[0.5, 0.5, 0.5], [3.5, 3.5, 1.5]])
    inside = make_corridor(field_from(grid), np.array([[1.0, 1.0, 1.0], [1.5, 1.0, 1.0]]), low, 0.3, False)
    normal, offset = region(inside, 0)
    assert not (np.array([1.2, 0.49, 1.0]) @ normal.T <= offset).all()
    assert (np.array([1.2, 0.51, 1.0]) @ normal.T <= offset).all()
    outside = make_corridor(field_from(grid), np.array([[0.3, 1.0, 1.0], [1.0, 1.0, 1.0]]), low, 0.3, False)
    assert (np.array([0.3, 1.0, 1.0]) @ region(outside, 0)[0].T <= region(outside, 0)[1] + 1e-12).all()


def test_a_path_through_an_obstacle_is_no_corridor() -> None:
    grid = empty((3.0, 3.0, 2.0))
    box(grid, (1.4, 0.0, 0.0), (1.6, 3.0, 2.0))
    through = np.array([[1.05, 1.05, 1.05], [2.05, 1.05, 1.05]])  # along voxel centres
    assert not make_corridor(field_from(grid), through, bounds(grid), 0.3, False).whole


@pytest.mark.parametrize("seed", range(2))
def test_a_shortcut_is_free_shorter_and_joins_the_same_ends(seed: int) -> None:
    grid, routes = paths(seed, 4)
    field = field_from(grid)
    for route in routes:
        fine = resample(route, 0.1)
        space = free_space(field, route[[0, -1]], bounds(grid), 0.2, np.inf, False)
        short = shortcut(fine, space)
        np.testing.assert_array_equal(short[[0, -1]], fine[[0, -1]])
        lengths = [np.linalg.norm(np.diff(points, axis=0), axis=1).sum() for points in (short, fine)]
        assert lengths[0] <= lengths[1] + 1e-9
        assert len(short) < 0.5 * len(fine)
        kept = {tuple(point) for point in fine}
        assert all(tuple(point) in kept for point in short)
        for a, b in itertools.pairwise(short):
            skipped = np.linalg.norm(b - a) > 0.11
            assert not skipped or straight_is_free(space, a, b)[0]


def test_in_the_open_a_shortcut_is_the_straight_line() -> None:
    grid = empty((8.0, 8.0, 2.0))
    detour = resample(np.array([[1.0, 1.0, 1.0], [1.0, 7.0, 1.0], [7.0, 7.0, 1.0]]), 0.1)
    space = free_space(field_from(grid), detour[[0, -1]], bounds(grid), 0.2, np.inf, False)
    np.testing.assert_array_equal(shortcut(detour, space), detour[[0, -1]])
