"""Shortest paths in the true geometry against an independent graph search and closed forms."""

import math

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from uavexp.geometry import polyline_length_m
from uavexp.scene import Scene
from uavexp.world import task
from uavexp.world.boxes import Boxes
from uavexp.world.line_of_sight import in_sight
from uavexp.world.shortest import make_nodes, passable_nodes, shortest_lattice_path
from uavexp.world.widest import bottleneck_m, widest_path

BOUNDS = np.array([[0.0, 0.0, 0.0], [4.0, 3.0, 1.2]])


def cluttered(seed: int) -> Scene:
    rng = np.random.default_rng(seed)
    boxes = Boxes()
    for _ in range(25):
        low = rng.uniform([0.3, 0.0, 0.0], [3.4, 2.8, 1.0])
        boxes.span(low, low + rng.uniform(0.1, 0.6, 3))
    return Scene.from_mesh(*boxes.mesh())


def graph_shortest(scene: Scene, cell: float, radius: float, start: int, target: int) -> float:
    """Dijkstra of scipy on the 26-connected graph of nodes whose distance is at least `radius`."""
    shape = make_nodes(scene.grid, BOUNDS, cell).shape
    index = np.indices(shape).reshape(3, -1).T
    free = scene.distance_m(BOUNDS[0] + (index + 0.5) * cell) >= radius
    rows, columns, costs = [], [], []
    flat = np.arange(len(index)).reshape(shape)
    for step in np.indices((3, 3, 3)).reshape(3, -1).T - 1:
        if (step == 0).all():
            continue
        a = tuple(slice(max(0, -s), n - max(0, s)) for s, n in zip(step, shape, strict=True))
        b = tuple(slice(max(0, s), n - max(0, -s)) for s, n in zip(step, shape, strict=True))
        one, other = flat[a].ravel(), flat[b].ravel()
        keep = free[one] & free[other]
        rows.append(one[keep])
        columns.append(other[keep])
        costs.append(np.full(keep.sum(), cell * np.linalg.norm(step)))
    graph = coo_matrix(
        (np.concatenate(costs), (np.concatenate(rows), np.concatenate(columns))), shape=(flat.size,) * 2
    ).tocsr()
    return float(dijkstra(graph, indices=start)[target])


@pytest.mark.parametrize("radius", [0.07, 0.15, 0.4])
def test_a_node_is_passable_when_nothing_comes_nearer_than_the_radius(radius: float) -> None:
    scene = cluttered(7)
    nodes = make_nodes(scene.grid, BOUNDS, 0.1, radius)
    index = np.indices(nodes.shape).reshape(3, -1).T
    distance_m = scene.distance_m(BOUNDS[0] + (index + 0.5) * 0.1)
    clear = np.abs(distance_m - radius) > 1e-6  # of the distance's own rounding
    np.testing.assert_array_equal(passable_nodes(nodes)[clear] > 0, distance_m[clear] > radius)
    assert 0 < np.count_nonzero(distance_m > radius) < len(index)


@pytest.mark.parametrize("seed", range(6))
def test_lattice_path_is_as_short_as_scipys(seed: int) -> None:
    scene, cell, radius = cluttered(seed), 0.1, 0.15
    nodes = make_nodes(scene.grid, BOUNDS, cell, radius)
    shape = nodes.shape
    ends = np.array([[0, 2, 4], [shape[0] - 1, shape[1] - 3, 7]])
    start, target = BOUNDS[0] + (ends + 0.5) * cell
    expected = graph_shortest(scene, cell, radius, *np.ravel_multi_index(ends.T, tuple(shape)))
    path = shortest_lattice_path(nodes, radius, start, target)
    if np.isinf(expected):
        assert path.shape == (0, 3)
    else:
        assert polyline_length_m(path) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_found_path_keeps_the_clearance_all_along(seed: int) -> None:
    scene, clearance = cluttered(seed), 0.2
    start, target = np.array([0.05, 0.1, 0.5]), np.array([3.93, 2.9, 0.6])
    path = task.shortest_path(scene, BOUNDS, start, target, clearance)
    if path.shape[0] == 0:
        assert bottleneck_m(scene, BOUNDS, start, target, clearance) < clearance + 0.03  # the lattice's
        return
    np.testing.assert_array_equal(path[[0, -1]], [start, target])
    along = np.linspace(0.0, 1.0, 200)[:, None, None]
    points = (path[:-1] + along * np.diff(path, axis=0)).reshape(-1, 3)
    assert scene.distance_m(points).min() >= clearance - 1e-5
    assert (points >= BOUNDS[0]).all()
    assert (points <= BOUNDS[1]).all()


def test_path_around_a_wall_is_the_taut_string_with_rounded_corners() -> None:
    boxes = Boxes()
    boxes.span((3.9, -20.0, -20.0), (4.1, 4.4, 20.0))
    scene = Scene.from_mesh(*boxes.mesh())
    bounds = np.array([[0.0, 0.0, 0.0], [8.0, 8.0, 1.0]])
    start, target, c = np.array([1.0, 1.0, 0.5]), np.array([7.0, 1.0, 0.5]), 0.35
    path = task.shortest_path(scene, bounds, start, target, c)
    dx, dy = 2.9, 3.4  # from start to the wall's corner
    away = math.hypot(dx, dy)
    turn = math.atan2(dy, dx) + math.asin(c / away)  # heading of the tangent to the corner's circle
    exact = 2.0 * (math.sqrt(away**2 - c**2) + c * turn) + 0.2
    assert exact <= polyline_length_m(path) <= 1.01 * exact


def test_sight_is_blocked_exactly_by_the_clearance() -> None:
    boxes = Boxes()
    boxes.span((1.0, -5.0, -5.0), (2.0, 0.0, 5.0))
    grid = Scene.from_mesh(*boxes.mesh()).grid
    for height, sees in ((0.2999, False), (0.302, True)):
        a, b = np.array([-1.0, height, 0.0]), np.array([4.0, height, 0.0])
        assert in_sight(grid, a, b, 0.3) == sees
        assert in_sight(grid, b, a, 0.3) == sees


def test_bottleneck_is_half_the_gap_between_two_walls() -> None:
    boxes = Boxes()
    boxes.span((2.0, -5.0, -5.0), (2.2, 1.0, 5.0))
    boxes.span((2.0, 1.6, -5.0), (2.2, 8.0, 5.0))
    scene = Scene.from_mesh(*boxes.mesh())
    start, target = np.array([0.5, 0.5, 0.5]), np.array([3.5, 2.5, 0.5])
    path, bottleneck = widest_path(scene, BOUNDS, start, target, 0.5)
    assert 0.298 <= bottleneck <= 0.3
    assert scene.distance_m(path).min() >= bottleneck
    tight = task.tightened(scene, path, bottleneck)
    assert polyline_length_m(tight) <= polyline_length_m(path)
    assert scene.distance_m(tight).min() >= bottleneck - 1e-6
    assert bottleneck_m(scene, BOUNDS, start, target, 0.2) >= 0.2
    shut = np.array([3.5, 2.5, 0.5]), np.array([2.1, 0.5, 0.5])  # inside the wall
    assert bottleneck_m(scene, BOUNDS, *shut, 0.2) == 0.0
    path = task.shortest_path(scene, BOUNDS, start, target, 0.2)
    assert task.narrowest_gap_m(scene, path) == pytest.approx(0.6, abs=0.02)


def test_clutter_density_counts_solids_and_what_they_enclose() -> None:
    boxes = Boxes()
    boxes.span((1.0, 0.0, 0.0), (2.0, 3.0, 1.2))  # a solid across the whole width
    scene = Scene.from_mesh(*boxes.mesh())
    density = task.clutter_density(scene, BOUNDS, np.array([3.0, 1.0, 0.6]))
    assert density == pytest.approx(0.5, abs=0.03)  # the solid and the 1 m cut off behind it, of 4 m
