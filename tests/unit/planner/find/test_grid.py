"""A* against independent searches: scipy's Dijkstra, and published optima."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from tests.folders import SHARED
from uavexp.arrays import Float
from uavexp.check.fields import bounds, box, empty, field_from, warehouse
from uavexp.check.hall import LIMITS
from uavexp.check.requests import ask
from uavexp.field import DistanceField
from uavexp.planner.constraints import Constraints
from uavexp.planner.find.base import FoundPath
from uavexp.planner.find.grid import Grid
from uavexp.types import PlanStatus

DATA = SHARED / "voxel_path"
MIN_M, SAFE_M, WEIGHT, VOXEL_M = 0.2, 0.6, 2.0, 0.1


class Search:
    """A grid search between two points within bounds."""

    def __init__(self, **changes: Any) -> None:
        self.grid = Grid(
            clearance_weight=changes.pop("clearance_weight", WEIGHT),
            max_expansions=changes.pop("max_expansions", 10_000_000),
            slack=changes.pop("slack", 0.0),
        )
        kept = {"min_clearance_m": MIN_M, "safe_clearance_m": SAFE_M, "z_band_m": 10.0, "known_only": False}
        self.constraints = Constraints(limits=LIMITS, **(kept | changes))

    def find(self, field: DistanceField, start_m: Float, goal_m: Float, bounds_m: Float) -> FoundPath:
        asked = replace(ask(field, start_m, goal_m), flight_bounds_m=bounds_m)
        return self.grid.find(asked, self.constraints, np.random.default_rng(0))


def dijkstra_cost(field: DistanceField, start: tuple[int, ...], goal: tuple[int, ...]) -> float:
    """Least penalised length from voxel to voxel by scipy, from the rule's words alone."""
    limit = MIN_M + 0.25 * VOXEL_M
    d = field.distance.astype(np.float64)
    short = np.clip((SAFE_M - d) / (SAFE_M - limit), 0.0, None)
    penalty = WEIGHT * short**2
    index = np.arange(d.size).reshape(d.shape)
    rows, columns, costs = [], [], []
    for di in (-1, 0, 1):
        for dj in (-1, 0, 1):
            for dk in (-1, 0, 1):
                if (di, dj, dk) == (0, 0, 0):
                    continue
                here = tuple(
                    slice(max(-s, 0), n - max(s, 0)) for s, n in zip((di, dj, dk), d.shape, strict=True)
                )
                there = tuple(
                    slice(max(s, 0), n - max(-s, 0)) for s, n in zip((di, dj, dk), d.shape, strict=True)
                )
                open_ = (d[here] >= limit) & (d[there] >= limit)
                length = VOXEL_M * np.sqrt(di * di + dj * dj + dk * dk)
                rows.append(index[here][open_])
                columns.append(index[there][open_])
                costs.append(length * (1.0 + 0.5 * (penalty[here] + penalty[there])[open_]))
    graph = coo_matrix(
        (np.concatenate(costs), (np.concatenate(rows), np.concatenate(columns))), shape=(d.size, d.size)
    ).tocsr()
    return float(dijkstra(graph, indices=index[start])[index[goal]])


def cost_along(field: DistanceField, path_m: Float) -> float:
    """What the rule's words ask for a path through voxel centres."""
    cells = np.floor(path_m / VOXEL_M + 1e-9).astype(int)
    short = np.clip((SAFE_M - field.distance[tuple(cells.T)].astype(float)), 0.0, None)
    penalty = WEIGHT * (short / (SAFE_M - MIN_M - 0.25 * VOXEL_M)) ** 2
    length = VOXEL_M * np.linalg.norm(np.diff(cells, axis=0), axis=1)
    return float((length * (1.0 + 0.5 * (penalty[1:] + penalty[:-1]))).sum())


@pytest.mark.parametrize("slack", [0.0, 0.05, 0.3])
@pytest.mark.parametrize("seed", range(6))
def test_cost_is_the_least_by_dijkstra_but_for_the_slack(seed: int, slack: float) -> None:
    rng = np.random.default_rng(seed)
    grid = empty((3.6, 3.2, 1.6))
    for _ in range(9):
        corner = rng.uniform(0.0, [3.2, 2.8, 1.2])
        box(grid, tuple(corner), tuple(corner + rng.uniform(0.1, [0.7, 0.7, 1.6])))
    field = field_from(grid)
    open_ = np.argwhere(field.distance >= 0.3)
    finder = Search(slack=slack)
    for _ in range(5):
        start, goal = (tuple(int(v) for v in open_[rng.integers(len(open_))]) for _ in range(2))
        ends = (np.array([start, goal]) + 0.5) * VOXEL_M
        found = finder.find(field, ends[0], ends[1], bounds(grid))
        expected = dijkstra_cost(field, start, goal)
        if np.isinf(expected):
            assert found.status is PlanStatus.NO_PATH
        else:
            assert found.status is PlanStatus.OK
            assert expected * (1.0 - 1e-9) <= found.cost <= expected * (1.0 + slack) ** 2 * (1.0 + 3e-6)
            assert found.cost == pytest.approx(cost_along(field, found.path_m))
            length = np.linalg.norm(np.diff(found.path_m, axis=0), axis=1)
            assert length.max() <= np.sqrt(3.0) * VOXEL_M + 1e-9  # neighbours only
            assert field.distance_m(found.path_m[1:-1]).min(initial=9.0) >= MIN_M


@pytest.mark.parametrize(("name", "longest"), [("Simple", 1e9), ("A1", 70.0)])
def test_published_optima(name: str, longest: float) -> None:
    if not DATA.exists():
        pytest.skip("needs the voxel path benchmark in ../shared/data/voxel_path")
    stored = np.load(DATA / f"{name}.npz")
    blocked = stored["blocked"].astype(np.int64)
    problems = np.loadtxt(DATA / f"{name}.3dmap.3dscen", skiprows=2)
    problems = problems[problems[:, 6] < longest]
    # a limit below half a voxel's diagonal: no corner is cut, as in the benchmark
    finder = Search(min_clearance_m=0.5, safe_clearance_m=0.5, clearance_weight=0.0, z_band_m=1e3)
    for problem in problems[:: len(problems) // 40]:
        ends, cost = problem[:6].reshape(2, 3), problem[6]
        # no cell of a path of this cost is further out than half of it
        low = np.maximum(ends.min(axis=0) - 0.5 * cost - 1.0, 0.0).astype(np.int64)
        high = np.minimum(ends.max(axis=0) + 0.5 * cost + 2.0, stored["size"]).astype(np.int64)
        grid = np.zeros(high - low, dtype=bool)
        grid[tuple((blocked[((blocked >= low) & (blocked < high)).all(axis=1)] - low).T)] = True
        field = DistanceField(
            origin_m=low.astype(np.float64),
            voxel_size_m=1.0,
            max_distance_m=1.0,
            distance=np.where(grid, np.float32(-1.0), np.float32(1.0)),
            state=np.ones(grid.shape, dtype=np.uint8),
        )
        found = finder.find(field, ends[0] + 0.5, ends[1] + 0.5, np.stack([low, high]).astype(np.float64))
        assert found.status is PlanStatus.OK
        assert found.cost == pytest.approx(cost, rel=3e-6)


def room() -> tuple[DistanceField, Float]:
    """4 x 4 x 2 m, a wall across it at x = 2 with a door 1 m wide at y = 3."""
    grid = empty((4.0, 4.0, 2.0))
    box(grid, (1.9, 0.0, 0.0), (2.1, 2.5, 2.0))
    box(grid, (1.9, 3.5, 0.0), (2.1, 4.0, 2.0))
    return field_from(grid), bounds(grid)


def test_statuses() -> None:
    field, limits = room()
    free, wall = np.array([1.0, 1.0, 1.0]), np.array([2.0, 1.0, 1.0])
    beyond, outside = np.array([3.0, 1.0, 1.0]), np.array([3.0, 1.0, 2.5])
    assert Search().find(field, wall, free, limits).status is PlanStatus.START_BLOCKED
    assert Search().find(field, free, wall, limits).status is PlanStatus.GOAL_BLOCKED
    assert Search().find(field, free, outside, limits).status is PlanStatus.GOAL_BLOCKED
    assert Search().find(field, free, beyond, limits).status is PlanStatus.OK
    assert Search(min_clearance_m=0.55).find(field, free, beyond, limits).status is PlanStatus.NO_PATH
    few = Search(max_expansions=5, min_clearance_m=0.05).find(field, free, beyond, limits)
    assert few.status is PlanStatus.NO_PATH
    assert "5 expansions" in few.reason


def test_flight_bounds_close_the_door() -> None:
    field, limits = room()
    limits = limits.copy()
    limits[1, 1] = 2.6
    found = Search().find(field, np.array([1.0, 1.0, 1.0]), np.array([3.0, 1.0, 1.0]), limits)
    assert found.status is PlanStatus.NO_PATH


def test_height_band_forbids_flying_over() -> None:
    grid = empty((4.0, 2.0, 2.4))
    box(grid, (1.9, 0.0, 0.0), (2.1, 2.0, 1.2))
    field, limits = field_from(grid), bounds(grid)
    ends = np.array([1.0, 1.0, 0.6]), np.array([3.0, 1.0, 0.6])
    over = Search(z_band_m=1.2).find(field, *ends, limits)
    assert over.status is PlanStatus.OK
    assert over.path_m[:, 2].max() > 1.4
    assert Search(z_band_m=0.3).find(field, *ends, limits).status is PlanStatus.NO_PATH


def test_prefers_the_wide_door() -> None:
    grid = empty((4.0, 4.0, 1.0))
    box(grid, (1.9, 0.0, 0.0), (2.1, 4.0, 1.0))
    grid[19:21, 5:12] = False  # 0.7 m wide, a little nearer
    grid[19:21, 22:38] = False  # 1.6 m wide
    field = field_from(grid)
    ends = np.array([1.0, 1.6, 0.5]), np.array([3.0, 1.6, 0.5])
    careless = Search(clearance_weight=0.0).find(field, *ends, bounds(grid)).path_m
    careful = Search(clearance_weight=5.0).find(field, *ends, bounds(grid)).path_m
    assert careless[np.argmin(abs(careless[:, 0] - 2.0)), 1] < 1.2
    assert careful[np.argmin(abs(careful[:, 0] - 2.0)), 1] > 2.2


@pytest.mark.parametrize("gap_m", [0.02, 0.08, 0.15])
def test_leaves_a_wall_that_it_is_too_close_to(gap_m: float) -> None:
    field, limits = room()
    start = np.array([1.9 - gap_m, 1.0, 1.0])
    found = Search().find(field, start, np.array([0.5, 3.0, 1.0]), limits)
    assert found.status is PlanStatus.OK
    clearance = field.distance_m(found.path_m)
    away = int(np.argmax(clearance >= MIN_M))
    assert away <= 5  # straight away from the wall
    assert (np.diff(clearance[: away + 1]) > -0.06).all()
    assert clearance[away:].min() >= MIN_M


def test_unknown_is_blocked_only_when_asked() -> None:
    grid = empty((4.0, 2.0, 1.0))
    unknown = np.zeros_like(grid)
    unknown[20:24] = True
    field, limits = field_from(grid, unknown=unknown), bounds(grid)
    ends = np.array([1.0, 1.0, 0.5]), np.array([3.0, 1.0, 0.5])
    assert Search().find(field, *ends, limits).status is PlanStatus.OK
    assert Search(known_only=True).find(field, *ends, limits).status is PlanStatus.NO_PATH
    inside = np.array([2.2, 1.0, 0.5])
    assert Search(known_only=True).find(field, ends[0], inside, limits).status is PlanStatus.GOAL_BLOCKED


def test_buffers_carry_nothing_over() -> None:
    grid = warehouse(1)
    field, limits = field_from(grid), bounds(grid)
    rng = np.random.default_rng(5)
    open_ = np.argwhere(field.distance[:, :, 13] > 0.4)
    used = Search()
    for _ in range(6):
        ends = [np.append((open_[rng.integers(len(open_))] + 0.5) * VOXEL_M, 1.35) for _ in range(2)]
        again, fresh = used.find(field, *ends, limits), Search().find(field, *ends, limits)
        assert again.path_m.tobytes() == fresh.path_m.tobytes()
        assert again.expansions == fresh.expansions
