"""Success, clearance and false triggers under sensor noise, latency and drift."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from uavexp.report import shown
from uavexp.report.comparison import Metric, Panel, estimate, panel_of
from uavexp.report.figures import canvas
from uavexp.report.figures.looks import CLOCK, OTHERS, PRIMARY, Look, primary_arm
from uavexp.report.findings import arms_flown
from uavexp.report.parts import Drawing
from uavexp.report.robustness import ARM, DRIFT, FALSE_TRIGGERS, LATENCY, NOISE, with_false_triggers
from uavexp.store.study import Study

if TYPE_CHECKING:
    from matplotlib.axes import Axes

METRICS = (shown.RATE, shown.CLEARANCE, FALSE_TRIGGERS)
_LOOKS = (PRIMARY, CLOCK, *OTHERS)
_SPREAD = 0.24  # sideways room of the lines at one level


def disturbances(study: Study, note: str) -> Iterator[tuple[str, Callable[[], Drawing]]]:
    """For every arm, how to draw each metric over the first disturbance by the second and the third."""
    axes = [name for name in (NOISE, LATENCY, DRIFT) if name in study.axes]
    trials = with_false_triggers(study.trials, study.replans)
    if not axes:
        return
    if ARM not in study.axes:
        yield _name(study, ""), partial(_draw, study, trials, axes, "", note)
        return
    for arm in sorted(study.axes[ARM], key=lambda name: name != primary_arm(study)):
        mine = trials[trials[ARM].astype(str) == arm]
        if len(mine):
            yield _name(study, arm), partial(_draw, study, mine, axes, arm, note)


def _name(study: Study, arm: str) -> str:
    return "disturbances" if arm in ("", primary_arm(study)) else f"disturbances_{_slug(arm)}"


def _draw(study: Study, trials: pd.DataFrame, axes: Sequence[str], arm: str, note: str) -> Drawing:
    levels = {axis: arms_flown(trials, {axis: study.axes[axis]}) for axis in axes}
    columns = levels[axes[2]] if len(axes) > 2 else ("",)
    figure = canvas.new_figure(canvas.PAGE_IN, 0.9 + 1.45 * len(METRICS))
    grid = figure.subplots(len(METRICS), len(columns), sharex=True, sharey="row", squeeze=False)
    for column, level in zip(grid.T, columns, strict=True):
        chosen = trials[trials[axes[2]].astype(str) == level] if level else trials
        _draw_column(column, chosen, axes[:2], levels)
        column[0].set_title(f"{axes[2]}: {level}" if level else "", fontsize=8)
        column[-1].set_xlabel(axes[0])
    for row, metric in zip(grid, METRICS, strict=True):
        row[0].set_ylabel(metric.label.replace(" [", "\n["), fontsize=8)
    grid[0, 0].set_ylim(-3.0, 103.0)
    if len(axes) > 1:
        handles, labels = grid[0, 0].get_legend_handles_labels()
        figure.legend(
            handles, labels, title=axes[1], loc="outside upper center", ncols=len(labels), fontsize=8
        )
    return Drawing(name=_name(study, arm), caption=f"{_caption(arm, axes)} {note}", figure=figure)


def _slug(arm: str) -> str:
    return re.sub(r"[^a-z0-9]+", "_", arm.lower()).strip("_")


def _draw_column(
    column: Iterable[Axes], trials: pd.DataFrame, axes: Sequence[str], levels: dict[str, tuple[str, ...]]
) -> None:
    column = list(column)
    across = levels[axes[0]]
    lines = levels[axes[1]] if len(axes) > 1 else ("",)
    offsets = np.linspace(-0.5, 0.5, len(lines)) * _SPREAD if len(lines) > 1 else np.zeros(1)
    for line, offset, look in zip(lines, offsets, _LOOKS, strict=False):
        chosen = trials[trials[axes[1]].astype(str) == line] if line else trials
        panel = panel_of(chosen, (axes[0],), arms_flown(chosen, {axes[0]: across}), METRICS)
        for item, metric in zip(column, METRICS, strict=True):
            if panel.has(metric):
                _draw_line(item, panel, metric, across, offset, look, line)
    for item in column:
        item.set_xticks(range(len(across)), across)
        item.set_xlim(-0.5, len(across) - 0.5)
        canvas.tidy(item)


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
