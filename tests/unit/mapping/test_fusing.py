"""How both fusing backends tell obstacles from noise, and that they agree with each other."""

from __future__ import annotations

import resource
from pathlib import Path

import numpy as np
import pytest

from tests.exact_distance import exact_field
from tests.maps import BOUNDS_M, FUSING, NOTHING, begin, centres, occupied
from uavexp.check.scans import Box, take_scan
from uavexp.errors import ConfigError
from uavexp.field import FREE, OCCUPIED, UNKNOWN
from uavexp.mapping.base import MapBackend
from uavexp.mapping.voxel_block_grid import VoxelBlockGrid
from uavexp.memory import blank

CAMERA_M = (0.55, 3.05, 1.45)
WALL_M = 3.0  # x of the near face
WALL: Box = ((WALL_M, -1.0, -1.0), (WALL_M + 1.0, 7.0, 4.0))
ROOM: list[Box] = [
    ((-1.0, -1.0, -0.5), (9.0, 7.0, 0.05)),
    ((5.02, -1.0, -1.0), (6.0, 7.0, 4.0)),
    ((2.4, 1.1, 0.0), (3.1, 2.0, 1.7)),
    ((3.3, 3.9, 0.0), (3.7, 5.2, 2.6)),
]


@pytest.fixture(params=FUSING)
def option(request) -> str:
    return request.param


def fly_past(backend: MapBackend, boxes: list[Box], *, frames: int = 24, noise=None):
    for n in range(frames):
        position = (0.5 + 0.03 * n, 3.0 + 0.02 * n, 1.4)
        backend.integrate(
            take_scan(boxes, position, 0.4 * np.sin(0.4 * n), pitch_rad=0.05 * np.cos(n), noise=noise)
        )
        if n % 2 == 1:
            yield backend.update(0.05 * n)


@pytest.mark.parametrize(
    "wrong",
    [
        {"voxel_size_m": 0.0},
        {"voxel_size_m": float("nan")},
        {"truncation_m": -0.3},
        {"esdf_rate_hz": float("inf")},
        {"max_distance_m": 0.0},
        {"max_distance_m": 50.0},
        {"free_above_m": 0.0},
        {"free_above_m": 0.3},
        {"solid_depth_m": 0.31},
        {"max_weight": 0},
        {"max_weight": 256},
        {"max_evidence": 32},
        {"occupied_evidence": 13},
        {"miss_evidence": 0},
    ],
    ids=str,
)
def test_bad_parameters_are_refused_by_name(option, wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        FUSING[option](**wrong)


def test_no_return_is_free_up_to_the_range(option):
    backend = begin(option)
    backend.integrate(take_scan([], CAMERA_M, max_range_m=4.0))
    update = backend.update(0.0)
    offset = centres(backend) - np.array(CAMERA_M)
    seen = (np.abs(offset[..., 1]) < 0.98 * offset[..., 0]) & (np.abs(offset[..., 2]) < 0.73 * offset[..., 0])
    assert (backend.field.state[seen & (offset[..., 0] < 4.0)] == FREE).all()
    assert (backend.field.state[offset[..., 0] > 4.0] == UNKNOWN).all()
    assert (backend.field.state[offset[..., 0] < 0.0] == UNKNOWN).all()
    assert update.first_seen.all()
    assert not update.occupied.any()
    assert (update.new_distance_m == np.float32(backend.field.max_distance_m)).all()


def test_wall_is_mapped_where_it_stands_and_hides_what_is_behind(option):
    backend = begin(option)
    for _ in range(3):
        backend.integrate(take_scan([WALL], CAMERA_M))
    backend.update(0.0)
    at = centres(backend)
    in_view = (np.abs(at[..., 1] - CAMERA_M[1]) < 2.0) & (np.abs(at[..., 2] - CAMERA_M[2]) < 1.0)
    x = at[..., 0]
    assert (backend.field.state[in_view & (x > WALL_M) & (x < WALL_M + 0.2)] == OCCUPIED).all()
    assert (backend.field.state[in_view & (x < WALL_M - 0.1) & (x > CAMERA_M[0] + 2.1)] == FREE).all()
    assert (backend.field.state[x > WALL_M + 0.4] == UNKNOWN).all()
    assert not occupied(backend)[x < WALL_M - 0.1].any()


def test_one_look_at_a_surface_is_never_called_free(option):
    """Safety: a first sight that is not yet an obstacle stays unknown until a second look."""
    backend = begin(option)
    backend.integrate(take_scan([WALL], CAMERA_M))
    backend.update(0.0)
    x = centres(backend)[..., 0]
    assert not (backend.field.state[x > WALL_M] == FREE).any()
    backend.integrate(take_scan([WALL], CAMERA_M))
    backend.update(0.1)
    assert occupied(backend)[x > WALL_M].any()


def test_one_frame_of_speckle_makes_no_obstacle(option):
    for earlier in (0, 6):
        backend = begin(option)
        for n in range(earlier + 4):
            scan = take_scan([WALL], CAMERA_M)
            if n == earlier:
                scan.depth_m[30:33, 40:43] = 1.2
            backend.integrate(scan)
            backend.update(0.1 * n)
            assert not occupied(backend)[centres(backend)[..., 0] < 2.0].any()


def test_removed_obstacle_is_freed_and_the_field_rises(option):
    backend = begin(option)
    block: Box = ((2.0, 2.5, 1.0), (2.4, 3.5, 2.0))
    for _ in range(30):
        backend.integrate(take_scan([WALL, block], CAMERA_M))
    backend.update(0.0)
    x = centres(backend)[..., 0]
    assert occupied(backend)[x < 2.5].any()
    for _ in range(20):  # a second
        backend.integrate(take_scan([WALL], CAMERA_M))
    update = backend.update(1.0)
    assert not occupied(backend)[x < 2.5].any()
    assert (update.new_distance_m > update.old_distance_m).any()


def test_obstacle_that_appears_in_long_free_space_is_mapped_within_two_frames(option):
    backend = begin(option)
    for _ in range(60):
        backend.integrate(take_scan([WALL], CAMERA_M))
    backend.update(0.0)
    for _ in range(2):
        backend.integrate(take_scan([WALL, ((2.0, 2.5, 1.0), (2.4, 3.5, 2.0))], CAMERA_M))
    backend.update(0.1)
    at = centres(backend)[occupied(backend)]
    front = at[at[:, 0] < 2.5]
    assert front.size
    assert abs(front[:, 0].min() - 2.0) <= 0.1


@pytest.mark.parametrize("thickness_m", [0.0, 0.02])
@pytest.mark.parametrize("offset_m", np.arange(0.0, 0.1, 0.01).round(3).tolist())
def test_thin_board_seen_from_one_side_and_then_the_other_stays(option, offset_m, thickness_m):
    """Regression: averaging both sides used to leave nothing, or to fill the room in front."""
    backend = begin(option)
    x = 3.0 + offset_m
    board: Box = ((x, -1.0, -1.0), (x + thickness_m, 7.0, 4.0))
    middle = (slice(None), slice(25, 35), slice(12, 18))
    for position, yaw in ((CAMERA_M, 0.0), ((5.55, 3.05, 1.45), np.pi)):
        for _ in range(40):
            backend.integrate(take_scan([board], position, yaw))
        backend.update(0.0)
        stands = occupied(backend)[middle]
        assert stands.any(axis=0).all()
    where = centres(backend)[middle][stands][:, 0]
    assert np.abs(where - x).max() < 0.16
    assert (backend.field.state[middle][:28] != OCCUPIED).all()


def test_noise_does_not_make_the_map_flicker(option):
    """At rest under the axial noise of a real sensor (4 cm at 5 m) almost no voxel flips after a second."""
    noise = np.random.default_rng(7)
    backend = begin(option)
    boxes: list[Box] = [((5.0, -1.0, -1.0), (6.0, 7.0, 4.0)), ROOM[0], ROOM[2]]
    for _ in range(20):
        backend.integrate(take_scan(boxes, CAMERA_M, noise=noise))
    backend.update(0.0)
    size, flips = occupied(backend).sum(), 0
    for n in range(30):
        before = occupied(backend)
        backend.integrate(take_scan(boxes, CAMERA_M, noise=noise))
        backend.update(0.1 * n)
        flips += (before != occupied(backend)).sum()
    assert flips / 30 < 0.002 * size


def test_a_silhouette_sprays_no_obstacles(option):
    """Flown past with noise, all that is mapped lies on a surface or in the shadow just behind one."""
    backend = begin(option)
    for _ in fly_past(backend, ROOM, frames=40, noise=np.random.default_rng(2)):
        pass
    at = centres(backend)[occupied(backend)]
    gap = np.min(
        [
            np.linalg.norm(np.maximum(np.maximum(low - at, at - np.array(high)), 0.0), axis=1)
            for low, high in ROOM
        ],
        axis=0,
    )
    assert (gap > 0.15).mean() < 0.02
    assert gap.max() < backend.truncation_m + backend.voxel_size_m  # type: ignore[attr-defined]


def test_field_is_the_exact_transform_of_the_state_after_every_update(option):
    backend = begin(option)
    for _ in fly_past(backend, ROOM, noise=np.random.default_rng(1)):
        expected = exact_field(occupied(backend), backend.field.max_distance_m)
        np.testing.assert_array_equal(backend.field.distance, expected)


def test_marked_ball_is_free_until_a_surface_is_measured_in_it(option):
    backend = begin(option)
    ball = np.array([2.6, 3.0, 1.5])
    backend.mark_free(ball, 0.6)
    update = backend.update(0.0)
    inside = np.linalg.norm(centres(backend) - ball, axis=-1) <= 0.6
    np.testing.assert_array_equal(backend.field.state == FREE, inside)
    assert update.first_seen.all()
    assert update.voxel.size == inside.sum()
    for _ in range(2):
        backend.integrate(take_scan([WALL], CAMERA_M))
    backend.update(0.1)
    assert occupied(backend)[inside].any()
    before = occupied(backend)
    backend.mark_free(ball, 0.6)
    backend.update(0.2)
    np.testing.assert_array_equal(before, occupied(backend))


def test_backends_agree_on_the_same_scans():
    """Tolerance: 99 % of seen voxels in the same state, 99 % of distances within 1 mm, all within 2 voxels.

    What is left lies where a voxel's centre falls on the border of a pixel, which 32 and 64
    bits see differently.
    """
    other, dense = begin("voxel_block_grid"), begin("dense")
    for backend in (other, dense):
        for _ in fly_past(backend, ROOM, frames=40, noise=np.random.default_rng(3)):
            pass
    seen = (other.field.state != UNKNOWN) | (dense.field.state != UNKNOWN)
    assert seen.sum() > 10_000
    assert (other.field.state == dense.field.state)[seen].mean() > 0.99
    gap = np.abs(other.field.distance - dense.field.distance)
    assert np.percentile(gap, 99) <= 0.001
    assert gap.max() <= 0.2


def test_missing_gpu_is_named_with_the_package_that_brings_it():
    with pytest.raises(ConfigError, match="device must be"):
        VoxelBlockGrid(device="GPU")
    absent = VoxelBlockGrid(device="CUDA:99")  # cheap to construct: only reset looks for the device
    with pytest.raises(ConfigError, match="open3d in place of open3d-cpu"):
        absent.reset(BOUNDS_M, NOTHING)


def test_tiles_in_which_anything_changed_are_counted_and_no_others(option):
    backend = begin(option)
    field = backend.field
    before, counted = field.copy(), field.changed.copy()
    for _ in fly_past(backend, ROOM):
        differs = ((field.distance != before.distance) | (field.state != before.state)).any(axis=2)
        tiles = np.add.reduceat(np.add.reduceat(differs, range(0, 80, 8), axis=0), range(0, 60, 8), axis=1)
        np.testing.assert_array_equal(field.changed > counted, tiles > 0)
        before, counted = field.copy(), field.changed.copy()
    assert (counted > 0).any()
    assert (counted == 0).any()


def test_a_hall_of_100_m_is_mapped_with_the_default_memory(option):
    backend = FUSING[option]()
    backend.reset(np.array([[-0.2, -0.2, -0.2], [100.2, 100.2, 3.2]]), NOTHING)
    assert backend.field.state.size > 30_000_000


def test_what_is_not_seen_of_a_large_hall_takes_no_memory():
    """Of the 26 bytes a voxel only those that are not zero to begin with."""
    voxels = 40_000_000
    array = blank(voxels, np.float32)
    before_mib = resident_mib()
    array[: voxels // 100] = 1.0
    array[voxels // 2] = 1.0  # numpy's zeros would take 2 MB
    assert (array[voxels // 2 + 1 :: 100_000] == 0.0).all()
    assert 1.4 < resident_mib() - before_mib < 3.0


def resident_mib() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 2**20


def test_what_is_no_longer_seen_is_forgotten_and_seen_anew(option):
    backend = begin(option, forget_s=10.0)
    for n in range(1, 41):  # to 2 s at 20 Hz: all weight there is, less the one that fades at 2 s
        backend.integrate(take_scan([WALL], CAMERA_M))
        backend.update(0.05 * n)
    known = backend.field.state.copy()
    backend.update(11.4)
    assert (backend.field.state == known).all()
    tiles = backend.field.changed.copy()
    update = backend.update(11.5)
    assert (backend.field.state == UNKNOWN).all()
    assert (backend.field.distance == backend.max_distance_m).all()
    assert not update.occupied.any()
    assert (backend.field.changed != tiles).any()
    for _ in range(2):
        backend.integrate(take_scan([WALL], CAMERA_M))
    again = backend.update(11.6)
    assert (backend.field.state == known).mean() > 0.999
    assert again.first_seen.sum() == (backend.field.state != UNKNOWN).sum()


def test_the_less_it_was_seen_the_sooner_it_is_forgotten_but_not_what_is_in_view(option):
    backend = begin(option, forget_s=10.0)
    backend.mark_free((7.0, 1.0, 1.0), 0.3)
    for _ in range(4):
        backend.integrate(take_scan([WALL], CAMERA_M))
    backend.update(1.9)  # fades at 0.5, 1.0 and 1.5 s: a frame of four is left
    assert occupied(backend).any()
    backend.integrate(take_scan([], (7.0, 3.0, 1.5)))  # elsewhere
    backend.update(2.0)
    assert not occupied(backend).any()
    assert (backend.field.state == FREE).any()
    lasting = begin(option, forget_s=10.0)
    for n in range(1, 801):
        if n % 2 == 0:
            lasting.integrate(take_scan([WALL], CAMERA_M))
        update = lasting.update(0.1 * n)
    assert occupied(lasting).any()
    assert not update.voxel.size
