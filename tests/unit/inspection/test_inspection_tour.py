"""Tours, clusters and travel lengths against brute force and closed forms."""

from __future__ import annotations

import itertools
import json
from pathlib import Path

import numpy as np
import pytest

from uavexp.arrays import Float
from uavexp.check.fields import box, empty, field_from
from uavexp.errors import ConfigError
from uavexp.inspection import tour_clusters as runs
from uavexp.inspection.tour import closed_tour, main, open_tour, tour_length
from uavexp.inspection.travel import is_reachable, travel_lengths, travel_matrix
from uavexp.inspection.travel_lattice import lattice_of


def apart(points: Float) -> Float:
    return np.asarray(np.linalg.norm(points[:, None] - points[None], axis=2))


def test_a_ring_is_visited_round() -> None:
    angle = np.random.default_rng(100).permutation(200) * 2.0 * np.pi / 200
    cost = apart(np.stack([np.cos(angle), np.sin(angle)], axis=1))
    length = tour_length(cost, closed_tour(cost, kicks=50), closed=True)
    assert length == pytest.approx(400.0 * np.sin(np.pi / 200))


def test_a_path_along_a_line_goes_from_end_to_end() -> None:
    x = np.random.default_rng(101).permutation(40).astype(float)
    x[[0, int(np.argmin(x))]] = x[[int(np.argmin(x)), 0]]  # the start is an end of the line
    order = open_tour(apart(x[:, None]))
    assert x[order].tolist() == sorted(x)


@pytest.mark.parametrize("size", [1, 2, 3, 4, 5])
def test_the_smallest_tours_are_exact(size: int) -> None:
    cost = apart(np.random.default_rng(size).random((size, 2)))
    best = min(
        tour_length(cost, np.array((0, *rest)), closed=True)
        for rest in itertools.permutations(range(1, size))
    )
    assert tour_length(cost, closed_tour(cost), closed=True) == pytest.approx(best)


@pytest.mark.parametrize(
    "cost", [np.array([[0.0, np.inf], [np.inf, 0.0]]), np.ones((2, 3)), np.zeros((0, 0))]
)
def test_costs_that_are_none_are_refused(cost: Float) -> None:
    with pytest.raises(ConfigError, match="cost must"):
        closed_tour(cost)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("EDGE_WEIGHT_TYPE: XRAY1\nDIMENSION: 1\nNODE_COORD_SECTION\n1 0 0\n", "EDGE_WEIGHT_TYPE"),
        ("EDGE_WEIGHT_TYPE: EUC_2D\nDIMENSION: 2\nNODE_COORD_SECTION\n1 0 0\nEOF\n", "6 numbers, got 3"),
        ("EDGE_WEIGHT_TYPE: EUC_2D\nDIMENSION: 1\nNODE_COORD_SECTION\n1 0 x\n", "must hold numbers"),
        ("EDGE_WEIGHT_TYPE: EUC_2D\nDIMENSION: 1\nNODE_COORD_SECTION\n1 0 nan\n", "finite"),
        ("", "EDGE_WEIGHT_TYPE"),
    ],
)
def test_a_bad_file_is_one_line_and_exit_code_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, word: str
) -> None:
    file = tmp_path / "bad.tsp"
    file.write_text(text)
    assert main([str(file)]) == 2
    assert word in capsys.readouterr().err
    assert main([str(tmp_path / "absent.tsp")]) == 2


def test_the_command_prints_one_line_of_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "square.tsp"
    nodes = "".join(f"{n + 1} {10 * (n % 2)} {10 * (n // 2)}\n" for n in range(4))
    file.write_text(f"EDGE_WEIGHT_TYPE : EUC_2D\nDIMENSION : 4\nNODE_COORD_SECTION\n{nodes}EOF\n")
    assert main([str(file)]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert (printed["nodes"], printed["length"]) == (4, 40)


def test_runs_of_a_segment_are_clusters() -> None:
    segment = np.array([0, 0, 1, 1, 0])
    assert runs.clusters_of(np.array([0, 1, 2, 3, 4]), segment) == ((0, 1), (2, 3), (4,))
    assert runs.clusters_of(np.array([], dtype=np.int64), segment) == ()


SEGMENT = np.array([0, 0, 0, 1, 0, 2])
LINE = apart(np.array([[0.0], [1.0], [2.0], [3.0], [4.0], [9.0]]))
FROM = np.arange(6.0)


def test_an_outlier_moves_to_the_next_run_of_its_segment() -> None:
    before = ((0, 1, 2), (3,), (4,), (5,))
    assert runs.merged(before, SEGMENT, LINE, FROM, 1) == before
    assert runs.merged(before, SEGMENT, LINE, FROM, 2) == ((0, 1, 2, 4), (3,), (5,))


def test_runs_that_become_neighbours_are_joined() -> None:
    segment = np.array([0, 1, 0, 1, 1])
    assert runs.merged(
        ((0,), (1,), (2,), (3, 4)), segment, apart(np.arange(5.0)[:, None]), np.zeros(5), 2
    ) in (
        ((0, 2), (1, 3, 4)),
        ((2, 0), (1, 3, 4)),
    )


def test_the_cheapest_merge_comes_first_and_its_cost_is_exact() -> None:
    rng = np.random.default_rng(105)
    for _ in range(20):
        segment, cost, start = rng.integers(0, 6, 40), apart(rng.random((40, 2))), rng.random(40)
        before = runs.clusters_of(rng.permutation(40), segment)
        after = runs.merged(before, segment, cost, start, 3)
        assert sorted(v for run in after for v in run) == list(range(40))
        assert runs.switches(after) < runs.switches(before)
        limit = 1.1 * runs.visit_length_m(before, cost, start)
        kept = runs.merged(before, segment, cost, start, 3, limit)
        assert runs.visit_length_m(kept, cost, start) <= limit + 1e-9
        assert runs.switches(after) <= runs.switches(kept) <= runs.switches(before)


def test_a_merge_beyond_the_limit_is_left_undone() -> None:
    before = ((0, 1, 2), (3,), (4,), (5,))
    assert runs.merge_outliers(before, SEGMENT, LINE, FROM, 5, 0.0) == before
    assert len(runs.merge_outliers(before, SEGMENT, LINE, FROM, 5, 1.0)) == 3


def test_reordering_keeps_the_clusters_and_never_lengthens() -> None:
    rng = np.random.default_rng(103)
    for _ in range(20):
        cost = apart(rng.random((30, 2)))
        start = rng.random(30)
        clusters = tuple(tuple(int(v) for v in run) for run in np.split(rng.permutation(30), [4, 5, 17, 24]))
        after = runs.reordered(clusters, cost, start)
        assert [sorted(run) for run in after] == [sorted(run) for run in clusters]
        assert runs.visit_length_m(after, cost, start) <= runs.visit_length_m(clusters, cost, start) + 1e-9


def test_reordering_one_cluster_between_two_points_is_exact() -> None:
    cost = apart(np.array([[0.0], [3.0], [1.0], [2.0], [4.0]]))
    after = runs.reordered(((0,), (1, 2, 3), (4,)), cost, np.zeros(5))
    assert after == ((0,), (2, 3, 1), (4,))


HALL = empty((6.0, 6.0, 2.0))
box(HALL, (2.9, 0.0, 0.0), (3.1, 4.6, 2.0))
FIELD = field_from(HALL)
BOUNDS = np.array([[0.3, 0.3, 0.6], [5.7, 5.7, 1.4]])
START = np.array([1.0, 1.0, 1.0])


def test_travel_goes_straight_in_the_open_and_round_a_wall() -> None:
    lattice = lattice_of(FIELD, BOUNDS, START, clearance_m=0.3)
    points = np.array([[1.0, 1.0, 1.0], [2.0, 3.0, 1.2], [5.0, 1.0, 1.0]])
    lengths = travel_matrix(lattice, points)
    assert lengths[0, 1] == pytest.approx(np.linalg.norm(points[1] - points[0]))
    taut = 2.0 * np.hypot(1.6, 3.9) + 0.8  # round the wall's end at the clearance, corners square
    shortest = 2.0 * np.hypot(1.9, 3.6)
    assert shortest < lengths[0, 2] < 1.1 * taut
    assert np.array_equal(lengths, lengths.T)


def test_lengths_over_the_lattice_are_scipys() -> None:
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import dijkstra

    lattice = lattice_of(FIELD, BOUNDS, START, clearance_m=0.3)
    nodes = np.random.default_rng(104).choice(len(lattice.position_m), 12, replace=False)
    graph = csr_matrix((lattice.units * lattice.unit_m, lattice.ends, lattice.starts))
    exact = dijkstra(graph, indices=nodes)[:, nodes]
    points = lattice.position_m[nodes]
    straight = apart(points)
    found = travel_lengths(lattice, points, points)
    assert np.all(found <= np.maximum(exact, straight) + 1e-2)
    assert np.all((found >= exact - 1e-2) | (np.abs(found - straight) < 1e-9))
    left, right = points[:, None, 0] < 2.5, points[None, :, 0] > 3.5
    assert (found > straight + 0.3)[left & right].any()


def test_far_points_are_reached_through_near_ones() -> None:
    lattice = lattice_of(FIELD, BOUNDS, START, clearance_m=0.3)
    rng = np.random.default_rng(106)
    nodes = rng.choice(len(lattice.position_m), 250, replace=False)
    points = lattice.position_m[nodes]
    exact = travel_lengths(lattice, points, points)
    found = travel_matrix(lattice, points)
    least = np.minimum(exact, exact.T)
    np.fill_diagonal(least, 0.0)
    assert np.all(found >= least - 0.02)
    assert np.quantile(found - least, 0.99) < 0.4
    assert np.max(found / np.maximum(least, 0.5)) < 1.2


def test_a_start_near_a_wall_still_finds_its_way() -> None:
    start = np.array([2.75, 2.0, 1.0])  # 0.15 m from the wall, nodes need 0.6 m
    lattice = lattice_of(FIELD, BOUNDS, start, clearance_m=0.6)
    points = np.array([[1.0, 1.0, 1.0]])
    assert not is_reachable(lattice, start[None])[0]
    length = travel_lengths(lattice, start[None], points)[0, 0]
    assert np.linalg.norm(points[0] - start) <= length < 2.6


def test_what_is_walled_off_cannot_be_reached() -> None:
    closed = HALL.copy()
    box(closed, (2.9, 0.0, 0.0), (3.1, 6.0, 2.0))
    lattice = lattice_of(field_from(closed), BOUNDS, START, clearance_m=0.3)
    points = np.array([[2.0, 3.0, 1.0], [5.0, 1.0, 1.0]])
    assert is_reachable(lattice, points).tolist() == [True, False]
    assert np.isinf(travel_lengths(lattice, points[:1], points[1:])).all()
    nowhere = lattice_of(field_from(closed), BOUNDS, START, clearance_m=3.0)
    assert is_reachable(nowhere, points).tolist() == [False, False]
