"""Minimum clearance of every flight of every arm."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from matplotlib.lines import Line2D

from uavexp.arrays import Float
from uavexp.report import style
from uavexp.report.comparison import Panel, estimate
from uavexp.report.figures import base
from uavexp.report.figures.base import Drawing
from uavexp.report.flights import safety_threshold_m
from uavexp.report.labels import CLEARANCE
from uavexp.report.looks import Look, looks_of
from uavexp.report.printed import Reference
from uavexp.report.results import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes

METRICS = (CLEARANCE,)
_MOST_SHOWN = 400  # points of an arm
_SPREAD = 0.32  # half width of a cloud of points
_BESIDE = 0.34  # from a cloud's place to its mean


def figure(results: Results, *, name: str) -> Drawing | None:
    """Draw the least true clearance of every flight, an arm a column, with mean and interval."""
    panel, reference = results.panel, results.printed
    if not panel.has(CLEARANCE):
        return None
    looks, threshold_m = looks_of(results, panel.arms), safety_threshold_m(results)
    width_in = base.PAGE_IN if len(panel.arms) > 3 else base.COLUMN_IN
    drawn = base.new_figure(width_in, 3.2)
    axes = drawn.add_subplot()
    axes.axhline(threshold_m, color=style.BLACK, lw=0.8, ls=(0, (4, 2)), zorder=1)
    for place, arm in enumerate(panel.arms):
        _draw_cloud(axes, panel, arm, place, looks[arm])
        if (printed := reference.get((CLEARANCE.column, arm))) is not None:
            axes.plot(place - _BESIDE, printed.mean, "D", mfc="none", mec=style.BLACK, ms=6.5, zorder=5)
    axes.set_xticks(range(len(panel.arms)), [f"{arm}\nn = {panel.n(arm)}" for arm in panel.arms])
    axes.set(ylabel="minimum clearance [m]", xlim=(-0.6, len(panel.arms) - 0.4))
    axes.set_ylim(bottom=0.0)
    base.tidy(axes, grid="y")
    axes.legend(handles=_key(reference, threshold_m), loc="best", fontsize=base.SMALL_PT)
    return Drawing(name=name, caption=_caption(results, threshold_m), figure=drawn)


def _draw_cloud(axes: Axes, panel: Panel, arm: str, place: float, look: Look) -> None:
    found = estimate(panel, CLEARANCE, arm)
    values_m = panel.values(CLEARANCE, arm)
    values_m = evenly(np.sort(values_m[np.isfinite(values_m)]))
    offsets = _SPREAD * crowding(values_m)
    axes.plot(
        place + 0.08 + offsets, values_m, look.marker, color=look.colour, ms=3.4, mew=0, alpha=0.6, zorder=2
    )
    axes.errorbar(
        place - _BESIDE,
        found.mean,
        [[found.mean - found.interval.low], [found.interval.high - found.mean]],
        fmt="o",
        ms=4.5,
        color=style.BLACK,
        elinewidth=1.4,
        capsize=2.5,
        zorder=4,
    )


def evenly(ordered: Float) -> Float:
    """At most so many of the sorted values as can be told apart, at even ranks."""
    if ordered.size <= _MOST_SHOWN:
        return ordered
    return ordered[np.linspace(0, ordered.size - 1, _MOST_SHOWN).round().astype(np.int64)]


def crowding(ordered: Float, bins: int = 30) -> Float:
    """Sideways places in [-1, 1] of sorted values, wide where many are alike; nothing is random."""
    if ordered.size < 2 or ordered[0] == ordered[-1]:
        return (
            np.asarray(np.linspace(-1.0, 1.0, ordered.size)) if ordered.size > 1 else np.zeros(ordered.size)
        )
    group = np.minimum(
        ((ordered - ordered[0]) / (ordered[-1] - ordered[0]) * bins).astype(np.int64), bins - 1
    )
    sizes = np.bincount(group, minlength=bins)
    rank = pd.Series(group).groupby(group).cumcount().to_numpy()
    side = np.where(rank % 2 == 0, 1.0, -1.0)
    return np.asarray(side * ((rank + 1) // 2) * 2.0 / max(float(sizes.max()), 8.0))


def _key(reference: Reference, threshold_m: float) -> list[Line2D]:
    handles = [
        Line2D([], [], color=style.BLACK, marker="o", lw=1.4, ms=4.5, label="mean, 95 % interval"),
        Line2D(
            [], [], color=style.BLACK, lw=0.8, ls=(0, (4, 2)), label=f"safety threshold {threshold_m:g} m"
        ),
    ]
    if base.paper(reference, CLEARANCE):
        handles.append(Line2D([], [], marker="D", ls="", mfc="white", mec=style.BLACK, label="paper's mean"))
    return handles


def _caption(results: Results, threshold_m: float) -> str:
    panel = results.panel
    most = max(int(np.isfinite(panel.values(CLEARANCE, arm)).sum()) for arm in panel.arms)
    thinned = f" {_MOST_SHOWN} flights of each arm are drawn, at even ranks; the mean is over all."
    return (
        "Least distance of the body's centre from a true surface during each flight, one point a flight; "
        f"black: mean with 95 % interval (scenes resampled).{base.paper(results.printed, CLEARANCE)} "
        f"Dashed: the safety threshold of {threshold_m:g} m.{thinned if most > _MOST_SHOWN else ''} "
        f"{results.notes[0]}"
    )
