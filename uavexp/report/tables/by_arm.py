"""A row per arm, a column per metric: mean and interval."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fnmatch import fnmatchcase

import numpy as np

from uavexp.arrays import Bool, Float
from uavexp.metrics.metric import Metric
from uavexp.report import number_format
from uavexp.report.comparison import SCENE, Panel, estimate, panel_of
from uavexp.report.labels import CLEARANCE, RATE, REPLANS
from uavexp.report.printed import Printed
from uavexp.report.results import ARM, FAILED, INTERVALS, Results
from uavexp.report.tables.base import Table

_JUDGED = (RATE, CLEARANCE, REPLANS)
_FRONT = (
    "Front: by the means, no other arm is at least as good in success, clearance and replans and better in "
    "one of them."
)


def table(
    results: Results,
    *,
    name: str,
    metrics: Sequence[Metric],
    title: str = "",
    notes: Sequence[str] = (),
    front: bool = False,
    printed: bool = False,
    scenes: Sequence[str] = (),
) -> Table | None:
    """How each arm did.

    Args:
        results: of the study.
        name: of the table's files.
        metrics: its columns.
        title: above it; none: the study's.
        notes: sentences below it.
        front: with a column that says who is on the front of success, clearance and replans.
        printed: with a row for each arm that is in `reference.csv` alone: a system that was not flown here.
        scenes: patterns of the names of scenes (`*` any letters) that it tells of; none: of all. No table
            where none of them was flown.
    """
    panel = _in_scenes(results, scenes)
    if panel is None:
        return None
    shown = results.occurring(metrics)
    rows = [
        (
            arm,
            str(panel.n(arm)),
            *(
                number_format.mean_with_interval(estimate(panel, metric, arm), metric, panel.n(arm))
                for metric in shown
            ),
        )
        for arm in panel.arms
    ]
    made = Table(
        name=name,
        title=title or results.study.title or "How each configuration did",
        columns=("", "n", *(metric.label for metric in shown)),
        rows=tuple(rows),
        notes=(*results.notes, *notes, INTERVALS, FAILED),
        means=tuple(metrics),
    )
    made = _with_front(made, panel) if front else made
    return _with_printed(made, results, shown) if printed else made


def _in_scenes(results: Results, patterns: Sequence[str]) -> Panel | None:
    """The trials in scenes with such names; None: there are none."""
    if not patterns:
        return results.panel
    kept = [scene for scene in results.scenes if any(fnmatchcase(scene, pattern) for pattern in patterns)]
    trials = results.trials[results.trials[SCENE].isin(kept)]
    return panel_of(trials, ARM, results.arms, together=results.shown) if kept else None


def _with_printed(made: Table, results: Results, shown: Sequence[Metric]) -> Table:
    """The table with what is printed of others, and where."""
    others = list(dict.fromkeys(arm for _, arm in results.printed if arm not in results.panel.arms))
    blank = ("",) * (len(made.columns) - 2 - len(shown))
    rows = [
        (arm, "", *(_printed(results.printed.get((metric.column, arm)), metric) for metric in shown), *blank)
        for arm in others
    ]
    told = [
        f"{arm}: {found.source}. {found.notes}"
        for (_, arm), found in results.printed.items()
        if arm in others and found.notes
    ]
    return replace(made, rows=(*made.rows, *rows), notes=(*made.notes, *told))


def _printed(found: Printed | None, metric: Metric) -> str:
    return number_format.NONE if found is None else number_format.number(found.mean, metric.digits)


def _with_front(made: Table, panel: Panel) -> Table:
    judged = [metric for metric in _JUDGED if panel.has(metric)]
    means = [[metric.better * estimate(panel, metric, arm).mean for metric in judged] for arm in panel.arms]
    marks = ("front" if mark else "" for mark in on_front(np.array(means)))
    rows = tuple((*row, mark) for row, mark in zip(made.rows, marks, strict=True))
    return replace(made, columns=(*made.columns, "front"), rows=rows, notes=(*made.notes, _FRONT))


def on_front(points: Float) -> Bool:
    """Which points no other point is at least as good as in everything and better in something.

    Args:
        points: (N, D), more is better; NaN is never on the front and excludes nobody.
    """
    comparable = np.where(np.isfinite(points), points, -np.inf)
    at_least = np.all(comparable[None] >= comparable[:, None], axis=2)
    better = np.any(comparable[None] > comparable[:, None], axis=2)
    beaten = np.any(at_least & better, axis=1)
    return np.asarray(~beaten & np.all(np.isfinite(points), axis=1))
