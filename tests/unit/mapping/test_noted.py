"""An obstacle that was felt stays in the map, whatever is measured there."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.unit.mapping.test_fusing import CAMERA_M, WALL, begin, centres, occupied, take_scan

FELT_M = np.array([2.6, 3.0, 1.5])


@pytest.mark.parametrize("option", ["dense", "voxel_block_grid"])
def test_a_noted_ball_is_occupied_exactly_and_stays_so_under_rays_that_pass_it(option: str) -> None:
    backend: Any = begin(option)
    inside = np.linalg.norm(centres(backend) - FELT_M, axis=-1) <= 0.2
    free_m = None
    for n in range(40):
        if n == 5:
            free_m = float(backend.field.distance_m(FELT_M[None])[0])
            backend.note_obstacle(FELT_M, 0.2)
        backend.integrate(take_scan([WALL], CAMERA_M))
        update = backend.update(0.1 * n)
        if n == 5:
            assert set(np.flatnonzero(inside)) <= set(update.voxel[update.occupied].tolist())
    assert free_m is not None
    assert occupied(backend)[inside].all()
    assert float(backend.field.distance_m(FELT_M[None])[0]) < 0.0 < free_m
    other: Any = begin(option)
    for n in range(40):
        other.integrate(take_scan([WALL], CAMERA_M))
        other.update(0.1 * n)
    np.testing.assert_array_equal(occupied(backend) & ~inside, occupied(other) & ~inside)
