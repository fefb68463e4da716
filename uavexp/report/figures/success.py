"""How often each arm succeeded, in each scene and over all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from uavexp.report.comparison import Panel, estimate
from uavexp.report.figures import base
from uavexp.report.figures.base import Drawing
from uavexp.report.labels import RATE
from uavexp.report.looks import Look, looks_of
from uavexp.report.results import Results
from uavexp.report.statistics import Interval, wilson_interval

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MOST_ARMS = 6  # told apart within a scene
_SPREAD = 0.62  # of a row's height taken by its arms


def figure(results: Results, *, name: str) -> Drawing:
    """Draw success rates with their intervals: by scene and arm, or a row per arm."""
    panel, looks = results.panel, looks_of(results, results.arms)
    if len(panel.scenes) > 1 and 1 < len(panel.arms) <= _MOST_ARMS:
        drawn, where = _by_scene(panel, looks, results.scenes), "by scene, and "
    else:
        drawn, where = _by_arm(panel, looks), ""
    return Drawing(name=name, caption=_caption(results.notes[0], where), figure=drawn)


def _by_scene(panel: Panel, looks: Mapping[str, Look], scenes: Sequence[str]) -> Figure:
    rows = [*scenes, "all scenes"]
    drawn = base.new_figure(base.PAGE_IN, 1.0 + 0.36 * len(rows))
    axes = drawn.add_subplot()
    offsets = np.linspace(-0.5, 0.5, len(panel.arms)) * _SPREAD
    for arm, offset in zip(panel.arms, offsets, strict=True):
        rates = [_rate_in(panel, arm, panel.scenes.index(scene)) for scene in scenes]
        _draw_rates(axes, [*rates, _rate_of(panel, arm)], np.arange(len(rows)) + offset, looks[arm], arm)
    axes.axhline(len(rows) - 1.5, color=base.GREY, lw=0.6)
    for edge in range(1, len(rows) - 1):
        axes.axhline(edge - 0.5, color="#E4E4E4", lw=0.5, zorder=0)
    _finish(axes, rows)
    drawn.legend(loc="outside upper center", ncols=len(panel.arms), fontsize=8)
    return drawn


def _by_arm(panel: Panel, looks: Mapping[str, Look]) -> Figure:
    drawn = base.new_figure(base.PAGE_IN, 0.8 + 0.24 * len(panel.arms))
    axes = drawn.add_subplot()
    for place, arm in enumerate(panel.arms):
        _draw_rates(axes, [_rate_of(panel, arm)], np.array([float(place)]), looks[arm], arm)
    _finish(axes, [f"{arm} (n = {panel.n(arm)})" for arm in panel.arms])
    return drawn


def _rate_in(panel: Panel, arm: str, scene: int) -> tuple[float, Interval]:
    """Percent of successes of an arm in one scene; its seeds are independent."""
    rows = (panel.scene == scene) & panel.flown[:, panel.arms.index(arm)]
    won, n = int(panel.success(arm)[rows].sum()), int(rows.sum())
    low, high = wilson_interval(won, n)
    return (100.0 * won / n if n else np.nan), Interval(100.0 * low, 100.0 * high)


def _rate_of(panel: Panel, arm: str) -> tuple[float, Interval]:
    found = estimate(panel, RATE, arm)
    return found.mean, found.interval


def _draw_rates(
    axes: Axes,
    rates: Sequence[tuple[float, Interval]],
    places: np.ndarray[tuple[int], np.dtype[np.float64]],
    look: Look,
    arm: str,
) -> None:
    means = np.array([mean for mean, _ in rates])
    ends = np.array([interval for _, interval in rates])
    axes.hlines(places, ends[:, 0], ends[:, 1], color=look.colour, lw=1.1, zorder=2)
    axes.plot(means, places, ms=5.0, zorder=3, label=arm, clip_on=False, **look.point)


def _finish(axes: Axes, rows: Sequence[str]) -> None:
    axes.set_yticks(range(len(rows)), rows)
    axes.set(xlabel="success [%]", xlim=(0.0, 100.0), ylim=(len(rows) - 0.5, -0.5))
    base.tidy(axes, grid="x")
    axes.tick_params(axis="y", length=0)


def _caption(note: str, where: str) -> str:
    return (
        f"Flights that reached their target without contact, {where}over all: Wilson's 95 % intervals, over "
        f"all made with the effective number of flights in clusters. {note}"
    )
