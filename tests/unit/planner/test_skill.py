"""What the shipped planners can do beyond what every planner promises."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from uavexp.arrays import Float
from uavexp.check.fields import field_from
from uavexp.check.hall import LIMITS
from uavexp.check.requests import among_shelves, ask, follow_on, hopeless, obstacle_course
from uavexp.check.subject import subjects
from uavexp.config.composition import Composer
from uavexp.config.overrides import parse_settings
from uavexp.trajectory import evaluate
from uavexp.types import PlanStatus

SKILLED = (
    "astar",
    "bitstar",
    "bspline_mpc",
    "bspline_qp",
    "df_bitstar",
    "improved_astar",
    "min_acc",
    "rrtstar",
)


@pytest.fixture(scope="module", params=SKILLED)
def fresh(request: pytest.FixtureRequest) -> Callable[[], Any]:
    (subject,) = subjects(Composer(), parse_settings([f"planner={request.param}"]))

    def begun() -> Any:
        planner = subject.make()
        planner.reset(LIMITS, np.random.default_rng(7))
        return planner

    return begun


def test_finds_a_way_through_the_shelves(fresh: Callable[[], Any]) -> None:
    planner = fresh()
    results = [planner.plan(request) for request in among_shelves(1, 12)]
    # every one of them can be flown, braking first if need be
    assert sum(result.status is PlanStatus.OK for result in results) >= 10


def test_finds_a_way_on_from_every_plan(fresh: Callable[[], Any]) -> None:
    planner = fresh()
    request = among_shelves(3, 1)[0]
    for _ in range(6):
        result = planner.plan(request)
        assert result.trajectory is not None, result.reason
        request = follow_on(request, result.trajectory)


def test_says_what_makes_a_request_hopeless(fresh: Callable[[], Any]) -> None:
    planner = fresh()
    assert [planner.plan(request).status for request in hopeless().values()] == [
        PlanStatus.START_BLOCKED,
        PlanStatus.GOAL_BLOCKED,
        PlanStatus.NO_PATH,
        PlanStatus.NOT_CLEAR,
    ]


def test_turns_along_with_a_turned_world(fresh: Callable[[], Any]) -> None:
    grid, start, goal = obstacle_course()

    def turn(point: Float) -> Float:
        return np.array([6.0 - point[1], point[0], point[2]])  # (x, y) -> (width - y, x)

    here = fresh().plan(ask(field_from(grid), start, goal, velocity_mps=np.array([0.6, -0.3, 0.0])))
    turned = field_from(np.ascontiguousarray(np.rot90(grid)))
    there = fresh().plan(ask(turned, turn(start), turn(goal), velocity_mps=np.array([0.3, 0.6, 0.0])))
    assert there.trajectory.duration_s == pytest.approx(here.trajectory.duration_s, rel=0.03)
    times = here.trajectory.start_s + np.linspace(0.0, here.trajectory.duration_s, 100)
    expected = np.array([turn(point) for point in evaluate(here.trajectory, times)[0]])
    assert np.abs(evaluate(there.trajectory, times)[0] - expected).max() < 0.15
