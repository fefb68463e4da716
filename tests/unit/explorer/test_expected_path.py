"""The goal lies on the way of least expected cost: priced and searched anew over whole planes by scipy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.unit.explorer.test_frontier import BOUNDS_M, HEIGHT_M, TARGET_M, random_map, seen_at
from tests.unit.explorer.test_waves import scipy_costs
from uavexp.arrays import Float
from uavexp.check.fields import box, empty, field_from
from uavexp.check.hall import LIMITS, hovering, observe
from uavexp.explorer.expected_path import ExpectedPath
from uavexp.explorer.waves import WALL_LEVELS
from uavexp.field import UNKNOWN
from uavexp.mapping.projection import Band, PlanarMap, Projection
from uavexp.parameters import Unknown
from uavexp.types import Goal, Observation


def begun(**parameters: float | str) -> ExpectedPath:
    explorer = ExpectedPath(**parameters)
    explorer.reset(HEIGHT_M, LIMITS)
    return explorer


def planes(explorer: ExpectedPath, seen: Observation) -> tuple[PlanarMap, Float]:
    """The planar map, and the price of each cell: 0 where the body does not fit."""
    band = Band(
        z_min_m=0.85, z_max_m=1.25, flight_height_m=HEIGHT_M, occupied_below_m=explorer.occupied_below_m
    )
    projection = Projection(seen.field, band)
    projection.update()
    plane = projection.planar
    i, j = np.mgrid[: plane.state.shape[0], : plane.state.shape[1]]
    x, y = (plane.origin_m[axis] + (index + 0.5) * 0.15 for axis, index in enumerate((i, j)))
    inside = (x >= BOUNDS_M[0, 0]) & (x <= BOUNDS_M[1, 0]) & (y >= BOUNDS_M[0, 1]) & (y <= BOUNDS_M[1, 1])
    vehicle = plane.cell_of(seen.state.position_m)
    near = (i - vehicle[0]) ** 2 + (j - vehicle[1]) ** 2 <= (explorer.escape_m / 0.15) ** 2
    fits = inside & ((plane.clearance > np.float32(0.22)) | ((plane.clearance > 0.0) & near))
    level = np.floor(WALL_LEVELS * plane.clearance.clip(0.0) / np.float32(explorer.wall_m))
    share = np.minimum((level + 0.5) / WALL_LEVELS, 1.0)  # of the way from wall_cost to unknown_cost
    unseen = explorer.unknown_cost + (1.0 - share) * (explorer.wall_cost - explorer.unknown_cost)
    unseen = np.where(plane.clearance < np.float32(explorer.wall_m), unseen, explorer.unknown_cost)
    known = np.where(plane.clearance < np.float32(0.3), explorer.narrow_cost, 1.0)
    price = np.rint(100.0 * np.where(plane.state == UNKNOWN, unseen, known)).astype(np.int64)
    return plane, price * fits


@pytest.mark.parametrize("seed", range(12))
def test_the_goal_is_on_a_way_of_least_cost_and_not_far_into_the_unknown(seed: int) -> None:
    rng, checked = np.random.default_rng(seed), 0
    for depth_m in (3.0, 4.0, 5.0, 6.0):
        explorer = begun(narrow_clearance_m=0.22, beyond_m=float(rng.uniform(0.0, 2.0)))
        seen = seen_at(rng, random_map(rng, depth_m), 1.0, with_target=True)
        goal = explorer.select(seen, fresh=True)
        plane, price = planes(explorer, seen)
        ends = [plane.cell_of(point) for point in (seen.state.position_m, TARGET_M)]
        there, back = (scipy_costs(price, end, int(price[end]) or 100) for end in ends)
        least = back[ends[0]]
        if goal is None or not np.isfinite(least) or not price[ends[0]]:
            continue
        assert goal.score == pytest.approx(-0.0015 * least, abs=1e-4)
        cell = plane.cell_of(goal.position_m)
        assert there[cell] + back[cell] == pytest.approx(least, abs=2.0)
        if not goal.is_target:
            known = np.where(plane.state == UNKNOWN, 0, price)
            way_m = 0.0015 * scipy_costs(known, ends[0], 100)
            around = way_m[max(cell[0] - 14, 0) : cell[0] + 15, max(cell[1] - 14, 0) : cell[1] + 15]
            assert np.isfinite(around).any()  # what is known, and can be flown to, is beyond_m away at most
            checked += 1
    assert checked > 0


def hall(seen_to_m: float, *boxes: tuple[tuple[float, ...], tuple[float, ...]]) -> Observation:
    """A hall known up to there, the vehicle near its beginning."""
    grid, unknown = empty((9.0, 6.0, 2.4)), empty((9.0, 6.0, 2.4))
    for low, high in boxes:
        box(grid, low, high)
    unknown[round(seen_to_m / 0.1) :] = True
    field = field_from(grid & ~unknown, unknown=unknown, max_distance_m=2.0)
    return replace(
        observe(field, time_s=0.2),
        state=hovering((1.0, 2.4, HEIGHT_M)),
        target_m=TARGET_M,
        flight_bounds_m=BOUNDS_M,
    )


def chosen(explorer: ExpectedPath, seen: Observation) -> Goal:
    goal = explorer.select(seen)
    assert goal is not None
    return goal


def test_the_goal_is_the_target_where_known_cells_lead_there() -> None:
    assert chosen(begun(), hall(9.0)).is_target


def test_the_goal_is_carried_behind_the_frontier() -> None:
    for beyond_m in (1.0, 2.0):
        goal = chosen(begun(beyond_m=beyond_m), hall(4.0))
        assert goal.position_m[0] == pytest.approx(4.0 + beyond_m, abs=0.2)
        assert goal.position_m[1] == pytest.approx(2.4, abs=0.2)


def test_without_flights_into_the_unknown_the_goal_is_seen_to_be_free() -> None:
    seen = hall(4.0)
    goal = chosen(begun(unknown=Unknown.CONSERVATIVE), seen)
    assert seen.field.observed(goal.position_m[None])[0]
    assert goal.position_m[0] == pytest.approx(4.0, abs=0.2)


def test_unseen_space_beside_a_wall_is_dearer_than_none() -> None:
    """A wall ends where the known part ends: the way keeps off what may be more of it."""
    wall = ((3.0, 2.6, 0.0), (4.0, 2.8, 2.4))
    near, off = (chosen(begun(wall_cost=cost), hall(4.0, wall)).position_m[1] for cost in (1.0, 5.0))
    assert off < near - 0.1


def test_a_goal_is_kept_while_no_way_is_much_cheaper_and_left_when_it_is_rejected() -> None:
    explorer = begun(hysteresis=1.0)
    first = chosen(explorer, hall(4.0))
    later = replace(hall(4.6), time_s=0.4)
    assert chosen(explorer, later) is first
    explorer.reject(first.position_m, 0.6)
    other = chosen(explorer, replace(hall(4.0), time_s=0.8))
    assert np.linalg.norm(other.position_m - first.position_m) > explorer.aside_radius_m


def test_a_frontier_that_stays_unknown_from_near_is_set_aside() -> None:
    """Within `commit_m` of every place to which the way would lead, another one is taken."""
    explorer, seen = begun(beyond_m=0.0), hall(4.0)
    here = replace(seen, state=hovering((3.7, 2.4, HEIGHT_M)))
    goal = chosen(explorer, here)
    assert np.linalg.norm(goal.position_m - here.state.position_m) > explorer.commit_m


@pytest.mark.parametrize("seed", range(4))
def test_what_is_kept_between_choices_follows_the_map(seed: int) -> None:
    """Walls come into sight, the unknown recedes: the goal is the one that a new explorer chooses."""
    whole = random_map(np.random.default_rng(seed), 9.0)
    state, distance = whole.state.copy(), whole.distance.copy()
    changed = np.zeros((12, 8), dtype=np.int32)
    field = replace(whole, state=state, distance=distance, changed=changed)
    state[24:] = UNKNOWN
    kept = begun(set_aside_s=0.0)
    for depth in range(24, 80, 8):
        state[:depth] = whole.state[:depth]
        changed[: depth // 8] += 1
        for x_m in (1.0, 1.3):
            seen = replace(hall(9.0), field=field, state=hovering((x_m, 2.4, HEIGHT_M)))
            kept._current = None
            goal, anew = kept.select(seen), begun(set_aside_s=0.0).select(seen)
            assert (goal is None) == (anew is None)
            if goal is not None and anew is not None:
                np.testing.assert_array_equal(goal.position_m, anew.position_m)
                assert goal.score == anew.score
