"""Where the usual clearance finds no way, a lesser one does, slowly; the same in planner and explorer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.components import build
from uavexp.check.fields import box, empty, field_from
from uavexp.check.hall import LIMITS, hovering, observe
from uavexp.check.requests import ask
from uavexp.explorer.frontier import Frontier
from uavexp.field import DistanceField
from uavexp.trajectory import evaluate
from uavexp.types import PlanStatus, Squeeze

NARROW_M, SLOW_MPS = 0.22, 1.0
START, TARGET = np.array([1.05, 2.05, 1.05]), np.array([6.05, 2.05, 1.05])


def doorway(half_m: float, *, unknown_behind: bool = False) -> DistanceField:
    """A wall at x = 3.5 m with a door around y = 2.05 m, which leaves half_m - 0.05 m on the map."""
    grid, unknown = empty((7.0, 4.0, 2.0)), empty((7.0, 4.0, 2.0))
    box(grid, (3.5, 0.0, 0.0), (3.7, 2.05 - half_m, 2.0))
    box(grid, (3.5, 2.05 + half_m, 0.0), (3.7, 4.0, 2.0))
    unknown[45:] = unknown_behind
    return field_from(grid, unknown=unknown)


def planner(name: str, **changes: float):
    made = build("planner", name, **{
        "narrow_clearance_m": NARROW_M, "narrow_speed_mps": SLOW_MPS, **changes
    })  # fmt: skip
    made.reset(LIMITS, np.random.default_rng(0))
    return made


@pytest.mark.parametrize("name", ["min_acc", "bspline_qp", "bspline_mpc", "astar", "improved_astar"])
def test_a_door_that_is_too_narrow_for_the_usual_clearance_is_passed_slowly(name: str) -> None:
    field = doorway(0.3)
    assert 0.23 <= field.distance_m(np.array([[3.6, 2.05, 1.05]]))[0] < 0.26
    request = ask(field, START, TARGET)
    result = planner(name).plan(request)
    assert result.trajectory is not None, result.reason
    times_s = np.linspace(result.trajectory.start_s, result.trajectory.end_s, 800)
    at_m, velocity, _ = evaluate(result.trajectory, times_s)
    assert field.distance_m(at_m).min() >= NARROW_M - 1e-3
    assert np.linalg.norm(velocity, axis=1).max() <= SLOW_MPS * 1.001
    assert planner(name, narrow_clearance_m=0.0).plan(request).status is not PlanStatus.OK


def test_a_door_that_is_wide_enough_is_passed_as_ever_and_one_narrower_still_not_at_all() -> None:
    wide = planner("min_acc").plan(ask(doorway(0.6), START, TARGET))
    assert wide.trajectory is not None
    times_s = np.linspace(wide.trajectory.start_s, wide.trajectory.end_s, 800)
    assert np.linalg.norm(evaluate(wide.trajectory, times_s)[1], axis=1).max() > 1.5
    assert planner("min_acc").plan(ask(doorway(0.2), START, TARGET)).status is not PlanStatus.OK


@pytest.mark.parametrize("name", ["min_acc", "bspline_qp", "bspline_mpc"])
def test_a_squeeze_passes_where_a_narrow_place_is_not_narrow_enough(name: str) -> None:
    request = ask(doorway(0.3), START, TARGET)
    blocked = planner(name, narrow_clearance_m=0.0)
    assert blocked.plan(request).status is not PlanStatus.OK
    through = replace(request, squeeze=Squeeze(clearance_m=NARROW_M, speed_mps=0.5))
    result = blocked.plan(through)
    assert result.trajectory is not None, result.reason
    times_s = np.linspace(result.trajectory.start_s, result.trajectory.end_s, 800)
    assert np.linalg.norm(evaluate(result.trajectory, times_s)[1], axis=1).max() <= 0.5 * 1.001


def test_who_is_fast_is_not_led_into_a_narrow_place() -> None:
    fast = ask(doorway(0.3), START, TARGET, velocity_mps=np.array([1.5, 0.0, 0.0]))
    assert planner("min_acc").plan(fast).status is not PlanStatus.OK


@pytest.mark.parametrize(("narrow_m", "finds"), [(NARROW_M, True), (0.0, False)])
def test_the_explorer_has_the_same_rule(narrow_m: float, finds: bool) -> None:
    """All that is left to explore lies behind the door."""
    field = doorway(0.35, unknown_behind=True)
    explorer = Frontier(narrow_clearance_m=narrow_m, min_clearance_m=0.35, enough_clearance_m=0.6, cell_m=0.1)
    explorer.reset(1.05, LIMITS)
    seen = replace(
        observe(field), state=hovering(START), flight_bounds_m=np.array([[0.2, 0.2, 0.4], [6.8, 3.8, 1.6]])
    )
    goal = explorer.select(seen)
    assert (goal is not None) == finds
    assert goal is None or goal.position_m[0] > 3.7
