"""What one report found: its tables and verdicts, and what every kind of report needs to make them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from uavexp.report import cells
from uavexp.report.comparison import FEWEST_SCENES, SCENE, Metric, Panel, estimate, panel_of
from uavexp.report.parts import Claim, Table
from uavexp.store.study import Study
from uavexp.store.table import pooled_versions

OK = "ok"  # status of a trial that ran to its end

INTERVALS = (
    "In brackets 95 % intervals. Rates: Wilson's, with the effective number of trials in scenes. Means: "
    "bootstrap, scenes resampled, then seeds within them, percentiles widened for the number of scenes. "
    "Where all values are equal there is nothing to resample and no interval stands; a count that was zero "
    "in every flight has the exact Poisson bound instead, 3.7 / n."
)
FAILED = (
    "n counts every trial. One that did not run to its end (killed, out of time or memory) is a failure in "
    "the success rate and has no other metric; means over fewer trials name their n."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Findings:
    """Tables and verdicts in the order of the page."""

    tables: tuple[Table, ...]
    claims: tuple[Claim, ...] = ()
    rule: str = ""  # how a verdict is reached, where the claims do not say it themselves
    values: tuple[Table, ...] = ()  # the same numbers one to a cell, for machines: csv only


def with_replan_shares(trials: pd.DataFrame) -> pd.DataFrame:
    """The trials with the columns `wasted_replans` and `useful_share` (NaN without a replan)."""
    if "useful_replans" not in trials or "replans" not in trials:
        return trials
    replans = trials["replans"].astype(float)
    useful = trials["useful_replans"].astype(float)
    return trials.assign(wasted_replans=replans - useful, useful_share=useful / replans.where(replans > 0))


def arm_axes(study: Study) -> dict[str, tuple[str, ...]]:
    """Axes that tell arms apart, with their values: all but the scenes."""
    return {axis: values for axis, values in study.axes.items() if axis != SCENE}


def arms_flown(trials: pd.DataFrame, axes: Mapping[str, Sequence[str]]) -> tuple[str, ...]:
    """Names of the arms in the order of their axes, those without a trial left out."""
    places = [{value: place for place, value in enumerate(values)} for values in axes.values()]

    def order(row: tuple[str, ...]) -> list[tuple[int, str]]:
        return [(place.get(value, len(place)), value) for place, value in zip(places, row, strict=True)]

    flown = trials[list(axes)].astype(str).drop_duplicates().itertuples(index=False, name=None)
    return tuple(", ".join(filter(None, row)) for row in sorted(flown, key=order))


def study_panel(study: Study, metrics: Sequence[Metric]) -> Panel:
    """All trials of a study by world and arm."""
    axes = arm_axes(study)
    return panel_of(with_replan_shares(study.trials), tuple(axes), arms_flown(study.trials, axes), metrics)


def circumstances(study: Study, panel: Panel) -> tuple[str, ...]:
    """Sentences below every table: seeds, scenes, how unknown space is planned through."""
    trials = study.trials
    seeds = np.sort(trials["seed"].unique())
    scenes = f" in {len(panel.scenes)} scenes" if len(panel.scenes) > 1 else ""
    notes = [f"{len(trials)} trials{scenes}, {seeds.size} seeds ({seeds[0]} to {seeds[-1]})."]
    if 1 < len(panel.scenes) < FEWEST_SCENES:
        notes.append(
            f"Fewer than {FEWEST_SCENES} scenes: each world counts as independent in intervals and tests, "
            "which speak of further seeds in these scenes, not of other scenes."
        )
    if "p_planner_unknown" in trials:
        ways = sorted(trials["p_planner_unknown"].dropna().astype(str).unique())
        notes.append(f"Unknown space in plans: {', '.join(ways)}.")
    marks = [name for name in ("code", "lock") if name in trials]
    if marks and (pooled := pooled_versions(trials[marks].fillna("").itertuples(index=False, name=None))):
        notes.append(pooled)
    if "status" in trials and (failed := int((trials["status"] != OK).sum())):
        notes.append(f"{failed} trials did not run to their end.")
    return tuple(notes)


def arms_table(
    panel: Panel, metrics: Sequence[Metric], *, name: str, title: str, notes: Sequence[str]
) -> Table:
    """A row per arm, a column per metric: mean and interval."""
    shown = [metric for metric in metrics if panel.has(metric)]
    rows = [
        (
            arm,
            str(panel.n(arm)),
            *(
                cells.mean_with_interval(estimate(panel, metric, arm), metric, panel.n(arm))
                for metric in shown
            ),
        )
        for arm in panel.arms
    ]
    return Table(
        name=name,
        title=title,
        columns=("", "n", *(metric.label for metric in shown)),
        rows=tuple(rows),
        notes=(*notes, INTERVALS, FAILED),
    )


def values_table(panel: Panel, metrics: Sequence[Metric]) -> Table:
    """Every mean of a panel, one number to a cell."""
    rows = []
    for metric in metrics:
        for arm in panel.arms if panel.has(metric) else ():
            found = estimate(panel, metric, arm)
            numbers = (found.mean, found.sd, *found.interval)
            rows.append((metric.column, arm, str(found.n), *(f"{value:.6g}" for value in numbers)))
    return Table(
        name="values",
        title="Every mean, one number to a cell",
        columns=("metric", "arm", "n", "mean", "sd", "low", "high"),
        rows=tuple(rows),
    )
