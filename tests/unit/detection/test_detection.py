"""What is taken for a mover and what for the map: scans of a room that the map knows."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.components import build
from tests.detections import (
    HALF_M,
    SENSOR_M,
    WALLS,
    bodies_at,
    ray_scan,
    room_map,
    scans,
    straight,
    unknown_map,
)
from uavexp.arrays import Bool, Float
from uavexp.check.fields import box, field_from
from uavexp.check.hall import LIMITS
from uavexp.check.scans import take_scan
from uavexp.detection.clusters import cluster, split
from uavexp.detection.returns import returns, without
from uavexp.field import OCCUPIED, DistanceField
from uavexp.scan import RayScan, Scan
from uavexp.types import Bodies, Tracks

ACROSS = straight((4.0, 1.2, 0.86), (0.0, 1.0, 0.0))


def detector(option: str = "sensed", **parameters: Any) -> Any:
    made = build("detection", option, **parameters)
    made.reset(LIMITS, np.random.default_rng(0))
    return made


def on_body(scan: Scan, bodies: Bodies, margin_m: float = 0.02) -> Bool:
    """Which returns lie on a body (upright boxes), by their points."""
    points_m = returns(scan).points_m
    apart_m = np.abs(points_m[:, None] - bodies.position_m[None]) - bodies.half_size_m[None]
    return (apart_m <= margin_m).all(axis=2).any(axis=1)


def gone(before: RayScan, after: RayScan) -> Bool:
    """Which returns of a scan were taken out."""
    taken = np.isnan(after.range_m) & ~np.isnan(before.range_m)
    return taken[returns(before).where]


def test_depth_and_rays_give_the_same_points_back() -> None:
    """Every return lies on a wall, to float32."""
    boxes = [(tuple(low), tuple(high)) for low, high in WALLS]
    depth = take_scan(boxes, (1.0, 3.0, 1.2), yaw_rad=0.3, max_range_m=20.0)
    for scan in (ray_scan([]), depth):
        points_m = returns(scan).points_m
        size = len(scan.range_m) if isinstance(scan, RayScan) else scan.depth_m.size
        assert len(points_m) == size
        room = np.array([[0.2, 0.2, 0.1], [7.8, 5.8, 2.9]])
        nearest_m = np.abs(points_m[:, None] - room).reshape(-1, 6).min(axis=1)
        assert nearest_m.max() < 1e-5


def test_taking_returns_out_leaves_the_others_as_they_were() -> None:
    scan = ray_scan([])
    assert without(scan, np.zeros(0, dtype=np.int64)) is scan
    less = without(scan, np.array([3, 5]))
    assert np.flatnonzero(np.isnan(less.range_m)).tolist() == [3, 5]
    kept = np.isfinite(less.range_m)
    assert np.array_equal(less.range_m[kept], scan.range_m[kept])
    assert np.isfinite(scan.range_m).all()


def flown(option: str, duration_s: float, **parameters: Any) -> tuple[RayScan, RayScan, Bodies, Tracks]:
    """The last scan of a mover that crosses the room, before and after detection."""
    made, field = detector(option, **parameters), room_map()
    for scan, bodies in scans([ACROSS], duration_s, noise=np.random.default_rng(1)):
        left, tracks = made.detect(scan, field, bodies)
    return scan, left, bodies, tracks


@pytest.mark.parametrize("option", ["sensed", "truth"])
def test_a_mover_is_tracked_and_its_returns_are_taken_out(option: str) -> None:
    scan, left, bodies, tracks = flown(option, 2.0)
    assert len(tracks) == 1
    assert np.linalg.norm(tracks.position_m[0] - bodies.position_m[0]) < 0.3
    assert np.linalg.norm(tracks.velocity_mps[0] - bodies.velocity_mps[0]) < 0.3
    taken, body = gone(scan, left), on_body(scan, bodies)
    floor = returns(scan).points_m[:, 2] < 0.35  # its feet are too near to the floor to tell
    assert (taken[body & ~floor]).mean() > 0.95
    assert not taken[~on_body(scan, bodies, 0.12)].any()


def test_what_was_never_observed_to_be_free_is_no_mover() -> None:
    """A wall, a box, a person first seen: all fixed, nothing is swallowed."""
    made, field = detector(), unknown_map()
    for scan, bodies in scans([ACROSS], 1.0):
        left, tracks = made.detect(scan, field, bodies)
        assert left is scan
        assert len(tracks) == 0


def test_a_new_object_that_does_not_move_stays_in_the_scan() -> None:
    """The map believes its place to be free, wrongly: it must be able to learn."""
    made, field = detector(), room_map()
    for scan, bodies in scans([straight((4.0, 3.0, 0.86), (0.0, 0.0, 0.0))], 2.0):
        left, tracks = made.detect(scan, field, bodies)
        assert left is scan
        assert len(tracks) == 0


def test_a_mover_that_stops_is_given_back_to_the_map() -> None:
    def walks_and_stops(time_s: float) -> Float:
        return np.array([4.0, 1.2 + min(time_s, 2.0), 0.86])

    made, field = detector(), room_map()
    taken = []
    for scan, bodies in scans([walks_and_stops], 5.0):
        if scan.time_s > 4.0:  # mapped by now
            grid = field.state == OCCUPIED
            box(grid, tuple(bodies.position_m[0] - HALF_M), tuple(bodies.position_m[0] + HALF_M))
            field = replace(field, distance=np.where(grid, np.float32(-0.05), field.distance))
        left, tracks = made.detect(scan, field, bodies)
        taken.append(gone(scan, left).sum())
        if scan.time_s == pytest.approx(3.9):
            assert len(tracks) == 1, "a track until the map has it"
    assert taken[18] > 0
    assert not any(taken[40:]), "standing is told a second or two after it stopped"


def test_the_map_of_a_moment_ago_still_tells_a_mover() -> None:
    """It got into the map before it was recognised: its own voxels are no reason to call it fixed."""
    made, field = detector(), room_map()
    found = 0
    for scan, bodies in scans([ACROSS], 1.5):
        _, tracks = made.detect(scan, field, bodies)
        found = len(tracks)
        if scan.time_s < 0.25:
            low, high = bodies.position_m[0] - HALF_M, bodies.position_m[0] + HALF_M
            near = (field.voxel_centres_m(np.arange(field.distance.size)) > low - 0.1).all(axis=1) & (
                field.voxel_centres_m(np.arange(field.distance.size)) < high + 0.1
            ).all(axis=1)
            distance = field.distance.copy()
            distance.reshape(-1)[near] = -0.05
            field = replace(field, distance=distance)
    assert found == 1


def test_two_that_pass_closely_stay_two() -> None:
    """They are one cluster while they pass; none takes over the other's identity or size."""
    paths = [straight((4.0, 1.2, 0.86), (0.0, 1.0, 0.0)), straight((4.9, 4.8, 0.86), (0.0, -1.0, 0.0))]
    made, field = detector(), room_map()
    owner: dict[int, set[int]] = {0: set(), 1: set()}
    for scan, bodies in scans(paths, 3.4, noise=np.random.default_rng(2)):
        _, tracks = made.detect(scan, field, bodies)
        for mover, middle_m in enumerate(bodies.position_m):
            apart_m = np.linalg.norm(tracks.position_m - middle_m, axis=1)
            owner[mover] |= {int(tracks.identity[n]) for n in np.flatnonzero(apart_m < 0.4)}
    assert [len(found) for found in owner.values()] == [1, 1]
    assert owner[0] != owner[1]
    assert tracks.half_size_m[:, :2].max() < 0.6


SCREEN = ((2.6, 2.4, 0.0), (2.7, 4.6, 2.9))  # hides x = 4 m from y = 2.3 m on


def with_screen() -> DistanceField:
    grid = room_map().state == OCCUPIED
    box(grid, *SCREEN)
    return field_from(grid, max_distance_m=2.0)


def test_a_hidden_mover_coasts_and_is_forgotten_after_that() -> None:
    made, field = detector(coast_s=1.2), with_screen()
    for scan, bodies in scans([ACROSS], 1.5):
        _, tracks = made.detect(scan, field, bodies)
    velocity_mps, last_m = tracks.velocity_mps[0], tracks.position_m[0]
    lives = []
    for tick in range(1, 16):
        _, tracks = made.detect(ray_scan([SCREEN], 1.4 + 0.1 * tick), field, bodies_at([], 0.0))
        lives.append(len(tracks))
        if tick == 10:
            assert np.allclose(tracks.position_m[0], last_m + 1.0 * velocity_mps, atol=1e-9)
            assert tracks.covariance[0, 0, 0] > 0.05
    assert lives[:12] == [1] * 12
    assert lives[-1] == 0


def test_a_mover_that_is_seen_to_be_gone_is_forgotten_at_once() -> None:
    made, field = detector(), room_map()
    for scan, bodies in scans([ACROSS], 1.5):
        made.detect(scan, field, bodies)
    lives = [len(made.detect(ray_scan([], 1.5 + 0.1 * n), field, bodies)[1]) for n in range(4)]
    assert lives[0] == 1, "a scan may miss it"
    assert lives[-1] == 0


def test_a_mover_that_turns_back_while_it_is_missed_stays_itself() -> None:
    def turns(time_s: float) -> Float:
        return np.array([4.0, 1.2 + min(time_s, 3.2 - time_s), 0.86])

    made, field, identities = detector(), room_map(), set()
    blind = replace(ray_scan([]), range_m=np.full(len(ray_scan([]).range_m), np.nan, dtype=np.float32))
    for scan, bodies in scans([turns], 2.4):
        missed = 1.55 < scan.time_s < 2.0
        seen = replace(blind, time_s=scan.time_s) if missed else scan
        identities |= set(made.detect(seen, field, bodies)[1].identity.tolist())
    assert len(identities) == 1


def test_a_hidden_mover_does_not_walk_into_a_wall() -> None:
    made, field = detector(), room_map()
    for scan, bodies in scans([straight((4.0, 3.0, 0.86), (0.0, 1.0, 0.0))], 2.0):
        made.detect(scan, field, bodies)
    blind = np.full(len(scan.range_m), np.nan, dtype=np.float32)
    for n in range(1, 20):
        scan = replace(scan, time_s=2.0 + 0.1 * n, range_m=blind)
        _, tracks = made.detect(scan, field, bodies)
    assert tracks.position_m[0, 1] == pytest.approx(5.8 - HALF_M[1], abs=0.25)
    assert tracks.velocity_mps[0, 1] > 0.5, "where it turned is not known"


@pytest.mark.parametrize("option", ["sensed", "truth"])
def test_scans_without_any_measurement_are_taken(option: str) -> None:
    made, field = detector(option), room_map()
    blind = replace(ray_scan([]), range_m=np.full(len(ray_scan([]).range_m), np.nan, dtype=np.float32))
    for time_s in (0.0, 0.1, 0.1, 0.2):
        left, _ = made.detect(replace(blind, time_s=time_s), field, bodies_at([ACROSS], time_s))
        assert np.isnan(left.range_m).all()


def test_detection_is_deterministic_and_never_looks_at_the_truth() -> None:
    runs = []
    for lie in (False, True):
        made, field = detector(), room_map()
        for scan, bodies in scans([ACROSS], 1.2, noise=np.random.default_rng(3)):
            _, tracks = made.detect(scan, field, bodies_at([], 0.0) if lie else bodies)
        runs.append(tracks)
    assert np.array_equal(runs[0].position_m, runs[1].position_m)
    assert np.array_equal(runs[0].covariance, runs[1].covariance)


def test_clusters_do_not_depend_on_the_order_of_the_points() -> None:
    rng = np.random.default_rng(4)
    points_m = np.concatenate(
        [rng.normal(middle, 0.1, (40, 3)) for middle in ([0, 0, 0], [2, 0, 0], [0, 2, 1])]
    )
    order = rng.permutation(len(points_m))
    here = cluster(points_m, SENSOR_M, 0.35, 3, 2.5)
    there = cluster(points_m[order], SENSOR_M, 0.35, 3, 2.5)
    assert len(here) == 3
    assert np.array_equal(here.label[order], there.label)
    assert np.array_equal(here.low_m, there.low_m)


@pytest.mark.parametrize(("gap_m", "count"), [(0.3, 1), (0.6, 2)])
def test_points_nearer_than_the_reach_are_one_cluster(gap_m: float, count: int) -> None:
    grid = np.stack(np.meshgrid(np.arange(3), np.arange(3), [0]), axis=-1).reshape(-1, 3) * 0.1 + 0.05
    points_m = np.concatenate([grid, grid + np.array([0.2 + gap_m, 0.0, 0.0])])
    assert len(cluster(points_m, SENSOR_M, 0.35, 3, 2.5)) == count


def test_few_points_and_long_objects_are_no_cluster() -> None:
    line = np.stack([np.arange(0.0, 3.0, 0.05), np.zeros(60), np.zeros(60)], axis=1)
    assert len(cluster(line, SENSOR_M, 0.35, 3, 2.5)) == 0
    assert len(cluster(line[:40], SENSOR_M, 0.35, 3, 2.5)) == 1
    assert len(cluster(line[:2], SENSOR_M, 0.35, 3, 2.5)) == 0
    assert len(cluster(np.zeros((0, 3)), SENSOR_M, 0.35, 1, 2.5)) == 0


def test_a_cluster_is_cut_between_the_boxes_it_reaches_into() -> None:
    line = np.stack([np.arange(0.0, 2.0, 0.05), np.zeros(40), np.zeros(40)], axis=1)
    whole = cluster(line, SENSOR_M, 0.35, 3, 2.5)
    low_m, high_m = np.array([[-0.1, -1, -1], [1.5, -1, -1]]), np.array([[0.5, 1, 1], [2.1, 1, 1]])
    parts = split(whole, line, SENSOR_M, low_m, high_m)
    assert len(parts) == 2
    assert np.array_equal(parts.label, np.where(line[:, 0] <= 1.0, 0, 1))
    assert split(whole, line, SENSOR_M, low_m[:1], high_m[:1]) is whole
