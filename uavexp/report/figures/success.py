"""How often each arm succeeded, in each scene and over all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from uavexp.report import shown
from uavexp.report.comparison import Panel, estimate
from uavexp.report.figures import canvas
from uavexp.report.figures.looks import Look
from uavexp.report.parts import Drawing
from uavexp.report.statistics import Interval, wilson_interval

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MOST_ARMS = 6  # told apart within a scene
_SPREAD = 0.62  # of a row's height taken by its arms


def success_rates(panel: Panel, looks: Mapping[str, Look], note: str, scenes: Sequence[str] = ()) -> Drawing:
    """Draw success rates with their intervals: by scene (in the order given) and arm, or a row per arm."""
    by_scene = len(panel.scenes) > 1 and 1 < len(panel.arms) <= _MOST_ARMS
    return _by_scene(panel, looks, note, scenes) if by_scene else _by_arm(panel, looks, note)


def _by_scene(panel: Panel, looks: Mapping[str, Look], note: str, wanted: Sequence[str]) -> Drawing:
    scenes = [scene for scene in wanted if scene in panel.scenes] or list(panel.scenes)
    rows = [*scenes, "all scenes"]
    figure = canvas.new_figure(canvas.PAGE_IN, 1.0 + 0.36 * len(rows))
    axes = figure.add_subplot()
    offsets = np.linspace(-0.5, 0.5, len(panel.arms)) * _SPREAD
    for arm, offset in zip(panel.arms, offsets, strict=True):
        rates = [_rate_in(panel, arm, panel.scenes.index(scene)) for scene in scenes]
        _draw_rates(axes, [*rates, _rate_of(panel, arm)], np.arange(len(rows)) + offset, looks[arm], arm)
    axes.axhline(len(rows) - 1.5, color=canvas.GREY, lw=0.6)
    for edge in range(1, len(rows) - 1):
        axes.axhline(edge - 0.5, color="#E4E4E4", lw=0.5, zorder=0)
    _finish(axes, rows)
    figure.legend(loc="outside upper center", ncols=len(panel.arms), fontsize=8)
    return Drawing(name="success", caption=_caption(note, "by scene, and "), figure=figure)


def _by_arm(panel: Panel, looks: Mapping[str, Look], note: str) -> Drawing:
    figure = canvas.new_figure(canvas.PAGE_IN, 0.8 + 0.24 * len(panel.arms))
    axes = figure.add_subplot()
    for place, arm in enumerate(panel.arms):
        _draw_rates(axes, [_rate_of(panel, arm)], np.array([float(place)]), looks[arm], arm)
    _finish(axes, [f"{arm} (n = {panel.n(arm)})" for arm in panel.arms])
    return Drawing(name="success", caption=_caption(note, ""), figure=figure)


def _rate_in(panel: Panel, arm: str, scene: int) -> tuple[float, Interval]:
    """Percent of successes of an arm in one scene; its seeds are independent."""
    rows = (panel.scene == scene) & panel.flown[:, panel.arms.index(arm)]
    won, n = int(panel.success(arm)[rows].sum()), int(rows.sum())
    low, high = wilson_interval(won, n)
    return (100.0 * won / n if n else np.nan), Interval(100.0 * low, 100.0 * high)


def _rate_of(panel: Panel, arm: str) -> tuple[float, Interval]:
    found = estimate(panel, shown.RATE, arm)
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
    canvas.tidy(axes, grid="x")
    axes.tick_params(axis="y", length=0)


def _caption(note: str, where: str) -> str:
    return (
        f"Flights that reached their target without contact, {where}over all: Wilson's 95 % intervals, over "
        f"all made with the effective number of flights in clusters. {note}"
    )
