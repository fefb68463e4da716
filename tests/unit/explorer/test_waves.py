"""Costs of ways that spread over cells: scipy's, as far as one asks, and still after cells have changed."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from uavexp.explorer.view import prices
from uavexp.explorer.waves import (
    FAR,
    NEAR_WALL,
    STRAIGHT,
    WALL_LEVELS,
    Wave,
    begin,
    forget,
    mark_kinds,
    new_wave,
    reach,
    way_back,
)
from uavexp.field import UNKNOWN

SHAPE = (13, 17)
WIDTH = SHAPE[1] + 2
LEVEL_PRICES = np.array([0, 100, 100, 100], dtype=np.int32)


def flat(cell: tuple[int, int]) -> int:
    return (cell[0] + 1) * WIDTH + cell[1] + 1


def with_margin(kind: np.ndarray) -> np.ndarray:
    return np.pad(kind, 1).reshape(-1)


def scipy_costs(price: np.ndarray, source: tuple[int, int], source_cost: int) -> np.ndarray:
    """The same graph, built edge by edge, searched by scipy; `price` (X, Y) is 0 where no way leads over."""
    nx, ny = price.shape
    own = price.copy()
    own[source] = price[source] or source_cost
    rows, cols, weights = [], [], []
    for i, j in np.argwhere(own):
        for di, dj in [(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1) if (a, b) != (0, 0)]:
            a, b = i + di, j + dj
            if not (0 <= a < nx and 0 <= b < ny and price[a, b]):
                continue
            if di and dj and not (price[a, j] and price[i, b]):
                continue
            both = int(own[i, j]) + int(price[a, b])
            rows.append(i * ny + j)
            cols.append(a * ny + b)
            weights.append(int(both * math.sqrt(0.5)) if di and dj else both // 2)
    graph = coo_array((weights, (rows, cols)), shape=(nx * ny, nx * ny)).tocsr()
    return dijkstra(graph, indices=source[0] * ny + source[1]).reshape(nx, ny)


def costs(wave: Wave, kind: np.ndarray, price: np.ndarray) -> np.ndarray:
    found = [reach(wave, kind, WIDTH, price, flat(cell), FAR) for cell in np.ndindex(SHAPE)]
    return np.array([math.inf if cost == FAR else cost for cost in found]).reshape(SHAPE)


@pytest.mark.parametrize("seed", range(6))
def test_costs_equal_scipys_from_any_cell_in_any_order(seed: int) -> None:
    rng = np.random.default_rng(seed)
    kind = rng.choice(4, SHAPE, p=[0.3, 0.3, 0.3, 0.1]).astype(np.uint8)
    price = np.array([0, 150, 100, 433], dtype=np.int32)
    wave = new_wave(with_margin(kind).size)
    for source in [(3, 4), (12, 16), tuple(rng.integers(0, SHAPE))]:  # one wave, begun again and again
        expected = scipy_costs(price[kind], source, 321)
        expected[kind == 0] = np.inf  # a source that is not passable can be left, not asked for
        begin(wave, flat(source), 321)
        some = tuple(rng.integers(0, SHAPE))
        first = reach(wave, with_margin(kind), WIDTH, price, flat(some), FAR)
        assert first == min(expected[some], FAR)
        np.testing.assert_array_equal(costs(wave, with_margin(kind), price), expected)


def test_a_way_that_costs_more_than_asked_for_is_not_found_and_is_later() -> None:
    kind, wave = with_margin(np.ones(SHAPE, np.uint8)), new_wave(15 * WIDTH)
    begin(wave, flat((0, 0)), STRAIGHT)
    assert reach(wave, kind, WIDTH, LEVEL_PRICES, flat((0, 9)), 899) == FAR
    assert reach(wave, kind, WIDTH, LEVEL_PRICES, flat((0, 9)), 900) == 900


def passable_cells(
    clearance: np.ndarray, closed: np.ndarray, vehicle: tuple[int, int], escape2: float
) -> np.ndarray:
    """Cells with room, or near the vehicle any; the first row and the last column lie out of bounds."""
    i, j = np.mgrid[: SHAPE[0], : SHAPE[1]]
    near = (i - vehicle[0]) ** 2 + (j - vehicle[1]) ** 2 <= escape2
    passable = ((clearance > np.float32(0.2)) | ((clearance > 0.0) & near)) & ~closed
    passable[0], passable[:, -1] = False, False
    return passable


def kinds(state: np.ndarray, clearance: np.ndarray, passable: np.ndarray, wall_m: float) -> np.ndarray:
    """What `mark_kinds` writes, cell by cell."""
    kind = np.where(passable, 1 + state, 0)
    for cell in np.argwhere(passable & (state == UNKNOWN) & (clearance < np.float32(wall_m))):
        kind[tuple(cell)] = NEAR_WALL + int(WALL_LEVELS * clearance[tuple(cell)] / np.float32(wall_m))
    return kind


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("expected_prices", [False, True])
def test_costs_from_the_target_follow_any_change_of_the_plane(seed: int, expected_prices: bool) -> None:
    """However far the wave was when cells changed: it gives what a new one gives, and so does its way."""
    rng = np.random.default_rng(seed)
    price = prices(1.2, 4.0, 3.0) if expected_prices else prices(1.0, 1.0)
    wall_m = 0.6 if expected_prices else 0.0
    whole, target = np.array([[0, SHAPE[0], 0, SHAPE[1]]]), (6, 8)
    inside = (1, SHAPE[0], 0, SHAPE[1] - 1)
    state = rng.integers(0, 3, SHAPE).astype(np.uint8)
    clearance = rng.uniform(-0.2, 1.0, SHAPE).astype(np.float32)
    kind, wave = with_margin(np.zeros(SHAPE, np.uint8)), new_wave(15 * WIDTH)
    begin(wave, flat(target), STRAIGHT)
    for _ in range(60):
        vehicle = tuple(int(n) for n in rng.integers(0, SHAPE))
        closed = rng.random(SHAPE) < 0.03
        level = mark_kinds(
            state, clearance, whole, inside, np.float32(0.2), np.float32(wall_m), closed, vehicle, 4.5, kind,
            price, wave,
        )  # fmt: skip
        if level < FAR - 1:
            forget(wave, level, math.ceil(math.sqrt(2.0) * price.max()))
        passable = passable_cells(clearance, closed, vehicle, 4.5)
        of_each = kinds(state, clearance, passable, wall_m)
        np.testing.assert_array_equal(kind, with_margin(of_each))
        expected = scipy_costs(price[of_each], target, STRAIGHT)
        expected[~passable] = np.inf
        asked = [tuple(rng.integers(0, SHAPE)) for _ in range(3)]
        for cell in asked if rng.random() < 0.7 else np.ndindex(SHAPE):
            found = reach(wave, kind, WIDTH, price, flat(cell), int(rng.choice([700, FAR])))
            assert found == expected[cell] or (found == FAR and expected[cell] > 700)
            if found < FAR:
                way = np.column_stack(np.divmod(way_back(wave, kind, WIDTH, price, flat(cell)), WIDTH)) - 1
                assert [tuple(way[0]), tuple(way[-1])] == [tuple(cell), target]
                assert length_of(way, price[of_each], STRAIGHT) == found
        for cell in rng.integers(0, SHAPE, (rng.integers(0, 6), 2)):
            clearance[tuple(cell)] = rng.uniform(-0.2, 1.0)
            state[tuple(cell)] = rng.integers(0, 3)


def length_of(way: np.ndarray, price: np.ndarray, source_cost: int) -> int:
    """Cost of a way, step by step; the source's own where it is not passable."""
    own = [int(price[tuple(cell)]) or source_cost for cell in way]
    straight = [np.abs(step).sum() == 1 for step in np.diff(way, axis=0)]
    both = [one + other for one, other in itertools.pairwise(own)]
    return sum(
        pair // 2 if is_straight else int(pair * math.sqrt(0.5))
        for pair, is_straight in zip(both, straight, strict=True)
    )
