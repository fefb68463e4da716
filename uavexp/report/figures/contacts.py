"""Contacts with true geometry per flight of every arm."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from uavexp.arrays import Float, Int
from uavexp.report import style
from uavexp.report.comparison import Panel, estimate
from uavexp.report.figures import base
from uavexp.report.figures.base import Drawing
from uavexp.report.labels import CONTACTS
from uavexp.report.printed import Reference
from uavexp.report.results import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes

METRICS = (CONTACTS,)
_MANY = 4  # contacts; the last class is this or more
_SHADES = ("#F2F2F2", "#FFD9A0", style.ORANGE, style.VERMILLION, "#7A2E00")  # light to dark in grey, too


def figure(results: Results, *, name: str) -> Drawing | None:
    """Draw the share of flights by number of contacts, and the mean with its interval."""
    panel, reference = results.panel, results.printed
    if not panel.has(CONTACTS):
        return None
    drawn = base.new_figure(base.PAGE_IN, 1.35 + 0.34 * len(panel.arms))
    shares, means = drawn.subplots(1, 2, sharey=True, width_ratios=(1.7, 1.0))
    places = np.arange(len(panel.arms))[::-1]
    _draw_shares(shares, panel, places)
    for place, arm in zip(places, panel.arms, strict=True):
        _draw_mean(means, panel, arm, float(place), reference)
    shares.set_yticks(places, [f"{arm} (n = {panel.n(arm)})" for arm in panel.arms])
    shares.set(xlabel="flights [%]", xlim=(0.0, 100.0), ylim=(-0.6, len(panel.arms) - 0.4))
    means.set(xlabel="contacts per flight")
    means.set_xlim(left=-0.03 * means.get_xlim()[1])
    base.tidy(shares, means, grid="x")
    drawn.legend(loc="outside upper center", ncols=_MANY + 2, handlelength=1.2, fontsize=8)
    return Drawing(
        name=name, caption=_CAPTION + base.paper(reference, CONTACTS) + f" {results.notes[0]}", figure=drawn
    )


def _draw_shares(axes: Axes, panel: Panel, places: Int) -> None:
    rows = np.stack([_class_shares(panel.values(CONTACTS, arm)) for arm in panel.arms])
    left = np.zeros(len(panel.arms))
    for number, shade in enumerate(_SHADES):
        label = f"≥ {number} contacts" if number == _MANY else f"{number}"
        axes.barh(places, rows[:, number], 0.62, left, color=shade, ec=base.GREY, lw=0.5, label=label)
        left = left + rows[:, number]


def _class_shares(contacts: Float) -> Float:
    """Percent of flights with 0, 1, ... contacts, the last class open."""
    existing = contacts[np.isfinite(contacts)].astype(np.int64)
    counts = np.bincount(np.minimum(existing, _MANY), minlength=_MANY + 1)
    return np.asarray(100.0 * counts / max(existing.size, 1))


def _draw_mean(axes: Axes, panel: Panel, arm: str, place: float, reference: Reference) -> None:
    found = estimate(panel, CONTACTS, arm)
    axes.plot(found.interval, (place, place), color=style.BLACK, lw=1.4, solid_capstyle="butt")
    axes.plot(found.mean, place, "o", color=style.BLACK, ms=5, clip_on=False)
    axes.annotate(f"{found.mean:.2f}", (found.mean, place), (0, 5), textcoords="offset points", ha="center")
    if (printed := reference.get((CONTACTS.column, arm))) is not None:
        axes.plot(printed.mean, place, "D", mfc="none", mec=style.BLACK, ms=6, clip_on=False)


_CAPTION = (
    "Contacts with true geometry per flight. Left: share of flights by their number of contacts. Right: "
    "mean with 95 % interval (scenes resampled)."
)
