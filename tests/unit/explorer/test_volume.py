"""Waves, clusters and cells of space: scipy's costs, still after cells have changed; nothing lost."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from uavexp.arrays import Float
from uavexp.check.fields import empty, field_from
from uavexp.explorer.volume.cells import CLOSED, EDGE, NARROW, OPEN, UNSEEN, Body, Cells
from uavexp.explorer.volume.clusters import clusters_of
from uavexp.explorer.volume.route import ANY, WIDE, optimistic
from uavexp.explorer.volume.steps import Prices, prices, steps_on
from uavexp.explorer.volume.views import Places, Sight, look_from, seen_from
from uavexp.explorer.volume.waves import (
    FAR,
    begin,
    forget,
    least_change,
    new_wave,
    reach,
    reach_nearest,
    straight_cost,
    trace,
)
from uavexp.field import DistanceField

SHAPE = (9, 8, 6)
STEPS = steps_on(SHAPE)
PRICES = optimistic(1.5, 3.0)


def random_kinds(rng: np.random.Generator) -> np.ndarray:
    kind = rng.choice(6, SHAPE, p=[0.4, 0.2, 0.1, 0.1, 0.1, 0.1]).astype(np.uint8)
    inner = np.zeros(SHAPE, dtype=bool)
    inner[1:-1, 1:-1, 1:-1] = True
    return np.where(inner, kind, CLOSED).astype(np.uint8)


def scipy_costs(kind: np.ndarray, price: Prices, source: int) -> Float:
    """The same graph, built edge by edge, searched by scipy."""
    rows, cols, weights = [], [], []
    for cell in np.ndindex(SHAPE):
        here = int(np.ravel_multi_index(cell, SHAPE))
        if not price.cell[kind[cell]] and here != source:
            continue
        for move in np.ndindex(3, 3, 3):
            near = tuple(np.array(cell) + move - 1)
            if move == (1, 1, 1) or min(near) < 0 or (np.array(near) >= SHAPE).any():
                continue
            if not price.cell[kind[near]]:
                continue
            mean = 0.5 * (max(price.cell[kind[cell]], 1.0) + price.cell[kind[near]])
            climb = max(price.climb[kind[cell]], price.climb[kind[near]]) if move[2] != 1 else 1.0
            length = math.floor(100 * math.dist(move, (1, 1, 1)) + 0.5)
            rows.append(here)
            cols.append(int(np.ravel_multi_index(near, SHAPE)))
            weights.append(int(min(mean * climb, 5.0) * length))
    size = int(np.prod(SHAPE))
    return dijkstra(coo_array((weights, (rows, cols)), shape=(size, size)).tocsr(), indices=source)


def asked(wave, kind: np.ndarray, price: Prices, cells: range) -> Float:
    found = [reach(wave, kind.reshape(-1), STEPS, price, cell, FAR) for cell in cells]
    return np.array([math.inf if cost == FAR else cost for cost in found])


@pytest.mark.parametrize("seed", range(4))
def test_costs_equal_scipys_and_follow_every_change(seed: int) -> None:
    rng, size = np.random.default_rng(seed), int(np.prod(SHAPE))
    kind, wave = random_kinds(rng), new_wave(size)
    for price in (WIDE, ANY, PRICES):
        source = int(np.ravel_multi_index((4, 4, 3), SHAPE))
        begin(wave, source)
        for _ in range(25):
            expected = scipy_costs(kind, price, source)
            expected[price.cell[kind.reshape(-1)] == 0.0] = np.inf
            expected[source] = 0.0
            cells = range(size) if rng.random() < 0.3 else range(int(rng.integers(size - 20)), size, 37)
            np.testing.assert_array_equal(asked(wave, kind, price, cells), expected[list(cells)])
            other = np.where(rng.random(SHAPE) < 0.02, random_kinds(rng), kind)
            changed = np.flatnonzero(other != kind).astype(np.int32)
            kind = other
            if len(changed):
                level = least_change(wave, STEPS, changed)
                if level < FAR - 1:
                    forget(wave, level)


@pytest.mark.parametrize("seed", range(4))
def test_costs_follow_changes_under_a_wave_that_was_not_at_its_end(seed: int) -> None:
    """Asked for a near cell only, it leaves others waiting; the map changes, and it goes on."""
    rng, size = np.random.default_rng(seed), int(np.prod(SHAPE))
    kind, wave = random_kinds(rng), new_wave(size)
    source = int(np.ravel_multi_index((4, 4, 3), SHAPE))
    for price in (WIDE, PRICES):
        begin(wave, source)
        for _ in range(40):
            expected = scipy_costs(kind, price, source)
            cell = int(rng.choice(np.flatnonzero(np.isfinite(expected))))
            np.testing.assert_array_equal(asked(wave, kind, price, range(cell, cell + 1)), expected[cell])
            other = np.where(rng.random(SHAPE) < 0.02, random_kinds(rng), kind)
            changed = np.flatnonzero(other != kind).astype(np.int32)
            kind = other
            level = least_change(wave, STEPS, changed) if len(changed) else FAR
            if level < FAR - 1:
                forget(wave, level)


def test_only_prices_that_are_the_lengths_are_even() -> None:
    open_or_not, flat = np.array([0.0, 1.0, 0.0]), np.ones(3)
    assert prices(open_or_not, flat).even
    assert not prices(open_or_not, np.array([1.0, 2.0, 1.0])).even
    assert not prices(np.array([0.0, 1.5, 0.0]), flat).even


@pytest.mark.parametrize("seed", range(4))
def test_the_nearest_places_are_those_of_scipys_costs(seed: int) -> None:
    """As many groups as are enough have their nearest place, and whatever can still be the best is there."""
    rng, size = np.random.default_rng(seed), int(np.prod(SHAPE))
    kind, wave, number = random_kinds(rng), new_wave(size), np.zeros(size, np.int32)
    source = int(np.ravel_multi_index((4, 4, 3), SHAPE))
    costs = scipy_costs(kind, PRICES, source)
    for groups, spare in ((3, FAR), (100, 150), (100, FAR)):
        places, group = rng.integers(0, size, 60), np.sort(rng.integers(0, 20, 60))
        places[:2], onward = source, rng.integers(0, 500, 60)
        begin(wave, source)
        found = reach_nearest(
            wave, kind.reshape(-1), STEPS, PRICES, places, group, onward, number, groups, spare
        )  # fmt: skip
        passable = (PRICES.cell[kind.reshape(-1)[places]] > 0.0) | (places == source)
        expected = np.where(passable, costs[places], np.inf)
        np.testing.assert_array_equal(found[found < FAR], expected[found < FAR])
        assert not number.any()
        assert (found < FAR)[expected <= found[found < FAR].max() - 1].all()  # nearest first
        if groups == 3:
            assert len(np.unique(group[found < FAR])) >= 3  # more, where places share a cell
        elif spare == FAR:
            assert ((found < FAR) == np.isfinite(expected)).all()
        else:
            best = (expected + onward).min()
            assert (found < FAR)[expected + onward <= best + spare].all()


def test_a_straight_line_of_open_cells_costs_what_the_wave_finds_and_no_other_line_anything() -> None:
    rng, size = np.random.default_rng(5), int(np.prod(SHAPE))
    kind, wave = np.zeros(SHAPE, np.uint8), new_wave(size)
    kind[1:-1, 1:-1, 1:-1] = OPEN
    kind[4, 3:, 2:4] = NARROW
    inner, told = np.flatnonzero(kind.reshape(-1) == OPEN), 0
    for _ in range(200):
        start, end = rng.choice(inner, 2)
        begin(wave, start)
        cost = straight_cost(kind.reshape(-1), SHAPE, WIDE, start, end)
        if cost < FAR:
            assert cost == reach(wave, kind.reshape(-1), STEPS, WIDE, end, FAR)
        told += cost < FAR
    assert 50 < told < 200
    ends = [int(np.ravel_multi_index(cell, SHAPE)) for cell in ((3, 5, 2), (5, 5, 2))]
    assert straight_cost(kind.reshape(-1), SHAPE, WIDE, *ends) == FAR


def test_no_way_that_costs_more_than_asked_for_is_found_and_it_is_later() -> None:
    kind, wave = np.zeros(SHAPE, np.uint8), new_wave(int(np.prod(SHAPE)))
    kind[1:-1, 1:-1, 1:-1] = OPEN
    ends = [int(np.ravel_multi_index(cell, SHAPE)) for cell in ((1, 1, 1), (7, 1, 1))]
    begin(wave, ends[0])
    assert reach(wave, kind.reshape(-1), STEPS, WIDE, ends[1], 599) == FAR
    assert reach(wave, kind.reshape(-1), STEPS, WIDE, ends[1], 600) == 600


def test_a_way_is_traced_back_and_ends_where_none_leads() -> None:
    """Used to search for ever where the wave had not been."""
    kind, wave = np.zeros(SHAPE, np.uint8), new_wave(int(np.prod(SHAPE)))
    kind[1:-1, 1:-1, 1:-1] = OPEN
    kind[4] = CLOSED
    start, near, beyond = (
        int(np.ravel_multi_index(cell, SHAPE)) for cell in ((1, 1, 1), (3, 3, 1), (7, 1, 1))
    )
    begin(wave, start)
    assert asked(wave, kind, WIDE, (near, beyond)).tolist() == [282.0, np.inf]
    way = trace(wave, kind.reshape(-1), STEPS, WIDE, near)
    assert way.tolist() == [start, int(np.ravel_multi_index((2, 2, 1), SHAPE)), near]
    assert trace(wave, kind.reshape(-1), STEPS, WIDE, beyond).tolist() == [beyond]


def test_clusters_are_scipys_parts_cut_into_cubes() -> None:
    rng = np.random.default_rng(3)
    shape = (20, 18, 14)
    frontier = np.pad(rng.random(np.array(shape) - 2) < 0.05, 1)
    cells = np.flatnonzero(frontier)
    index = np.stack(np.unravel_index(cells, shape), axis=-1)
    found = clusters_of(cells, index, steps_on(shape), np.zeros(frontier.size, np.int32), least=4, most=5)
    label, count = ndimage.label(frontier, np.ones((3, 3, 3)))
    of_part = label.reshape(-1)
    large = np.flatnonzero(np.bincount(of_part, minlength=count + 1) >= 4)[1:]
    np.testing.assert_array_equal(np.sort(np.concatenate(found)), np.flatnonzero(np.isin(of_part, large)))
    for members in found:
        cube = np.stack(np.unravel_index(members, shape), axis=-1) // 5
        assert len(np.unique(cube, axis=0)) == 1
        assert len(np.unique(of_part[members])) == 1


def test_cells_follow_the_voxels() -> None:
    """Open where seen and wide, narrow between two walls, unseen behind, closed in the wall."""
    grid = empty((4.0, 3.0, 2.0))
    grid[20] = True  # a wall at x = 2.0 to 2.1
    grid[20, 12:17, 5:15] = False  # with an opening of 0.5 m by 1 m
    unknown = empty((4.0, 3.0, 2.0))
    unknown[24:] = True
    field = field_from(grid & ~unknown, unknown=unknown, max_distance_m=2.0)
    bounds_m = np.array([[0.3, 0.3, 0.3], [3.7, 2.7, 1.7]])
    cells = Cells(field, bounds_m, 0.2, Body(0.28, 0.15, 0.2, 0.05))
    changed = cells.update()
    at = {
        point: int(cells.of(np.array([point]))[0])
        for point in (
            (1.0, 1.5, 1.0), (2.05, 1.45, 1.0), (2.3, 1.5, 1.0), (3.1, 1.5, 1.0),
            (2.05, 0.8, 1.0), (0.1, 1.5, 1.0),
        )
    }  # fmt: skip
    kinds = [OPEN, NARROW, EDGE, UNSEEN, CLOSED, CLOSED]
    assert [int(cells.kind[cell]) for cell in at.values()] == kinds
    assert cells.clearest_m(np.zeros(0, np.int64)).shape == (0, 3), "a way of one cell has no cells between"
    assert set(np.flatnonzero(cells.kind)) == set(changed.tolist())
    frontier = cells.frontier(1)
    assert len(frontier)
    assert (cells.wanted[frontier] & (cells.kind[frontier] == UNSEEN)).all()
    x_m = cells.centre_m(frontier)[:, 0]
    np.testing.assert_allclose(x_m, 2.5)  # the first layer that was not seen
    np.testing.assert_array_equal(
        cells.still_wanted(np.flatnonzero(cells.kind)), cells.wanted[cells.kind > 0]
    )
    cells.looked[frontier] = 1
    assert not len(cells.frontier(1))
    assert len(cells.frontier(2)) == len(frontier)
    assert not len(cells.update())


SIGHT = Sight(math.radians(45.0), math.radians(-36.8), math.radians(36.8), 4.5)


def places_in(field: DistanceField, bounds_m: Float, clearance_m: float, radius_m: float) -> Places:
    low_m, high_m = bounds_m
    return Places(field.state, field.distance, field.origin_m, 0.1, 0.2, clearance_m, radius_m, low_m, high_m)


def test_sight_ends_at_walls_and_at_what_was_not_seen() -> None:
    grid, unknown = empty((4.0, 3.0, 2.0)), empty((4.0, 3.0, 2.0))
    grid[20, :15] = True  # a wall at x = 2.0 m, up to y = 1.5 m
    unknown[30:] = True
    field = field_from(grid & ~unknown, unknown=unknown, max_distance_m=2.0)
    bounds_m = np.array([[0.3, 0.3, 0.3], [3.7, 2.7, 1.7]])
    places = places_in(field, bounds_m, 0.28, 0.2)
    cells_m = np.array([[2.5, 1.0, 1.0], [2.5, 2.0, 1.0], [3.1, 2.0, 1.0], [3.6, 2.0, 1.0], [0.5, 2.0, 1.0]])
    seen = seen_from(places, SIGHT, np.array([1.0, 2.0, 1.0]), 0.0, cells_m)
    # behind the wall, free, the first unseen, behind unseen ones, behind the eye
    np.testing.assert_array_equal(seen, [False, True, True, False, False])
    count, yaws = look_from(
        places, SIGHT, np.array([[1.0, 2.0, 1.0], [2.2, 1.0, 1.0], [3.6, 2.0, 1.0]]), cells_m[4:], 0.7
    )
    np.testing.assert_array_equal(count, [1, 0, 0])  # the second stands too near the wall, the third unseen
    assert abs(yaws[0]) == pytest.approx(math.pi)


def test_eyes_that_see_much_less_than_the_best_see_none() -> None:
    rng = np.random.default_rng(3)
    grid = rng.random((30, 30, 20)) < 0.01
    unknown = np.zeros_like(grid)
    unknown[22:] = True
    field = field_from(grid & ~unknown, unknown=unknown, max_distance_m=2.0)
    bounds_m = np.array([[0.2, 0.2, 0.2], [2.8, 2.8, 1.8]])
    places = places_in(field, bounds_m, 0.15, 0.1)
    eyes_m = rng.uniform(bounds_m[0], bounds_m[1], (200, 3))
    cells_m = np.column_stack([np.full(16, 2.25), rng.uniform(0.3, 2.7, 16), rng.uniform(0.3, 1.7, 16)])
    every, yaws = look_from(places, SIGHT, eyes_m, cells_m, 0.0)
    for eye_m, yaw, seen in zip(eyes_m, yaws, every, strict=True):
        assert seen in (0, seen_from(places, SIGHT, eye_m, yaw, cells_m).sum())
    enough = every >= 0.7 * every.max()
    assert 3 < enough.sum() < (every > 0).sum() - 3
    best, _ = look_from(places, SIGHT, eyes_m, cells_m, 0.7)
    np.testing.assert_array_equal(best, np.where(enough, every, 0))
