"""A shelf between two layers of voxel centres, seen along itself: only what hits its edge tells of it."""

from __future__ import annotations

import numpy as np

from tests.maps import BOUNDS_M, NOTHING, centres, occupied
from tests.unit.mapping.test_fusing import CAMERA_M, WALL, take_scan
from uavexp.check.scans import Box
from uavexp.mapping.dense import Dense
from uavexp.mapping.dense_thin import DenseThin

SHELF = ((2.32, 2.02, 1.38), (3.02, 4.08, 1.42))  # its layers' centres are at 1.35 and 1.45 m


def mapped(backend: Dense, parts: list[Box], scans: int = 10) -> np.ndarray:
    backend.reset(BOUNDS_M, NOTHING)
    for n in range(scans):
        backend.integrate(take_scan(parts, CAMERA_M))
        backend.update(0.05 * n)
    return occupied(backend)


def test_a_shelf_at_the_height_of_the_camera_is_mapped_along_its_edge() -> None:
    thin = DenseThin()
    found = mapped(thin, [SHELF])
    places = centres(thin)
    edge = (np.abs(places[..., 0] - 2.35) < 0.06) & (np.abs(places[..., 2] - 1.4) < 0.06)
    edge &= (places[..., 1] > 2.1) & (places[..., 1] < 4.0)
    along = found & edge
    assert along.any(axis=(0, 2))[20:40].mean() > 0.9
    assert not found[places[..., 0] < 2.25].any()
    assert not mapped(Dense(), [SHELF])[edge].any()


def test_of_a_wall_it_maps_what_fusion_does_and_nothing_before_it() -> None:
    thin = DenseThin()
    found, fused = mapped(thin, [WALL]), mapped(Dense(), [WALL])
    assert not (fused & ~found).any()
    more = found & ~fused  # at the border of the image, where a centre is beside it
    assert more.sum() < 0.02 * fused.sum()
    assert (centres(thin)[more][:, 0] > WALL[0][0]).all()


def test_one_hit_is_not_enough_and_farther_than_its_range_nothing_counts() -> None:
    assert not mapped(DenseThin(), [SHELF], scans=1)[:30].any()
    near = DenseThin(thin_range_m=1.0)
    np.testing.assert_array_equal(mapped(near, [SHELF]), mapped(Dense(), [SHELF]))
