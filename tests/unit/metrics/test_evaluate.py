"""The union of what the files of metrics declare, and what a user adds to it."""

from __future__ import annotations

import math

from tests.logs import empty_log, make_log, make_replan, make_world, still_curve
from uavexp import causes
from uavexp.metrics.evaluate import METRICS, evaluate, metric_of
from uavexp.metrics.metric import Metric

WORLD = make_world([])


def test_columns_are_declared_once_and_with_words_for_what_is_missing() -> None:
    columns = [metric.column for metric in METRICS]
    assert len(columns) == len(set(columns))
    for log in (empty_log(), make_log(still_curve(), still_curve())):
        for column, value in evaluate(log, WORLD).items():
            declared = metric_of(column)
            assert declared in METRICS
            assert not (isinstance(value, float) and math.isnan(value)) or declared.missing, column


def test_a_metric_of_ones_own_gets_its_column() -> None:
    own = {Metric(column="rows", title="Rows"): lambda flight: len(flight.log.steps.time_s)}
    values = evaluate(make_log(still_curve(), still_curve(), duration_s=1.0), WORLD, own)
    assert values["rows"] == 101
    assert metric_of("rows").label == "rows"  # unknown to whoever did not load it


def test_every_cause_that_occurs_is_counted_under_one_name() -> None:
    given = ["first", "map", "mine", "mine", "retry", "brake", "yours"]
    replans = tuple(make_replan(float(n), cause) for n, cause in enumerate(given))
    values = evaluate(make_log(still_curve(), still_curve(), replans=replans), WORLD)
    counts = {name.removeprefix("replans_"): values[name] for name in values if name.startswith("replans_")}
    assert {name: counts[name] for name in ("map", "mine", "yours", "other", "goal")} == {
        "map": 1,
        "mine": 2,
        "yours": 1,
        "other": 2,
        "goal": 0,
    }


def test_shipped_causes_are_told_apart_and_others_have_a_mark() -> None:
    shipped = (*causes.POLICY, *causes.PILOT)
    assert len({cause.name for cause in shipped}) == len(shipped)
    assert len({(cause.colour, cause.marker) for cause in shipped}) == len(shipped)
    own = causes.cause_named("mine")
    assert (own.name, own.label) == ("mine", "mine")
    assert own.marker not in {cause.marker for cause in shipped}
