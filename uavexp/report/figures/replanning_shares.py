"""Policies side by side: how often and why they replanned, whether it was worth it, how late they were."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from uavexp.causes import cause_named
from uavexp.metrics.evaluate import metric_of
from uavexp.metrics.metric import Metric
from uavexp.metrics.replanning import cause_of
from uavexp.report import style
from uavexp.report.comparison import Panel, estimate
from uavexp.report.derived import WASTED
from uavexp.report.figures import base
from uavexp.report.figures.base import Drawing
from uavexp.report.labels import BLOCKED_DELAY, CAUSE_METRICS, REPLANS
from uavexp.report.results import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WORTH = (metric_of("useful_replans"), WASTED)
METRICS = (*CAUSE_METRICS, *WORTH, REPLANS, BLOCKED_DELAY)

Fill = tuple[str, str]  # colour, hatch
_HATCHES = ("", "////", "....", "\\\\\\\\", "xxxx", "----", "++++", "oooo", "||||")
_WORTH_FILLS: dict[str, Fill] = {WORTH[0].column: (style.BLUE, ""), WORTH[1].column: ("#E4E4E4", "////")}


def figure(results: Results, *, name: str) -> Drawing:
    """Draw replans, the shares of their causes and of useful ones, and the delay, a row per policy."""
    panel, occurring = results.panel, results.occurring(CAUSE_METRICS)
    drawn = base.new_figure(base.PAGE_IN, 1.55 + 0.27 * len(panel.arms))
    parts = drawn.subplots(1, 4, sharey=True, width_ratios=(1.0, 1.5, 0.9, 0.9))
    often, causes, worth, delay = parts
    _draw_estimates(often, panel, REPLANS)
    _draw_shares(causes, panel, occurring, _cause_fills(occurring))
    _draw_shares(worth, panel, WORTH, _WORTH_FILLS)
    _draw_estimates(delay, panel, BLOCKED_DELAY)
    often.set_xscale("symlog", linthresh=1.0, linscale=0.35)
    often.set_xticks([0, 1, 10, 100], ["0", "1", "10", "100"])
    often.set_yticks(range(len(panel.arms)), panel.arms)
    often.set_ylim(len(panel.arms) - 0.5, -0.5)
    labels = ("replans per mission", "their causes [%]", "worth it [%]", "blocked path\nto request [s]")
    for axes, label in zip(parts, labels, strict=True):
        axes.set_xlabel(label, fontsize=8)
    base.tidy(*parts, grid="x")
    handles, names = (ours + theirs for ours, theirs in zip(*map(_legend_of, (causes, worth)), strict=True))
    drawn.legend(handles, names, loc="outside lower center", ncols=6, fontsize=7.5)
    return Drawing(name=name, caption=f"{_CAPTION} {results.notes[0]}", figure=drawn)


_CAPTION = (
    "Mean replans per mission of each policy; shares of their causes; share of useful ones, whose new path "
    "departs from the old by more than 0.1 m, the others wasted; and the mean delay from the first update of "
    "the map on which the path flown was blocked to the next request, over the answered ones. Dots: means "
    "with 95 % intervals (scenes resampled); number at a dot: flights with a value, where fewer than all."
)


def _cause_fills(metrics: Sequence[Metric]) -> dict[str, Fill]:
    """Of any number of causes: the hatches come again, with another colour."""
    hatched = dict(zip(dict.fromkeys((*CAUSE_METRICS, *metrics)), cycle(_HATCHES), strict=False))
    return {
        metric.column: (cause_named(cause_of(metric) or "").colour, hatched[metric]) for metric in metrics
    }


def _legend_of(axes: Axes) -> tuple[list[object], list[str]]:
    handles, names = axes.get_legend_handles_labels()
    return list(handles), list(names)


def _draw_shares(axes: Axes, panel: Panel, metrics: Sequence[Metric], fills: Mapping[str, Fill]) -> None:
    """Stack the metrics' means as percent of their sum; a policy without a replan stays empty."""
    means = np.array([[estimate(panel, metric, arm).mean for arm in panel.arms] for metric in metrics])
    means = np.nan_to_num(means)
    shares = 100.0 * means / np.maximum(means.sum(axis=0), 1e-9)
    left = np.zeros(len(panel.arms))
    for metric, width in zip(metrics, shares, strict=True):
        colour, hatch = fills[metric.column]
        name = metric.column.removeprefix("replans_").removesuffix("_replans")
        edge: dict[str, Any] = {"hatch": hatch, "ec": "#404040", "lw": 0.4, "hatch_linewidth": 0.5}
        axes.barh(range(len(panel.arms)), width, 0.66, left, label=name, color=colour, **edge)
        left = left + width
    axes.set_xlim(0.0, 100.0)


def _draw_estimates(axes: Axes, panel: Panel, metric: Metric) -> None:
    for arm in panel.arms if panel.has(metric) else ():
        base.draw_estimate(axes, panel, metric, arm, marker="o", color=style.BLACK, ms=4.5)
    axes.set_xlim(left=0.0)
