"""Planar kernels against scipy's graph search and brute force; goals in a small known map."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from uavexp.check.fields import box, empty, field_from
from uavexp.explorer.planar import (
    ascend,
    connected_components,
    density_clusters,
    frontier_cells,
    path_lengths,
    split_centroids,
    split_long,
    unknown_within,
)


def scipy_lengths(passable: np.ndarray, cost: np.ndarray, source: tuple[int, int]) -> np.ndarray:
    """The same graph, built edge by edge, searched by scipy."""
    nx, ny = passable.shape
    rows, cols, weights = [], [], []
    for i in range(nx):
        for j in range(ny):
            for di, dj in [(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1) if (a, b) != (0, 0)]:
                a, b = i + di, j + dj
                if not (0 <= a < nx and 0 <= b < ny and passable[a, b]):
                    continue
                if not (passable[i, j] or (i, j) == source) or (
                    not (passable[a, j] and passable[i, b]) and di and dj
                ):
                    continue
                rows.append(i * ny + j)
                cols.append(a * ny + b)
                both = int(cost[i, j]) + int(cost[a, b])
                weights.append(int(both * math.sqrt(0.5)) if di and dj else both // 2)
    graph = coo_array((weights, (rows, cols)), shape=(nx * ny, nx * ny)).tocsr()
    return dijkstra(graph, indices=source[0] * ny + source[1]).reshape(nx, ny)


@pytest.mark.parametrize("seed", range(6))
def test_path_lengths_equal_scipys(seed: int) -> None:
    rng = np.random.default_rng(seed)
    passable = rng.random((13, 17)) < 0.7
    cost = rng.integers(100, 500, passable.shape).astype(np.int32)
    expected = scipy_lengths(passable, cost, (3, 4)) / 100
    everywhere = np.zeros(0, dtype=np.int64)
    np.testing.assert_allclose(path_lengths(passable, cost, (3, 4), everywhere), expected, rtol=1e-5)
    wanted = rng.choice(passable.size, 3, replace=False)
    some = path_lengths(passable, cost, (3, 4), wanted)
    np.testing.assert_allclose(some.ravel()[wanted], expected.ravel()[wanted], rtol=1e-5)
    assert (some >= expected * (1.0 - 1e-6)).all()


def test_frontier_is_free_beside_unknown() -> None:
    rng = np.random.default_rng(0)
    state = rng.integers(0, 3, (15, 11)).astype(np.uint8)
    inside = rng.random(state.shape) < 0.9
    expected = np.zeros(state.shape, dtype=bool)
    for i, j in np.argwhere((state == 1) & inside):
        window = np.s_[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2]
        expected[i, j] = ((state[window] == 0) & inside[window]).any()
    np.testing.assert_array_equal(frontier_cells(state, inside), expected)


def test_clusters_partition_the_frontier() -> None:
    cells = np.zeros((20, 20), dtype=bool)
    cells[2, 2:9] = cells[10:16, 15] = cells[18, 1] = True
    parts = connected_components(cells)
    assert [len(part) for part in parts] == [7, 6, 1]
    dense = density_clusters(cells, 1.5, 3)
    assert sorted(len(part) for part in dense) == [6, 7]  # the single cell is noise
    assert density_clusters(np.zeros_like(cells), 1.5, 3) == []


def test_long_clusters_are_split_until_short_and_nothing_is_lost() -> None:
    line = np.stack([np.arange(40), np.full(40, 3)], axis=1).astype(np.int32)
    part = split_long(line, 12.0)
    parts = [line[part == n] for n in range(part.max() + 1)]
    assert sorted(tuple(cell) for part in parts for cell in part) == [tuple(cell) for cell in line]
    assert all(np.ptp(part[:, 0]) <= 12 for part in parts)
    np.testing.assert_array_equal(split_long(line[:1], 0.5), [0])
    means = np.array([cells.mean(axis=0) for cells in parts])
    np.testing.assert_allclose(split_centroids(line, 12.0), means, rtol=1e-12)


def test_ascent_ends_where_the_clearance_is_enough_or_at_the_bounds() -> None:
    occupied = empty((4.0, 4.0, 2.0))
    box(occupied, (0.0, 0.0, 0.0), (0.1, 4.0, 2.0))
    field = field_from(occupied)
    bounds = np.array([[0.5, 0.5, 1.0], [3.5, 3.5, 1.0]])
    start = np.array([[0.6, 2.0, 1.0], [2.5, 2.0, 1.0]])
    moved = ascend(field.distance, field.origin_m, field.voxel_size_m, start, 0.1, 20, 0.8, bounds)
    assert field.distance_m(moved)[0] >= 0.8
    np.testing.assert_allclose(moved[0, 1:], start[0, 1:])  # straight away from the wall
    np.testing.assert_array_equal(moved[1], start[1])  # enough already
    stopped = ascend(field.distance, field.origin_m, field.voxel_size_m, start, 0.1, 3, 0.8, bounds)
    assert stopped[0, 0] == pytest.approx(0.9)


def test_information_counts_unknown_cells_in_a_disc() -> None:
    state = np.zeros((21, 21), dtype=np.uint8)
    inside = np.ones(state.shape, dtype=bool)
    di, dj = np.mgrid[-10:11, -10:11]
    cells = np.array([10 * 21 + 10])
    assert unknown_within(state, inside, cells, 4.5) == [int((di**2 + dj**2 <= 4.5**2).sum())]
    state[:] = 1
    assert unknown_within(state, inside, cells, 4.5) == [0]
