"""Success, clearance and false triggers over up to three axes of disturbances."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from uavexp.metrics.metric import Metric
from uavexp.report.comparison import Panel, estimate
from uavexp.report.derived import FALSE_TRIGGERS
from uavexp.report.figures import base
from uavexp.report.figures.base import Drawing
from uavexp.report.labels import CLEARANCE, RATE
from uavexp.report.looks import CLOCK, OTHERS, PRIMARY, Look
from uavexp.report.results import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes

METRICS = (RATE, CLEARANCE, FALSE_TRIGGERS)
_LOOKS = (PRIMARY, CLOCK, *OTHERS)
_SPREAD = 0.24  # sideways room of the lines at one level


def figure(
    results: Results, *, name: str, arm: str = "", axes: Sequence[str] = ("noise", "latency", "drift")
) -> Drawing | None:
    """Draw each metric of one arm over the first axis, a line per level of the second, a column per third."""
    mine = results.only({"arm": arm}) if arm else results
    there = [axis for axis in axes if axis in mine.arm_axes]
    if mine.trials.empty or not there:
        return None
    across, lines, columns = (*there, "", "")[:3]
    parts = [mine.only({columns: level}) for level in mine.levels(columns)] if columns else [mine]
    drawn = base.new_figure(base.PAGE_IN, 0.9 + 1.45 * len(METRICS))
    grid = drawn.subplots(len(METRICS), len(parts), sharex=True, sharey="row", squeeze=False)
    for column, part in zip(grid.T, parts, strict=True):
        _draw_column(column, part, lines, mine.levels(across))
        column[0].set_title(f"{columns}: {part.among[columns]}" if columns else "", fontsize=8)
        column[-1].set_xlabel(across)
    for row, metric in zip(grid, METRICS, strict=True):
        row[0].set_ylabel(metric.label.replace(" [", "\n["), fontsize=8)
    grid[0, 0].set_ylim(-3.0, 103.0)
    if lines:
        handles, words = grid[0, 0].get_legend_handles_labels()
        drawn.legend(handles, words, title=lines, loc="outside upper center", ncols=len(words), fontsize=8)
    caption = f"{_caption(arm, there)} {results.notes[0]}"
    return Drawing(name=name, caption=caption, figure=drawn)


def _draw_column(column: Sequence[Axes], part: Results, lines: str, across: Sequence[str]) -> None:
    named = {level: part.only({lines: level}) for level in part.levels(lines)} if lines else {"": part}
    offsets = np.linspace(-0.5, 0.5, len(named)) * _SPREAD if len(named) > 1 else np.zeros(1)
    for (line, chosen), offset, look in zip(named.items(), offsets, _LOOKS, strict=False):
        for axes, metric in zip(column, METRICS, strict=True):
            if chosen.panel.has(metric):
                _draw_line(axes, chosen.panel, metric, across, offset, look, line)
    for axes in column:
        axes.set_xticks(range(len(across)), across)
        axes.set_xlim(-0.5, len(across) - 0.5)
        base.tidy(axes)


def _draw_line(
    axes: Axes, panel: Panel, metric: Metric, across: Sequence[str], offset: float, look: Look, label: str
) -> None:
    flown = [level for level in across if level in panel.arms]
    found = [estimate(panel, metric, level) for level in flown]
    places = np.array([across.index(level) for level in flown]) + offset
    low, high = np.array([item.interval for item in found]).reshape(-1, 2).T
    axes.vlines(places, low, high, color=look.colour, lw=1.0, alpha=0.7)
    means = [item.mean for item in found]
    axes.plot(
        places, means, marker=look.marker, ms=4.5, mec="white", mew=0.5, lw=1.1, label=label, **look.line
    )


def _caption(arm: str, axes: Sequence[str]) -> str:
    who = f" of {arm}" if arm else ""
    return (
        f"Success, least clearance and false triggers{who} over {' by '.join(axes)}, with 95 % intervals "
        "(success: Wilson's with the effective number of flights in clusters; the others: scenes resampled). "
        "A false trigger is a replan for a change of the map that moved the path by less than 0.1 m, counted "
        "per minute of flight. Levels are drawn a little apart so that intervals can be told apart."
    )
