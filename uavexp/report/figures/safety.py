"""Figures 6 and 7: collisions and minimum clearance of every arm."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from matplotlib.lines import Line2D

from uavexp.arrays import Float, Int
from uavexp.report import shown, style
from uavexp.report.comparison import Panel, estimate
from uavexp.report.figures import canvas
from uavexp.report.figures.looks import Look
from uavexp.report.parts import Drawing
from uavexp.report.reference import Reference

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MANY = 4  # contacts; the last class is this or more
_SHADES = ("#F2F2F2", "#FFD9A0", style.ORANGE, style.VERMILLION, "#7A2E00")  # light to dark in grey, too
_MOST_SHOWN = 400  # points of an arm
_SPREAD = 0.32  # half width of a cloud of points
_BESIDE = 0.34  # from a cloud's place to its mean


def collisions(panel: Panel, reference: Reference, note: str) -> Drawing:
    """Draw the share of flights by number of contacts, and the mean with its interval."""
    figure = canvas.new_figure(canvas.PAGE_IN, 1.35 + 0.34 * len(panel.arms))
    shares, means = figure.subplots(1, 2, sharey=True, width_ratios=(1.7, 1.0))
    places = np.arange(len(panel.arms))[::-1]
    _draw_shares(shares, panel, places)
    for place, arm in zip(places, panel.arms, strict=True):
        _draw_mean(means, panel, arm, float(place), reference)
    shares.set_yticks(places, [f"{arm} (n = {panel.n(arm)})" for arm in panel.arms])
    shares.set(xlabel="flights [%]", xlim=(0.0, 100.0), ylim=(-0.6, len(panel.arms) - 0.4))
    means.set(xlabel="contacts per flight")
    means.set_xlim(left=-0.03 * means.get_xlim()[1])
    canvas.tidy(shares, means, grid="x")
    figure.legend(loc="outside upper center", ncols=_MANY + 2, handlelength=1.2, fontsize=8)
    return Drawing(name="figure_6", caption=_collisions_caption(panel, reference, note), figure=figure)


def _draw_shares(axes: Axes, panel: Panel, places: Int) -> None:
    rows = np.stack([_class_shares(panel.values(shown.CONTACTS, arm)) for arm in panel.arms])
    left = np.zeros(len(panel.arms))
    for number, shade in enumerate(_SHADES):
        label = f"≥ {number} contacts" if number == _MANY else f"{number}"
        axes.barh(places, rows[:, number], 0.62, left, color=shade, ec=canvas.GREY, lw=0.5, label=label)
        left = left + rows[:, number]


def _class_shares(contacts: Float) -> Float:
    """Percent of flights with 0, 1, ... contacts, the last class open."""
    existing = contacts[np.isfinite(contacts)].astype(np.int64)
    counts = np.bincount(np.minimum(existing, _MANY), minlength=_MANY + 1)
    return np.asarray(100.0 * counts / max(existing.size, 1))


def _draw_mean(axes: Axes, panel: Panel, arm: str, place: float, reference: Reference) -> None:
    found = estimate(panel, shown.CONTACTS, arm)
    axes.plot(found.interval, (place, place), color=style.BLACK, lw=1.4, solid_capstyle="butt")
    axes.plot(found.mean, place, "o", color=style.BLACK, ms=5, clip_on=False)
    axes.annotate(f"{found.mean:.2f}", (found.mean, place), (0, 5), textcoords="offset points", ha="center")
    if (printed := reference.get((shown.CONTACTS.column, arm))) is not None:
        axes.plot(printed.mean, place, "D", mfc="none", mec=style.BLACK, ms=6, clip_on=False)


def _collisions_caption(panel: Panel, reference: Reference, note: str) -> str:
    return (
        "Contacts with true geometry per flight. Left: share of flights by their number of contacts. Right: "
        f"mean with 95 % interval (scenes resampled).{_paper(reference, shown.CONTACTS.column)} {note}"
    )


def _paper(reference: Reference, column: str) -> str:
    return " Hollow diamonds: the paper's means." if any(name == column for name, _ in reference) else ""


def minimum_clearance(
    panel: Panel, looks: Mapping[str, Look], reference: Reference, safety_threshold_m: float, note: str
) -> Drawing:
    """Draw the least true clearance of every flight, an arm a column, with mean and interval."""
    width_in = canvas.PAGE_IN if len(panel.arms) > 3 else canvas.COLUMN_IN
    figure = canvas.new_figure(width_in, 3.2)
    axes = figure.add_subplot()
    axes.axhline(safety_threshold_m, color=style.BLACK, lw=0.8, ls=(0, (4, 2)), zorder=1)
    for place, arm in enumerate(panel.arms):
        _draw_cloud(axes, panel, arm, place, looks[arm])
        if (printed := reference.get((shown.CLEARANCE.column, arm))) is not None:
            axes.plot(place - _BESIDE, printed.mean, "D", mfc="none", mec=style.BLACK, ms=6.5, zorder=5)
    axes.set_xticks(range(len(panel.arms)), [f"{arm}\nn = {panel.n(arm)}" for arm in panel.arms])
    axes.set(ylabel="minimum clearance [m]", xlim=(-0.6, len(panel.arms) - 0.4))
    axes.set_ylim(bottom=0.0)
    canvas.tidy(axes, grid="y")
    axes.legend(handles=_clearance_key(reference, safety_threshold_m), loc="best", fontsize=canvas.SMALL_PT)
    return Drawing(
        name="figure_7", caption=_clearance_caption(panel, reference, safety_threshold_m, note), figure=figure
    )


def _draw_cloud(axes: Axes, panel: Panel, arm: str, place: float, look: Look) -> None:
    found = estimate(panel, shown.CLEARANCE, arm)
    values_m = panel.values(shown.CLEARANCE, arm)
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


def _clearance_key(reference: Reference, threshold_m: float) -> list[Line2D]:
    handles = [
        Line2D([], [], color=style.BLACK, marker="o", lw=1.4, ms=4.5, label="mean, 95 % interval"),
        Line2D(
            [], [], color=style.BLACK, lw=0.8, ls=(0, (4, 2)), label=f"safety threshold {threshold_m:g} m"
        ),
    ]
    if _paper(reference, shown.CLEARANCE.column):
        handles.append(Line2D([], [], marker="D", ls="", mfc="white", mec=style.BLACK, label="paper's mean"))
    return handles


def _clearance_caption(panel: Panel, reference: Reference, threshold_m: float, note: str) -> str:
    most = max(int(np.isfinite(panel.values(shown.CLEARANCE, arm)).sum()) for arm in panel.arms)
    thinned = f" {_MOST_SHOWN} flights of each arm are drawn, at even ranks; the mean is over all."
    return (
        "Least distance of the body's centre from a true surface during each flight, one point a flight; "
        f"black: mean with 95 % interval (scenes resampled).{_paper(reference, shown.CLEARANCE.column)} "
        f"Dashed: the safety threshold of {threshold_m:g} m.{thinned if most > _MOST_SHOWN else ''} {note}"
    )
