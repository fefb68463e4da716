"""The map that a log keeps."""

from __future__ import annotations

import dataclasses

import numpy as np

import uavexp
from uavexp.field import FREE, OCCUPIED, DistanceField
from uavexp.map_grid import first_s, free_voxels, map_grid


def test_a_voxel_is_as_old_as_its_first_finding() -> None:
    found = [np.array(now, dtype=np.int32) for now in ([4, 7], [], [7, 2], [2, 4])]
    times_s = first_s(np.array([2, 4, 5, 7]), found, [0.1, 0.2, 0.3, 0.4])
    np.testing.assert_allclose(times_s, [0.3, 0.1, 0.0, 0.1], rtol=1e-6)


def test_nothing_found_was_known_before_the_flight() -> None:
    assert first_s(np.array([3, 9]), [], []).tolist() == [0.0, 0.0]
    assert first_s(np.zeros(0, dtype=np.int64), [np.array([1], dtype=np.int32)], [0.1]).size == 0


def test_free_voxels_come_back_whatever_the_shape() -> None:
    state = np.random.default_rng(0).integers(0, 3, (3, 5, 7)).astype(np.uint8)
    field = DistanceField(
        origin_m=np.zeros(3), voxel_size_m=0.1, max_distance_m=1.0,
        distance=np.ones(state.shape, dtype=np.float32), state=state,
    )  # fmt: skip
    grid = map_grid(field, np.flatnonzero(state == OCCUPIED), [], [])
    np.testing.assert_array_equal(free_voxels(grid), state == FREE)
    assert free_voxels(dataclasses.replace(grid, shape=np.zeros(0, dtype=np.int64))).size == 0


def test_a_flight_maps_what_it_saw_when_it_saw_it() -> None:
    trial = uavexp.fly(strategy="tbr", seed=100, world="random_columns", **{
        "world.size_m": [8.0, 6.0, 2.6], "mission.time_base_s": 2.0, "mission.time_per_path_spm": 0.0,
    })  # fmt: skip
    log, grid = trial.log, trial.log.grid
    assert grid.occupied_s.shape == (len(log.mapped_m),)
    assert set(np.round(grid.occupied_s, 4)) <= set(np.round(log.ticks.tick_s, 4).astype(np.float32))
    assert len(set(grid.occupied_s.tolist())) > 3, "it saw more as it flew"
    index = (log.mapped_m - grid.origin_m) / grid.voxel_size_m - 0.5
    np.testing.assert_allclose(index, np.rint(index), atol=1e-3)
    free = free_voxels(grid)
    assert free.sum() > 1000
    assert not free[tuple(np.rint(index).astype(int).T)].any(), "occupied is not free"
    flown = np.floor((log.steps.position_m - grid.origin_m) / grid.voxel_size_m).astype(int)
    assert free[tuple(flown.T)].all(), "the vehicle flies where it is free"
