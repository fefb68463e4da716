"""The goal chosen is the best of all: scored anew over whole planes by scipy, on maps that change."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.unit.explorer.test_waves import scipy_costs
from uavexp.arrays import Float
from uavexp.check.fields import box, empty, field_from
from uavexp.check.hall import LIMITS, hovering, observe
from uavexp.explorer.frontier import Frontier
from uavexp.explorer.view import straight
from uavexp.field import FREE, UNKNOWN, DistanceField
from uavexp.mapping.projection import Band, Projection
from uavexp.parameters import Unknown
from uavexp.types import Observation

HEIGHT_M, SIZE_M = 1.05, (9.0, 6.0, 2.4)
BOUNDS_M = np.array([[0.3, 0.3, 0.4], [8.7, 5.7, 2.0]])
TARGET_M = np.array([8.2, 2.4, HEIGHT_M])


def seen_at(rng: np.random.Generator, field: DistanceField, x_m: float, with_target: bool) -> Observation:
    return replace(
        observe(field, time_s=0.2),
        state=hovering((x_m, float(rng.uniform(1.0, 5.0)), HEIGHT_M)),
        target_m=TARGET_M if with_target else None,
        flight_bounds_m=BOUNDS_M,
    )


def random_map(rng: np.random.Generator, depth_m: float) -> DistanceField:
    """Boxes in a hall; known as far as `depth_m`, but for some patches."""
    grid, unknown = empty(SIZE_M), empty(SIZE_M)
    for _ in range(8):
        x, y = rng.uniform(0.0, 8.0), rng.uniform(0.0, 5.0)
        wide, deep = rng.uniform(0.2, 2.0, 2)
        box(grid, (x, y, 0.0), (x + wide, y + deep, 2.4))
    unknown[round(depth_m / 0.1) :] = True
    for _ in range(3):
        x, y = rng.uniform(0.0, 8.0), rng.uniform(0.0, 5.0)
        box(unknown, (x, y, 0.0), (x + 1.0, y + 0.8, 2.4))
    return field_from(grid & ~unknown, unknown=unknown, max_distance_m=2.0)


def every_score(explorer: Frontier, seen: Observation, points_m: Float) -> Float:
    """S (N,) of points by whole searches; -inf: no way there, or none from there to the target."""
    band = Band(
        z_min_m=0.85, z_max_m=1.25, flight_height_m=HEIGHT_M, occupied_below_m=explorer.occupied_below_m
    )
    projection = Projection(seen.field, band)
    projection.update()
    plane = projection.planar
    i, j = np.mgrid[: plane.state.shape[0], : plane.state.shape[1]]
    vehicle = plane.cell_of(seen.state.position_m)
    x, y = (plane.origin_m[axis] + (index + 0.5) * 0.15 for axis, index in enumerate((i, j)))
    inside = (x >= 0.3) & (x <= 8.7) & (y >= 0.3) & (y <= 5.7)
    near = (i - vehicle[0]) ** 2 + (j - vehicle[1]) ** 2 <= (explorer.escape_m / 0.15) ** 2
    clear = inside & ((plane.clearance > np.float32(0.3)) | ((plane.clearance > 0.0) & near))
    price = np.where(plane.state == UNKNOWN, 150, 100)
    passable = clear if explorer.unknown is Unknown.OPTIMISTIC else clear & (plane.state == FREE)
    there = scipy_costs(price * passable, vehicle, int(price[vehicle]))
    there[~passable] = np.inf
    scores = np.empty(len(points_m))
    beyond = np.zeros(clear.shape)
    if seen.target_m is not None:
        beyond = scipy_costs(100 * clear, plane.cell_of(seen.target_m), 100)
        beyond[~clear] = np.inf
    for n, cell in enumerate(map(plane.cell_of, points_m)):
        disc = (i - cell[0]) ** 2 + (j - cell[1]) ** 2 <= (explorer.neighbourhood_m / 0.15) ** 2
        unknown = np.count_nonzero(disc & inside & (plane.state == UNKNOWN))
        length_m = 0.0015 * (explorer.beta * there[cell] + explorer.gamma * beyond[cell])
        scores[n] = explorer.alpha * unknown - length_m if np.isfinite(length_m) else -np.inf
    return scores


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("unknown", list(Unknown))
@pytest.mark.parametrize("with_target", [True, False])
def test_no_candidate_is_better_than_the_goal(seed: int, unknown: Unknown, with_target: bool) -> None:
    rng, scored = np.random.default_rng(seed), 0
    weights = {"alpha": float(rng.uniform(0.0, 0.05)), "gamma": float(rng.uniform(0.2, 2.0))}
    for depth_m in (3.0, 4.0, 5.0, 6.0):
        explorer = Frontier(unknown=unknown, **weights)
        explorer.reset(HEIGHT_M, LIMITS)
        seen = seen_at(rng, random_map(rng, depth_m), 1.0, with_target)
        goal = explorer.select(seen, fresh=True)
        assert explorer._plane is not None
        best = every_score(explorer, seen, explorer._candidates(explorer._plane, seen)).max(initial=-np.inf)
        if best > -np.inf:
            assert goal is not None
        if goal is not None and not goal.is_target and best > -np.inf:
            assert goal.score == pytest.approx(best, abs=1e-4)
            scored += 1
    assert scored > 0


@pytest.mark.parametrize("bonus", [0.0, 1e6])
def test_a_kept_goal_is_left_for_one_that_beats_it_by_the_bonus_and_for_no_other(bonus: float) -> None:
    kept_where_another_was_better = 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        here, there = (
            seen_at(rng, random_map(np.random.default_rng(seed), 5.0), x, False) for x in (1.0, 2.2)
        )
        there = replace(there, field=here.field)
        explorer, anew = Frontier(hysteresis=bonus), Frontier()
        for one in (explorer, anew):
            one.reset(HEIGHT_M, LIMITS)
        first, best = explorer.select(here, fresh=True), anew.select(there, fresh=True)
        if first is None or best is None:
            continue
        if np.linalg.norm(first.position_m - there.state.position_m) < 1.5:
            continue  # about to be visited
        second = explorer.select(there)
        if second is None or np.allclose(first.position_m, best.position_m):
            continue
        kept = np.allclose(second.position_m, first.position_m)
        kept_where_another_was_better += kept
        assert kept or bonus == 0.0
        assert np.allclose(explorer.select(there, fresh=True).position_m, best.position_m)
    assert bonus == 0.0 or kept_where_another_was_better > 2


def test_the_straight_way_between_cells_goes_along_the_diagonal() -> None:
    """Octile: 7 cells straight and 3 across, a diagonal step costs sqrt(2)."""
    cells = np.array([[0, 0], [10, 3], [3, 10], [4, 4]])
    expected = [7.0 + 3.0 * np.sqrt(2.0), 0.0, 7.0 * np.sqrt(2.0) + 0.0, 5.0 + np.sqrt(2.0)]
    assert straight(cells, (10, 3)) == pytest.approx(expected, rel=4e-3)
