"""Arms side by side: a small panel per metric, a row per arm, the paper's number beside."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

from uavexp.metrics.metric import Metric
from uavexp.report.figures import base
from uavexp.report.figures.base import Drawing
from uavexp.report.looks import looks_of
from uavexp.report.results import Results

if TYPE_CHECKING:
    pass

_ACROSS = 4  # panels in a row
_LABEL = 22  # characters in a line below a panel


def figure(results: Results, *, name: str, metrics: Sequence[Metric]) -> Drawing:
    """Draw mean and interval of every metric and arm; a hollow diamond is the paper's number."""
    panel, looks = results.panel, looks_of(results, results.arms)
    there = [metric for metric in metrics if panel.has(metric)]
    across = min(_ACROSS, len(there))
    down = math.ceil(len(there) / across)
    drawn = base.new_figure(base.PAGE_IN, down * (0.85 + 0.22 * len(panel.arms)))
    grid = drawn.subplots(down, across, sharey=True, squeeze=False).ravel()
    for axes, metric in zip(grid, there, strict=False):
        for place, arm in enumerate(panel.arms):
            base.draw_estimate(axes, panel, metric, arm, ms=5.0, **looks[arm].point)
            printed = results.printed.get((metric.column, arm))
            if printed is not None:
                axes.plot(printed.mean, place, "D", mfc="none", mec=base.GREY, ms=6, mew=0.9, zorder=1)
        axes.set_xlabel(textwrap.fill(metric.label, _LABEL), fontsize=7.5)
        axes.margins(x=0.12)
    for axes in grid[len(there) :]:
        axes.remove()
    for axes in grid[: len(there)]:
        axes.set_yticks(range(len(panel.arms)), panel.arms)
        axes.set_ylim(len(panel.arms) - 0.5, -0.5)
        axes.tick_params(labelsize=7.5)
    base.tidy(*grid[: len(there)], grid="x")
    return Drawing(name=name, caption=f"{_CAPTION} {results.notes[0]}", figure=drawn)


_CAPTION = (
    "Mean of each metric with its 95 % interval, a row per arm; a number at a dot: trials with a value, "
    "where fewer than all. Hollow diamonds: what the paper prints."
)
