"""Each axis of disturbances by itself: every level, and its difference from the undisturbed one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from uavexp.metrics.metric import Metric
from uavexp.report import number_format
from uavexp.report.comparison import Panel, compare, estimate, pairs_of
from uavexp.report.results import FAILED, INTERVALS, Results
from uavexp.report.tables.base import Table

_NONE = (
    "After the semicolon: level minus the undisturbed one of its axis in the same worlds, with the p value "
    "of sign flips of whole scenes, not corrected. The other axes are undisturbed."
)


def table(
    results: Results,
    *,
    name: str,
    metrics: Sequence[Metric],
    arm: str,
    undisturbed: Mapping[str, str],
    title: str = "",
    notes: Sequence[str] = (),
) -> Table:
    """The levels of each axis that `undisturbed` names, flown by one arm with the others undisturbed."""
    panels = {
        axis: results.only({"arm": arm, **undisturbed}, but=axis).panel
        for axis in results.arm_axes
        if axis in undisturbed
    }
    panels = {axis: panel for axis, panel in panels.items() if undisturbed[axis] in panel.arms}
    shown = [metric for metric in metrics if all(panel.has(metric) for panel in panels.values())]
    rows = tuple(
        (
            axis,
            level,
            str(panel.n(level)),
            *(_cell(panel, metric, level, undisturbed[axis]) for metric in shown),
        )
        for axis, panel in panels.items()
        for level in panel.arms
    )
    return Table(
        name=name,
        title=title or "Disturbances, one at a time",
        columns=("axis", "level", "n", *(metric.label for metric in shown)),
        rows=rows,
        notes=(*results.notes, *notes, _NONE, INTERVALS, FAILED),
    )


def _cell(panel: Panel, metric: Metric, level: str, none: str) -> str:
    """Mean at a level, and its difference from none."""
    found = estimate(panel, metric, level)
    mean = number_format.mean_with_interval(found, metric, panel.n(level))
    if level == none:
        return mean
    change = compare(pairs_of(panel, level, none, [metric]), metric)
    return f"{mean}; {number_format.difference(change, metric)}, p = {number_format.p_value(change.p)}"
