"""Columns of the trials: parameters of held options, and counts of causes."""

from __future__ import annotations

from uavexp.config.composition import Composer
from uavexp.config.overrides import parse_settings
from uavexp.store.table import parameters, with_every_cause


def test_an_option_that_is_held_has_its_name_and_columns_of_its_own() -> None:
    typed = ["planner.find=turning", "planner.find.turn_weight=0.7"]
    row = parameters(Composer().cell(parse_settings(typed)).config)
    assert row["p_planner_find"] == "turning"
    assert row["p_planner_find_turn_weight"] == 0.7
    assert row["p_planner_min_clearance_m"] == 0.26
    assert row["p_step_s"] == 0.01
    assert not any("_target_" in column for column in row)


def test_a_cause_that_one_flight_replanned_for_is_zero_for_those_that_did_not() -> None:
    """Regression: a mean over such a column was one over the flights in which it fired."""
    fired = {"replans": 1, "replans_metres": 1}
    rows = with_every_cause([fired, {"replans": 0}, {"status": "killed"}])
    assert rows == [fired, {"replans": 0, "replans_metres": 0}, {"status": "killed"}]
