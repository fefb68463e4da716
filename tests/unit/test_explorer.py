"""Planar kernels against scipy's graph search and brute force; goals in a small known map."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from uavexp.explorer.planar import (
    connected_components,
    density_clusters,
    frontier_cells,
    path_lengths,
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
    lengths = path_lengths(passable, cost, (3, 4))
    np.testing.assert_allclose(lengths, scipy_lengths(passable, cost, (3, 4)) / 100, rtol=1e-5)


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
    parts = split_long(line, 12.0)
    assert sorted(tuple(cell) for part in parts for cell in part) == [tuple(cell) for cell in line]
    assert all(np.ptp(part[:, 0]) <= 12 for part in parts)
    np.testing.assert_array_equal(split_long(line[:1], 0.5)[0], line[:1])


def test_information_counts_unknown_cells_in_a_disc() -> None:
    state = np.zeros((21, 21), dtype=np.uint8)
    inside = np.ones(state.shape, dtype=bool)
    di, dj = np.mgrid[-10:11, -10:11]
    assert unknown_within(state, inside, (10, 10), 4.5) == int((di**2 + dj**2 <= 4.5**2).sum())
    state[:] = 1
    assert unknown_within(state, inside, (10, 10), 4.5) == 0
