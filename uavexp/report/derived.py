"""Metrics that are computed from the columns of the tables, not by the trial itself."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from uavexp.metrics.metric import Flight, Metric
from uavexp.store.study import Study

USEFUL_CHANGE_M = Flight.useful_change_m  # a replan that departs less from the old path was wasted
WASTED = Metric(column="wasted_replans", title="Wasted replans", digits=1, better=-1, is_count=True)
USEFUL_SHARE = Metric(
    column="useful_share",
    title="Useful replans",
    unit="%",
    digits=0,
    better=1,
    scale=100.0,
    missing="there was no replan",
)
FALSE_TRIGGERS = Metric(
    column="false_triggers_per_min",
    title="False triggers",
    unit="1/min",
    better=-1,
    missing="the trial did not run to its end",
)
METRICS = (WASTED, USEFUL_SHARE, FALSE_TRIGGERS)


def with_derived(study: Study, metrics: Sequence[Metric]) -> pd.DataFrame:
    """The trials with the columns that can be derived for these metrics."""
    trials = with_replan_shares(study.measurements)
    if FALSE_TRIGGERS in metrics and FALSE_TRIGGERS.column not in trials:  # committed rows have it
        return with_false_triggers(trials, study.replans)
    return trials


def with_replan_shares(trials: pd.DataFrame) -> pd.DataFrame:
    """The trials with the columns `wasted_replans` and `useful_share` (NaN without a replan)."""
    if "useful_replans" not in trials or "replans" not in trials:
        return trials
    replans = trials["replans"].astype(float)
    useful = trials["useful_replans"].astype(float)
    shares = {WASTED.column: replans - useful, USEFUL_SHARE.column: useful / replans.where(replans > 0)}
    return trials.assign(**shares)


def with_false_triggers(trials: pd.DataFrame, replans: pd.DataFrame) -> pd.DataFrame:
    """The trials with the column `false_triggers_per_min`; NaN for those that did not run to their end.

    A false trigger is a replan for a change of the map that moved the path by less than 0.1 m.
    """
    end_s = trials.set_index("trial")["completion_time_s"].astype(float)
    wasted = (
        (replans["cause"] == "map")
        & (replans["number"] > 0)
        & (replans["status"] == "ok")
        & (replans["effective_s"] <= replans["trial"].map(end_s))
        & (replans["path_change_m"] <= USEFUL_CHANGE_M)
    )
    count = trials["trial"].map(replans.loc[wasted, "trial"].value_counts()).fillna(0.0).astype(float)
    minutes = trials["completion_time_s"].astype(float) / 60.0
    return trials.assign(**{FALSE_TRIGGERS.column: count / minutes.where(minutes > 0.0)})
