"""Judges of what was never measured: nothing is reproduced by values that are not there."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from uavexp.report import judges
from uavexp.report.comparison import panel_of
from uavexp.report.judges import Verdict
from uavexp.report.labels import CLEARANCE, RATE, REPLANS

ARMS = ("A", "B")


def results(seeds: int = 12, **of_the_first: float) -> Any:
    """Two arms in the same worlds of eight scenes; the first with values of its own."""
    table = pd.MultiIndex.from_product([list("abcdefgh"), range(seeds), ARMS], names=["scene", "seed", "arm"])
    rows = table.to_frame(index=False).assign(success=1.0, min_clearance_m=0.3, replans=5.0)
    for column, value in of_the_first.items():
        rows.loc[rows["arm"] == "A", column] = value
    return SimpleNamespace(panel=panel_of(rows, "arm", ARMS), printed={}, tests=(), comparisons=())


def test_fewer_replans_at_no_other_cost_are_a_better_trade() -> None:
    assert judges.trade_off(results(replans=1.0), arms=ARMS)[0] is Verdict.REPRODUCED


def test_few_flights_do_not_show_that_success_is_no_less() -> None:
    """All of them arrive, and yet one in eight might fail: no trade is judged better for it."""
    few = results(seeds=2, replans=1.0)
    assert judges.trade_off(few, arms=ARMS)[0] is Verdict.NOT_SHOWN
    assert judges.no_worse(few, arms=ARMS, metric=RATE, margin=5.0)[0] is Verdict.NOT_SHOWN
    assert judges.trade_off(few, arms=ARMS, success_percent=30.0)[0] is Verdict.REPRODUCED


@pytest.mark.parametrize("column", ["min_clearance_m", "replans"])
def test_a_trade_of_which_one_side_is_not_known_is_no_better_one(column: str) -> None:
    unknown = results(**{"replans": 1.0, column: np.nan})
    assert judges.trade_off(unknown, arms=ARMS)[0] is Verdict.NOT_TESTABLE


def test_no_scene_is_worse_where_all_are_known_only() -> None:
    same, unknown = results(), results(min_clearance_m=np.nan)
    assert judges.no_worse_in_any_scene(same, arms=ARMS, metric=CLEARANCE)[0] is Verdict.REPRODUCED
    assert judges.no_worse_in_any_scene(unknown, arms=ARMS, metric=CLEARANCE)[0] is Verdict.NOT_TESTABLE
    few = results(seeds=7)  # 8 / 2**7 > 0.05: in no scene could they show that it is worse
    assert judges.no_worse_in_any_scene(few, arms=ARMS, metric=CLEARANCE)[0] is Verdict.NOT_TESTABLE


def test_what_did_not_happen_in_few_flights_may_yet_happen() -> None:
    """Of a count the Poisson bound is left, 3.7 in all flights; nothing bounds another value."""
    few = results(seeds=1)  # eight flights
    assert judges.no_worse(few, arms=ARMS, metric=REPLANS, margin=0.4)[0] is Verdict.NOT_SHOWN
    assert judges.no_worse(few, arms=ARMS, metric=REPLANS, margin=0.5)[0] is Verdict.REPRODUCED
    assert judges.no_worse(results(), arms=ARMS, metric=CLEARANCE, margin=9.0)[0] is Verdict.NOT_SHOWN
