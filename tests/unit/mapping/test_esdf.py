"""The signed distance transform, kept by windows, against scipy's exact one and against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from tests.exact_distance import VOXEL_M, Replay, exact_field
from uavexp.errors import ConfigError
from uavexp.field import FREE, OCCUPIED, UNKNOWN
from uavexp.mapping.esdf import distance_table


def random_edit(state: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Some voxels or a whole box become occupied or free; what was seen stays seen."""
    state = state.copy()
    value = rng.choice([FREE, OCCUPIED])
    match rng.integers(4):
        case 0:
            state.reshape(-1)[rng.integers(0, state.size, max(1, state.size // 6))] = value
        case 1:
            state.reshape(-1)[rng.integers(0, state.size, 3)] = value
        case 2:
            state[tuple(slice(*sorted(rng.integers(0, n + 1, 2))) for n in state.shape)] = value
        case _:
            state[rng.random(state.shape) < 0.5] = FREE
    return state


SHAPES = [
    (1, 1, 1), (1, 1, 9), (1, 9, 1), (9, 1, 1), (7, 5, 3), (12, 1, 17), (1, 16, 33), (25, 24, 1),
    (14, 13, 12), (40, 9, 31), (31, 44, 6),
]  # fmt: skip


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("max_distance_m", [0.1, 0.55, 2.0])
def test_field_equals_exact_transform_through_random_insertions_and_removals(shape, max_distance_m):
    rng = np.random.default_rng([*shape, int(100 * max_distance_m)])
    for _ in range(8):
        replay = Replay(shape, max_distance_m)
        state = replay.state
        for _ in range(10):
            state = random_edit(state, rng)
            replay.become(state, rng)
            expected = exact_field(state == OCCUPIED, max_distance_m)
            np.testing.assert_array_equal(replay.field.distance, expected)


def test_change_log_is_exactly_what_changed():
    rng = np.random.default_rng(3)
    replay = Replay((17, 12, 9))
    state = replay.state
    for _ in range(40):
        before, seen_before = replay.field.distance.copy(), replay.state != UNKNOWN
        state = random_edit(state, rng)
        update = replay.become(state, rng)
        first = (state != UNKNOWN) & ~seen_before
        listed = np.flatnonzero((before != replay.field.distance) | first)
        np.testing.assert_array_equal(update.voxel, listed)
        np.testing.assert_array_equal(update.first_seen, first.reshape(-1)[listed])
        np.testing.assert_array_equal(update.occupied, (state == OCCUPIED).reshape(-1)[listed])
        old = np.where(first, np.float32(1.0), before).reshape(-1)
        np.testing.assert_array_equal(update.old_distance_m, old[listed])
        np.testing.assert_array_equal(update.new_distance_m, replay.field.distance.reshape(-1)[listed])


def test_no_change_leaves_an_empty_log():
    replay = Replay((8, 8, 8))
    state = replay.state.copy()
    state[4, 4, 4] = OCCUPIED
    assert replay.become(state).voxel.size > 0
    assert replay.become(state).voxel.size == 0
    # a voxel listed as flipped that did not flip changes nothing either
    assert replay.field.update(0.0, state, np.array([5, 5], np.int32), np.zeros(0, np.int32)).voxel.size == 0


def test_removing_everything_restores_the_empty_field():
    rng = np.random.default_rng(5)
    replay = Replay((20, 20, 10), 2.0)
    replay.become(np.where(rng.random(replay.state.shape) < 0.2, OCCUPIED, FREE).astype(np.uint8))
    replay.become(np.full(replay.state.shape, FREE, np.uint8))
    assert (replay.field.distance == np.float32(2.0)).all()


def test_field_has_slope_one_across_a_surface_and_is_lipschitz():
    state = np.full((40, 20, 20), FREE, np.uint8)
    state[20:] = OCCUPIED
    replay = Replay(state.shape, 1.5)
    replay.become(state)
    line = replay.field.distance[:, 10, 10]
    inner = np.abs(line) < 1.45
    np.testing.assert_allclose(np.diff(line)[inner[1:] & inner[:-1]], -VOXEL_M, atol=1e-6)
    assert line[19] == pytest.approx(0.5 * VOXEL_M)
    assert line[20] == pytest.approx(-0.5 * VOXEL_M)
    rng = np.random.default_rng(0)
    replay.become(np.where(rng.random(state.shape) < 0.01, OCCUPIED, FREE).astype(np.uint8))
    for axis in range(3):
        assert np.abs(np.diff(replay.field.distance, axis=axis)).max() <= VOXEL_M + 1e-6


def test_distance_to_a_box_is_right_to_about_a_voxel():
    """Against the closed form of a box whose faces pass through voxel centres and between them."""
    state = np.full((60, 50, 40), FREE, np.uint8)
    centres = (np.stack(np.meshgrid(*(np.arange(n) for n in state.shape), indexing="ij"), -1) + 0.5) * VOXEL_M
    low, high = np.array([2.03, 1.98, 1.0]), np.array([3.51, 3.0, 2.27])
    state[((centres >= low) & (centres <= high)).all(axis=-1)] = OCCUPIED
    replay = Replay(state.shape, 2.0)
    replay.become(state)
    outside = np.maximum(np.maximum(low - centres, centres - high), 0.0)
    true = np.linalg.norm(outside, axis=-1)
    error = (replay.field.distance - true)[(true > 0.0) & (true < 1.7)]
    assert abs(error.mean()) < VOXEL_M / 3
    assert np.abs(error).max() < VOXEL_M


def test_truncation_beyond_the_integers_is_refused():
    with pytest.raises(ConfigError, match="max_distance_m must be <="):
        distance_table(0.01, 2.0)
    assert distance_table(0.02, 2.0)[0] > 0


def test_beyond_truncation_is_exactly_the_truncation():
    for max_distance_m in (0.3, 1.0, 1.234, 2.0):
        cap, table = distance_table(VOXEL_M, max_distance_m)
        assert table[-1] == np.float32(max_distance_m) == -table[0]
        assert (np.diff(table) >= 0.0).all()
        assert table[2 * cap - 1] < max_distance_m
