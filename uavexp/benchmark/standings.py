"""How an entry did beside the built-in policies: means with intervals, of the suite and of its parts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from uavexp.benchmark.entry import part_of
from uavexp.metrics.metric import Metric
from uavexp.report.comparison import SCENE, Panel, estimate, panel_of
from uavexp.report.labels import metrics_of
from uavexp.report.number_format import mean_with_interval
from uavexp.report.results import ARM, INTERVALS, Results
from uavexp.report.tables.base import Table
from uavexp.store.study import read_study

COMPUTE = Metric(column="compute_s", title="Compute", unit="s", digits=2, better=-1)
METRICS = (
    *metrics_of(("success", "collision_count", "mover_contacts", "spl", "completion_time_s", "replans")),
    COMPUTE,
)
WHOLE = "whole suite"
_COMPUTED = ("search", "optimise", "explore", "trigger")  # what a policy's plans cost
_NOTE = (
    "Compute: clock time of choosing goals, deciding, searching and smoothing, of one flight, on the machine "
    "that flew it. Every policy in the worlds that all have flown; the built-in ones: the committed rows."
)


def rows_of(folder: Path) -> pd.DataFrame:
    """Trials of a study folder, with the arm's name and the compute of each.

    Raises:
        RecordError: no study, or a damaged one.
    """
    trials = Results(study=read_study(folder)).trials
    clocks = [name for name in (f"wall_{part}_sum_s" for part in _COMPUTED) if name in trials]
    return trials.assign(**{COMPUTE.column: trials[clocks].astype(float).sum(axis=1)})


def in_common(mine: pd.DataFrame, others: pd.DataFrame) -> pd.DataFrame:
    """Trials of an entry and of the built-in policies in the worlds that both have flown."""
    mine_in, others_in = (pd.MultiIndex.from_frame(rows[[SCENE, "seed"]]) for rows in (mine, others))
    return pd.concat([mine[mine_in.isin(others_in)], others[others_in.isin(mine_in)]], ignore_index=True)


def parts_of(rows: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """The whole and its parts by their names."""
    part = rows[SCENE].map(part_of)
    return {WHOLE: rows} | {name: rows[part == name] for name in dict.fromkeys(part)}


def standings(rows: pd.DataFrame) -> list[Table]:
    """A table of the whole suite and one of each part, a row per policy."""
    return [_standing(name, part) for name, part in parts_of(rows).items()]


def _standing(name: str, rows: pd.DataFrame) -> Table:
    panel = _panel(rows)
    shown = [metric for metric in METRICS if panel.has(metric)]
    body = tuple(
        (
            arm,
            str(panel.n(arm)),
            *(mean_with_interval(estimate(panel, metric, arm), metric, panel.n(arm)) for metric in shown),
        )
        for arm in panel.arms
    )
    return Table(
        name=name.replace(" ", "_"),
        title=name[0].upper() + name[1:],
        columns=("policy", "n", *(metric.label for metric in shown)),
        rows=body,
        notes=(_NOTE, INTERVALS) if name == WHOLE else (),
    )


def _panel(rows: pd.DataFrame) -> Panel:
    return panel_of(rows, ARM, tuple(dict.fromkeys(rows[ARM])), together=METRICS)


def numbers(rows: pd.DataFrame, arm: str) -> dict[str, Any]:
    """Mean, low and high of one policy, by part and metric, for machines; null where there is none."""
    return {name: _numbers(_panel(part), arm) for name, part in parts_of(rows).items()}


def _numbers(panel: Panel, arm: str) -> dict[str, Any]:
    found: dict[str, Any] = {"flights": panel.n(arm)}
    for metric in METRICS:
        if panel.has(metric):
            one = estimate(panel, metric, arm)
            found[metric.column] = _finite((one.mean, one.interval.low, one.interval.high))
    return found


def _finite(values: Sequence[float]) -> list[float | None]:
    return [value if math.isfinite(value) else None for value in values]
