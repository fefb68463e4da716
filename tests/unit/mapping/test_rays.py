"""Single rays into a map: against closed forms of a box room, and against a traversal by sampling."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.maps import FUSING, NOTHING, begin, centres, occupied
from uavexp.check.scans import Box, ring_directions, take_ray_scan, take_scan
from uavexp.field import FREE, OCCUPIED, UNKNOWN
from uavexp.mapping.dense import Dense
from uavexp.scan import RayScan

ROOM_M = np.array([[1.02, 1.07, 0.33], [6.96, 4.93, 2.71]])  # inner faces
WALLS: list[Box] = [
    ((0.0, 0.0, 0.0), (1.02, 6.0, 3.0)),
    ((6.96, 0.0, 0.0), (8.0, 6.0, 3.0)),
    ((0.0, 0.0, 0.0), (8.0, 1.07, 3.0)),
    ((0.0, 4.93, 0.0), (8.0, 6.0, 3.0)),
    ((0.0, 0.0, 0.0), (8.0, 6.0, 0.33)),
    ((0.0, 0.0, 2.71), (8.0, 6.0, 3.0)),
]
BALL = ((3.4, 2.9, 1.2), (3.9, 3.4, 1.9))
SENSOR_M = (2.3, 3.0, 1.4)
ALL_AROUND = ring_directions()


@pytest.fixture(params=FUSING)
def option(request):
    return request.param


def scan_room(backend, *boxes: Box, scans: int = 3, noise=None, directions=ALL_AROUND):
    for _ in range(scans):
        backend.integrate(take_ray_scan([*WALLS, *boxes], SENSOR_M, directions, noise=noise))
    backend.update(0.0)


def ray(origin, direction, range_m, max_range_m=5.0) -> RayScan:
    return RayScan(
        time_s=0.0,
        origin_m=np.asarray(origin, dtype=np.float64),
        direction=np.array([direction], np.float32),
        range_m=np.array([range_m], np.float32),
        max_range_m=max_range_m,
    )


@pytest.mark.parametrize("seed", [None, 3])
def test_a_room_is_mapped_where_it_stands(option, seed):
    backend = begin(option)
    noise = None if seed is None else np.random.default_rng(seed)
    scan_room(backend, noise=noise, directions=ring_directions(128, 720))
    at, state = centres(backend), backend.field.state
    # signed depth under the nearest wall: < 0 inside of the room
    into = np.maximum(ROOM_M[0] - at, at - ROOM_M[1]).max(axis=-1)
    skin = np.maximum(ROOM_M[0] - at, at - ROOM_M[1])
    face_on = np.sort(skin, axis=-1)[..., 1] < -0.3  # away from edges, which the rays graze
    shell = (into > 0.0) & (into < 0.1) & face_on
    # where there are rays, a voxel's width apart, and less than 60° off the wall's normal (`occupancy`)
    offset = at - np.array(SENSOR_M)
    away = np.linalg.norm(offset, axis=-1)
    square = np.take_along_axis(np.abs(offset), skin.argmax(axis=-1)[..., None], axis=-1)[..., 0]
    close = (away < 2.5) & (np.abs(offset[..., 2]) < 0.97 * away)
    steep = shell & close & (square > 0.5 * away)
    assert steep.sum() > 1000
    assert (state[steep] == OCCUPIED).mean() > 0.99
    assert (state[(into < -0.15) & close] == FREE).mean() > 0.99
    assert (into[occupied(backend)] > -0.1).all()
    assert (state[into > 0.45] == UNKNOWN).all()


def test_rays_and_depth_images_agree_on_the_distance_to_a_wall(option):
    wall: Box = ((3.0, -1.0, -1.0), (4.0, 7.0, 4.0))
    by_rays, by_image = begin(option), begin(option)
    for _ in range(3):
        by_rays.integrate(take_ray_scan([wall], (0.55, 3.05, 1.45), ALL_AROUND, max_range_m=5.0))
        by_image.integrate(take_scan([wall], (0.55, 3.05, 1.45)))
    for backend in (by_rays, by_image):
        backend.update(0.0)
    probes = np.stack(np.meshgrid(np.arange(1.5, 2.9, 0.1), [2.6, 3.0, 3.4], [1.2, 1.6]), -1).reshape(-1, 3)
    gap = by_rays.field.distance_m(probes) - by_image.field.distance_m(probes)
    assert np.abs(gap).max() < 0.03
    np.testing.assert_allclose(
        by_rays.field.distance_m(probes), np.minimum(3.0 - probes[:, 0], 2.0), atol=0.06
    )


def test_no_return_is_free_up_to_the_range_and_missing_tells_nothing(option):
    backend = begin(option)
    backend.integrate(ray((0.55, 3.05, 1.45), (1.0, 0.0, 0.0), np.nan))
    assert backend.update(0.0).voxel.size == 0
    backend.integrate(ray((0.55, 3.05, 1.45), (1.0, 0.0, 0.0), np.inf, max_range_m=4.0))
    update = backend.update(0.1)
    seen = backend.field.voxel_centres_m(update.voxel)
    np.testing.assert_allclose(np.sort(seen[:, 0]), np.arange(0.55, 4.56, 0.1), atol=1e-9)
    assert (seen[:, 1:] == seen[0, 1:]).all()
    assert not update.occupied.any()


def test_one_look_at_a_surface_is_never_called_free(option):
    backend = begin(option)
    backend.integrate(ray((0.55, 3.05, 1.45), (1.0, 0.0, 0.0), 3.0))
    seen = backend.field.voxel_centres_m(backend.update(0.0).voxel)
    assert seen[:, 0].max() < 3.55
    backend.integrate(ray((0.55, 3.05, 1.45), (1.0, 0.0, 0.0), 3.0))
    update = backend.update(0.1)
    hit = backend.field.voxel_centres_m(update.voxel[update.occupied])
    assert hit[:, 0].min() == pytest.approx(3.55)


def test_what_has_moved_away_is_forgotten_by_evidence_alone(option):
    """No detection here: the rays through the place are enough."""
    backend = begin(option)
    scan_room(backend)
    empty = occupied(backend).copy()
    scan_room(backend, BALL, scans=10)
    at = centres(backend)
    near = ((at > np.array(BALL[0]) - 0.35) & (at < np.array(BALL[1]) + 0.35)).all(axis=-1)
    assert (occupied(backend) & near).sum() > 20
    scan_room(backend, scans=13)  # as many misses as evidence there can be, and one
    assert not (occupied(backend) & near).any()
    assert (backend.field.state[near & ~empty] == FREE).mean() > 0.99


def test_a_mover_that_passes_leaves_no_ghost(option):
    backend = begin(option)
    scan_room(backend)
    for step in range(20):  # 1 m/s at 10 Hz
        y = 1.6 + 0.1 * step
        backend.integrate(take_ray_scan([*WALLS, ((3.4, y, 0.4), (3.9, y + 0.5, 2.0))], SENSOR_M, ALL_AROUND))
    scan_room(backend, scans=13)
    at = centres(backend)
    path = ((at > (3.2, 1.4, 0.6)) & (at < (4.4, 4.3, 2.3))).all(axis=-1)
    assert not (occupied(backend) & path).any()
    assert backend.field.distance_m(np.array([[3.65, 2.5, 1.4]]))[0] > 0.7


def test_the_order_of_the_rays_does_not_matter(option):
    backends, order = [begin(option), begin(option)], np.random.default_rng(0).permutation(len(ALL_AROUND))
    for backend, directions in zip(backends, (ALL_AROUND, ALL_AROUND[order]), strict=True):
        scan_room(backend, BALL, directions=directions)
    np.testing.assert_array_equal(backends[0].field.state, backends[1].field.state)
    np.testing.assert_array_equal(backends[0].field.distance, backends[1].field.distance)


def test_backends_agree_also_when_rays_and_images_alternate():
    """Tolerance as for images alone: what lies on the border of a pixel is seen differently in 32 bits."""
    other, dense = begin("voxel_block_grid"), begin("dense")
    for backend in (other, dense):
        for _ in range(4):
            backend.integrate(take_ray_scan([*WALLS, BALL], SENSOR_M, ALL_AROUND[::3]))
            backend.integrate(take_scan([*WALLS, BALL], SENSOR_M))
        backend.update(0.0)
    seen = (other.field.state != UNKNOWN) | (dense.field.state != UNKNOWN)
    assert (other.field.state == dense.field.state)[seen].mean() > 0.99


inside = st.tuples(st.floats(0.1, 7.9), st.floats(0.1, 5.9), st.floats(0.1, 2.9))
component = st.floats(-1.0, 1.0)


@given(inside, st.tuples(component, component, component), st.floats(0.5, 4.9))
@settings(max_examples=60, deadline=None)
def test_a_ray_frees_exactly_the_voxels_that_points_along_it_lie_in(origin, way, length_m):
    norm = np.linalg.norm(way)
    direction = np.array(way) / norm if norm > 0.1 else np.array([1.0, 0.0, 0.0])
    backend = Dense()
    backend.reset(np.array([[0.0, 0.0, 0.0], [8.0, 6.0, 3.0]]), NOTHING)
    scan = ray(origin, direction, np.inf, max_range_m=length_m)
    backend.integrate(scan)
    freed = set(backend.update(0.0).voxel.tolist())
    step = scan.direction[0].astype(np.float64)
    along = np.arange(0.0, length_m - 0.1, 1e-3)[:, None]
    points = np.array(origin) + along * step
    points = points[((points > 0.0) & (points < [8.0, 6.0, 3.0])).all(axis=1)]
    index = np.floor(points / 0.1 + 1e-9).astype(int)
    clear = (np.abs(points / 0.1 - np.rint(points / 0.1)) > 1e-3).all(axis=1)  # not on a border
    crossed = set(np.ravel_multi_index(index[clear].T, (80, 60, 30)).tolist())
    assert crossed <= freed
    middle = backend.field.voxel_centres_m(np.array(sorted(freed), dtype=np.int64)) - np.array(origin)
    aside = np.linalg.norm(middle - np.outer(middle @ step, step), axis=1)
    assert (aside <= 0.05 * np.sqrt(3.0) + 1e-6).all()
    assert (middle @ step <= length_m + 1e-6).all()


def test_rays_from_outside_or_past_the_map_are_harmless(option):
    backend = begin(option)
    backend.integrate(ray((-20.0, 3.0, 1.5), (-1.0, 0.0, 0.0), np.inf))
    backend.integrate(ray((4.0, 3.0, 40.0), (1.0, 0.0, 0.0), 3.0))
    assert backend.update(0.0).voxel.size == 0
    backend.integrate(ray((-1.0, 3.05, 1.45), (1.0, 0.0, 0.0), np.inf))  # from outside, into it
    seen = backend.field.voxel_centres_m(backend.update(0.1).voxel)
    assert seen[:, 0].max() == pytest.approx(3.95)
