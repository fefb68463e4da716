"""Planar kernels against brute force and scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from uavexp.check.fields import box, empty, field_from
from uavexp.explorer.planar import (
    ascend,
    cluster_centroids,
    connected_components,
    density_clusters,
    mark_frontier,
    split_long,
    unknown_within,
)


def test_frontier_is_free_beside_unknown_and_follows_every_change() -> None:
    rng, inside = np.random.default_rng(0), (1, 14, 2, 10)
    state = rng.integers(0, 3, (15, 11)).astype(np.uint8)
    frontier, parts = np.zeros(state.shape, dtype=bool), np.array([[0, 15, 0, 11]])
    for _ in range(20):
        mark_frontier(state, inside, parts, frontier)
        expected = np.zeros(state.shape, dtype=bool)
        known = np.where(within(state.shape, inside), state, 2)
        for i, j in np.argwhere(known == 1):
            expected[i, j] = (known[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2] == 0).any()
        np.testing.assert_array_equal(frontier, expected)
        i, j = rng.integers(0, 12), rng.integers(0, 9)
        parts = np.array([[i, i + 3, j, j + 2]])
        state[i : i + 3, j : j + 2] = rng.integers(0, 3, (3, 2))


def within(shape: tuple[int, ...], part: tuple[int, int, int, int]) -> np.ndarray:
    inside = np.zeros(shape, dtype=bool)
    inside[part[0] : part[1], part[2] : part[3]] = True
    return inside


def test_clusters_partition_the_frontier_as_scipys_do() -> None:
    rng = np.random.default_rng(0)
    for share in (0.05, 0.2, 0.5):
        cells = rng.random((30, 20)) < share
        label, count = ndimage.label(cells, structure=np.ones((3, 3)))
        number = connected_components(cells, np.argwhere(cells))
        assert number.max() + 1 == count
        np.testing.assert_array_equal(number, label[cells] - 1)


def test_density_clusters_leave_noise_out() -> None:
    cells = np.zeros((20, 20), dtype=bool)
    cells[2, 2:9] = cells[10:16, 15] = cells[18, 1] = True
    dense = density_clusters(np.argwhere(cells), 1.5, 3)
    assert sorted(np.bincount(dense[dense >= 0])) == [6, 7]  # the single cell is noise
    assert (dense < 0).sum() == 1
    assert density_clusters(np.zeros((0, 2), np.int64), 1.5, 3).size == 0


def test_long_clusters_are_split_until_short_and_nothing_is_lost() -> None:
    line = np.stack([np.arange(40), np.full(40, 3)], axis=1)
    cells = line[np.random.default_rng(0).permutation(40)]
    ends = split_long(cells, 12.0)
    parts = np.split(cells, ends[:-1])
    assert ends[-1] == 40
    assert sorted(map(tuple, cells)) == sorted(map(tuple, line))
    assert all(np.ptp(part[:, 0]) <= 12 for part in parts)
    np.testing.assert_array_equal(split_long(line[:1].copy(), 0.5), [1])
    means = np.array([part.mean(axis=0) for part in parts])
    single, both = np.zeros(40, np.int64), np.repeat([-1, 0, 1, 2], [5, 40, 3, 7])
    np.testing.assert_allclose(
        np.sort(cluster_centroids(line, single, 5, 12.0), axis=0), np.sort(means, axis=0)
    )
    many = np.concatenate([line[:5], line, line[:3], line[:7] + np.array([0, 9])])
    found = cluster_centroids(many, both, 5, 12.0)  # no noise, and nothing of the cluster of three
    assert len(found) == len(means) + 1
    np.testing.assert_allclose(found[-1], [3.0, 12.0])


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
    inside = (0, 21, 0, 21)
    di, dj = np.mgrid[-10:11, -10:11]
    cells = np.array([[10, 10]])
    assert unknown_within(state, inside, cells, 4.5) == [int((di**2 + dj**2 <= 4.5**2).sum())]
    assert unknown_within(state, (10, 11, 8, 21), cells, 4.5) == [7]  # the rest is out of bounds
    state[:] = 1
    assert unknown_within(state, inside, cells, 4.5) == [0]
