"""The trade-off: what success and what clearance a policy buys with its replans."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from uavexp.metrics.metric import Metric
from uavexp.report.comparison import ArmEstimate, Panel, estimate
from uavexp.report.figures import base
from uavexp.report.figures.base import Drawing
from uavexp.report.figures.label_places import Labelled, write_labels
from uavexp.report.labels import CLEARANCE, RATE, REPLANS
from uavexp.report.looks import Look, looks_of
from uavexp.report.results import ARM, Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

METRICS = (RATE, CLEARANCE, REPLANS)
SETTING = "setting"  # axis that tells the cells of one entry apart ("interval_s=2"); made by the command line
_LINEAR_BELOW = 1.0  # replans; a logarithmic axis with room for none at all


@dataclass(frozen=True, slots=True)
class Curve:
    """The arms of one policy, in the order they are joined."""

    name: str
    arms: tuple[str, ...]
    labels: tuple[str, ...]  # of the points
    parameter: str = ""  # that alone varies, so that a line through the points means something


def curves_of(results: Results) -> list[Curve]:
    """Which arms make up the curve of one policy.

    With an axis `setting` the arms that differ in nothing else, without it those of one trigger.
    Where more than one parameter varies among them without a setting, each arm stands alone.
    """
    first = results.trials.drop_duplicates(ARM).set_index(ARM).loc[list(results.arms)]
    swept = SETTING in first
    by = [axis for axis in results.arm_axes if axis != SETTING] if swept else ["trigger"]
    curves: list[Curve] = []
    for names, group in first.groupby(by, sort=False):
        name = ", ".join(map(str, names))
        curves += _curves_among(name if swept else name.upper(), group)
    return curves


def _curves_among(name: str, arms: pd.DataFrame) -> list[Curve]:
    parameters = [column for column in map(str, arms.columns) if column.startswith("p_trigger_")]
    varied = [column for column in parameters if arms[column].nunique() > 1]
    if len(varied) == 1 and arms[varied[0]].notna().all():
        ordered = arms.sort_values(varied[0])
        labels = tuple(
            f"{value:g}" if isinstance(value, float) else str(value) for value in ordered[varied[0]]
        )
        return [Curve(name, tuple(ordered.index), labels, varied[0].removeprefix("p_trigger_"))]
    if len(arms) > 1 and SETTING in arms:
        return [Curve(name, tuple(arms.index), tuple(arms[SETTING].astype(str)))]
    return [single(str(arm)) for arm in arms.index]


def single(arm: str) -> Curve:
    """An arm by itself, named in the legend."""
    return Curve(arm.rstrip(", "), (arm,), ("",))


def figure(results: Results, *, name: str, curves: bool = True) -> Drawing:
    """Draw success and clearance against replans per mission, a curve per policy or a point per arm."""
    drawn = curves_of(results) if curves else [single(arm) for arm in results.arms]
    about = "a curve per policy" if curves else "a point per policy"
    figure = _plane(results.panel, drawn, looks_of(results, [curve.name for curve in drawn]))
    varied = "; ".join(f"{curve.name}: {curve.parameter}" for curve in drawn if curve.parameter)
    points = f" Labels of the points: {varied}." if varied else ""
    caption = f"Success and least clearance against replans per mission, {about}.{points} {_CAPTION}"
    return Drawing(name=name, caption=f"{caption} {results.notes[0]}", figure=figure)


def _plane(panel: Panel, curves: Sequence[Curve], looks: Mapping[str, Look]) -> Figure:
    figure = base.new_figure(base.PAGE_IN, 3.5)
    sides = figure.subplots(1, 2)
    for axes, metric in zip(sides, (RATE, CLEARANCE), strict=True):
        for curve in curves:
            _draw_curve(axes, panel, metric, curve, looks[curve.name])
        _finish(axes, metric, panel)
    sides[0].set_ylim(_lowest_percent(panel), 102.0)
    columns = min(len(curves), 5)
    figure.legend(
        *sides[0].get_legend_handles_labels(),
        loc="outside upper center",
        ncols=columns,
        fontsize=8,
        handlelength=2.6,
    )
    figure.draw_without_rendering()  # gives the axes their place, by which labels are laid out
    for axes, metric in zip(sides, (RATE, CLEARANCE), strict=True):
        write_labels(axes, [_labelled(panel, metric, curve, looks[curve.name]) for curve in curves])
    return figure


def _labelled(panel: Panel, metric: Metric, curve: Curve, look: Look) -> Labelled:
    found = [(estimate(panel, REPLANS, arm), estimate(panel, metric, arm)) for arm in curve.arms]
    points = [(across.mean, up.mean) for across, up in found]
    lines = [line for across, up in found for line in _bars(across, up)]
    joined = list(pairwise(points)) if curve.parameter else []
    known = np.array([*lines, *joined]).reshape(-1, 2, 2)
    return Labelled(np.array(points), curve.labels, look.colour, known[np.isfinite(known).all(axis=(1, 2))])


def _bars(across: ArmEstimate, up: ArmEstimate) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """Both intervals of a point, as lines."""
    return [
        ((across.interval.low, up.mean), (across.interval.high, up.mean)),
        ((across.mean, up.interval.low), (across.mean, up.interval.high)),
    ]


_CAPTION = (
    "Bars: 95 % intervals of both means (success: Wilson's with the effective number of flights in clusters; "
    "the others: scenes resampled). Up and to the left is better. The axis of replans is logarithmic "
    "(linear below 1, if it begins there)."
)


def _draw_curve(axes: Axes, panel: Panel, metric: Metric, curve: Curve, look: Look) -> None:
    across = [estimate(panel, REPLANS, arm) for arm in curve.arms]
    up = [estimate(panel, metric, arm) for arm in curve.arms]
    x, y = np.array([item.mean for item in across]), np.array([item.mean for item in up])
    x_ends = np.array([item.interval for item in across]).T
    y_ends = np.array([item.interval for item in up]).T
    axes.vlines(x, *y_ends, color=look.colour, lw=0.8, alpha=0.55, zorder=2)
    axes.hlines(y, *x_ends, color=look.colour, lw=0.8, alpha=0.55, zorder=2)
    line = {"lw": 1.1, **look.line} if curve.parameter else {"ls": "", "color": look.colour}
    axes.plot(x, y, marker=look.marker, ms=5.5, mec="white", mew=0.5, zorder=3, label=curve.name, **line)


def _lowest_percent(panel: Panel) -> float:
    """Where the axis of success begins: just below the lowest interval."""
    lows = [estimate(panel, RATE, arm).interval.low for arm in panel.arms]
    return max(-2.0, min((low for low in lows if np.isfinite(low)), default=0.0) - 4.0)


def _finish(axes: Axes, metric: Metric, panel: Panel) -> None:
    """Scale the axis of replans to what is shown: with room for none at all only if an arm had none."""
    means = [mean for arm in panel.arms if np.isfinite(mean := estimate(panel, REPLANS, arm).mean)]
    least, most = min(means, default=0.0), 1.5 * max([*means, 1.0])
    if least < 2.0 * _LINEAR_BELOW:
        axes.set_xscale("symlog", linthresh=_LINEAR_BELOW, linscale=0.35)
        begin = -0.15
    else:
        axes.set_xscale("log")
        begin = 0.7 * least
    axes.set(xlabel="replans per mission", ylabel=metric.label)
    axes.set_xlim(begin, most)
    ticks = [tick for tick in (0, 1, 2, 5, 10, 20, 50, 100, 200, 500) if begin <= tick <= most]
    axes.set_xticks(ticks, [str(tick) for tick in ticks])
    axes.set_xticks([], minor=True)
    base.tidy(axes)
