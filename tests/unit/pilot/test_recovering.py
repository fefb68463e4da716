"""What is told of a flight's requests when nothing more can be reached."""

from __future__ import annotations

import math

import numpy as np
import pytest

from uavexp.log import Replan
from uavexp.pilot.recovering import is_shut_in
from uavexp.types import PlanStatus

NOWHERE = math.nan


def request(goal_x_m: float, *, planned: bool = False) -> Replan:
    return Replan(
        time_s=0.0, effective_s=math.nan, cause="goal", score=0.0, position_m=np.zeros(3),
        goal_m=np.array([goal_x_m, 0.0, 1.0]), status=PlanStatus.OK if planned else PlanStatus.NO_PATH,
        reason="", path_change_m=math.nan, iterations=0, expansions=0, near_change=False,
        changed_m=np.zeros((0, 3), np.float32), trajectory_m=np.zeros((0, 3), np.float32),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("failed_x_m", "expected"),
    [
        ([], False),
        ([1.0, 2.0], False),
        ([1.0, 2.0, 3.0], True),
        ([1.0, 1.2, 0.9, 1.0], False),  # all the same place
        ([1.0, 2.0, NOWHERE, NOWHERE, NOWHERE], False),
    ],
)
def test_shut_in_is_who_has_no_plan_to_three_places(failed_x_m: list[float], expected: bool) -> None:
    requests = [request(x_m) for x_m in failed_x_m]
    assert is_shut_in([request(9.0, planned=True), *requests]) is expected
    assert is_shut_in(requests) is expected
    assert not is_shut_in([*requests, request(9.0, planned=True)])


def test_a_plan_in_between_begins_the_count_anew() -> None:
    assert not is_shut_in([request(1.0), request(2.0), request(9.0, planned=True), request(3.0)])
