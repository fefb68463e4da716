"""The planar map: least clearance over the band, and unknown until seen at flight height."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from uavexp.check.fields import field_from
from uavexp.errors import ConfigError
from uavexp.field import FREE, OCCUPIED, TILE, UNKNOWN, DistanceField
from uavexp.mapping.projection import Band, PlanarMap, Projection

BAND = {"z_min_m": 1.0, "z_max_m": 1.4, "flight_height_m": 1.2, "occupied_below_m": 0.3}


def project(field: DistanceField, **band: float) -> PlanarMap:
    projection = Projection(field, Band(**{**BAND, **band}))
    projection.update()
    return projection.planar


def room(unknown=None):
    """Floor, ceiling, a shelf board at 1.3 m in one corner and a low crate in another."""
    occupied = np.zeros((40, 30, 24), dtype=bool)
    occupied[:, :, 0] = occupied[:, :, -1] = True
    occupied[5:10, 5:10, 13] = True
    occupied[30:35, 20:25, 1:4] = True
    return field_from(occupied, origin_m=(-1.0, 2.0, 0.0), unknown=unknown)


def test_clearance_is_the_least_of_the_band():
    field = room()
    planar = project(field)
    height = field.origin_m[2] + (np.arange(10, 14) + 0.5) * field.voxel_size_m
    for cell in ((0, 0), (5, 5), (6, 4), (20, 13), (25, 19)):
        centre = planar.centre_m(np.array(cell))
        column = np.column_stack([np.tile(centre, (4, 1)), height])
        assert planar.clearance[cell] == pytest.approx(field.distance_m(column).min(), abs=1e-5)


def test_band_leaves_out_floor_ceiling_and_low_crates_but_not_a_board_in_it():
    planar = project(room())
    assert planar.state[planar.cell_of(np.array([-0.25, 2.75]))] == OCCUPIED
    assert planar.state[planar.cell_of(np.array([2.25, 4.25]))] == FREE
    everything = project(room(), z_min_m=0.0, z_max_m=2.4)
    assert (everything.state == OCCUPIED).all()


def test_column_is_unknown_until_seen_at_flight_height():
    unknown = np.zeros((40, 30, 24), dtype=bool)
    unknown[20:, :, 12] = True  # seen above and below, not at 1.2 m
    unknown[:20, :, 14:] = True  # seen at 1.2 m only
    planar = project(room(unknown))
    x = planar.origin_m[0] + (np.arange(planar.state.shape[0]) + 0.5) * planar.cell_m
    np.testing.assert_array_equal((planar.state == UNKNOWN).all(axis=1), x > 1.0)
    np.testing.assert_array_equal((planar.state == UNKNOWN).any(axis=1), x > 1.0)


def test_cells_and_centres_are_inverse():
    planar = project(room())
    for cell in ((0, 0), (3, 17), (26, 19)):
        assert planar.cell_of(planar.centre_m(np.array(cell))) == cell
    assert planar.cell_of(np.array([-50.0, 50.0])) == (0, planar.state.shape[1] - 1)


def test_bands_that_miss_the_flight_height_are_refused():
    for wrong in ({"z_min_m": 1.3}, {"z_max_m": 1.1}, {"z_max_m": float("nan")}, {"cell_m": 0.0}):
        with pytest.raises(ConfigError):
            project(room(), **wrong)


@pytest.mark.parametrize("cell_m", [0.15, 0.07, 0.4])
def test_what_is_projected_anew_after_changes_is_what_a_whole_projection_gives(cell_m):
    """Any voxel may change: those that cells look at lie in tiles that are counted, or all is unknown yet."""
    rng, field = np.random.default_rng(0), room()
    distance, state = field.distance.copy(), field.state.copy()
    changed = np.zeros((5, 4), np.int32)
    live = replace(field, distance=distance, state=state, changed=changed)
    projection = Projection(live, Band(**BAND, cell_m=cell_m))
    projection.update()
    for _ in range(40):
        a, b = rng.integers(0, 5), rng.integers(0, 4)
        tile = np.s_[a * TILE : (a + 1) * TILE, b * TILE : (b + 1) * TILE]
        distance[tile] = rng.uniform(-0.5, 2.0, distance[tile].shape)
        state[tile] = rng.integers(0, 3, state[tile].shape)
        changed[a, b] += 1
        parts = projection.update()
        whole = project(live, cell_m=cell_m)
        np.testing.assert_array_equal(projection.planar.clearance, whole.clearance)
        np.testing.assert_array_equal(projection.planar.state, whole.state)
        assert len(parts) == 1
    assert len(projection.update()) == 0
