"""Judges of what was never measured: nothing is reproduced by values that are not there."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from uavexp.report import judges
from uavexp.report.comparison import panel_of
from uavexp.report.derived import FALSE_TRIGGERS
from uavexp.report.judges import Verdict
from uavexp.report.labels import CLEARANCE, CONTACTS, RATE, REPLANS

ARMS = ("A", "B")


def results(
    seeds: int = 12, scenes: str = "abcdefgh", arms: tuple[str, ...] = ARMS, **of_the_first: Any
) -> Any:
    """Arms in the same worlds of some scenes; the first with values of its own."""
    table = pd.MultiIndex.from_product([list(scenes), range(seeds), arms], names=["scene", "seed", "arm"])
    rows = table.to_frame(index=False).assign(
        success=1.0, min_clearance_m=0.3, replans=5.0, completion_time_s=60.0, false_triggers_per_min=0.0
    )
    for column, value in of_the_first.items():
        rows.loc[rows["arm"] == "A", column] = value
    return SimpleNamespace(panel=panel_of(rows, "arm", arms), printed={}, tests=(), comparisons=())


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


def test_a_flight_that_was_lost_is_none_without_the_event() -> None:
    asked: dict[str, Any] = {"arms": ("A",), "metric": CONTACTS, "event": "a contact", "at_most_percent": 5.0}
    assert judges.none(results(collision_count=0.0), **asked)[0] is Verdict.REPRODUCED
    lost = results(collision_count=np.where(np.arange(96) < 24, 0.0, np.nan))
    verdict, evidence = judges.none(lost, **asked)
    assert verdict is Verdict.NOT_SHOWN
    assert evidence.startswith("0 of 24 flights")


def test_six_scenes_are_enough_for_the_bound() -> None:
    six = results(scenes="abcdef")
    assert judges.no_worse(six, arms=ARMS, metric=REPLANS, margin=0.5)[0] is Verdict.REPRODUCED


def test_events_in_a_time_are_bounded_by_the_minutes_flown() -> None:
    few = results(seeds=1)  # eight minutes
    assert judges.no_worse(few, arms=ARMS, metric=FALSE_TRIGGERS, margin=0.4)[0] is Verdict.NOT_SHOWN
    assert judges.no_worse(few, arms=ARMS, metric=FALSE_TRIGGERS, margin=0.5)[0] is Verdict.REPRODUCED


def test_eight_worlds_in_each_of_eight_scenes_could_show_a_worse_one() -> None:
    enough = results(seeds=8)  # 8 / 2**8 < 0.05
    assert judges.no_worse_in_any_scene(enough, arms=ARMS, metric=CLEARANCE)[0] is Verdict.REPRODUCED


def test_the_scene_with_the_fewest_worlds_decides() -> None:
    partly = results(min_clearance_m=np.where(np.arange(96) < 9, np.nan, 0.3))  # 3 worlds in scene a
    verdict, why = judges.no_worse_in_any_scene(partly, arms=ARMS, metric=CLEARANCE)
    assert verdict is Verdict.NOT_TESTABLE
    assert why.startswith("3 worlds in a scene")


def test_as_many_replans_are_neither_fewer_nor_more() -> None:
    assert judges.trade_off(results(), arms=ARMS)[0] is Verdict.NOT_SHOWN


def test_a_trade_is_contradicted_only_where_every_arm_loses() -> None:
    three = results(arms=("A", "B", "C"), replans=9.0)  # C is as B
    assert judges.trade_off(three, arms=("A", "B"))[0] is Verdict.CONTRADICTED
    assert judges.trade_off(three, arms=("A", "C", "B"))[0] is Verdict.NOT_SHOWN


def test_more_arms_than_scenes_can_tell_apart_are_not_testable() -> None:
    arms = ("A", "B", "C", "D", "E")
    six = results(scenes="abcdef", arms=arms)  # the least p is 1 / 2**6
    assert judges.trade_off(six, arms=("A", "C", "D", "B"))[0] is Verdict.NOT_SHOWN
    assert judges.trade_off(six, arms=("A", "C", "D", "E", "B"))[0] is Verdict.NOT_TESTABLE
