"""Figure 9: when each flight replanned, and why."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import pandas as pd
from matplotlib.lines import Line2D

from uavexp import causes
from uavexp.report import replan_marks, style
from uavexp.report.comparison import SCENE
from uavexp.report.figures import base
from uavexp.report.figures.base import Drawing
from uavexp.report.flights import executed, scene_at
from uavexp.report.results import ARM, Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_ROWS = 20  # flights of an arm
_MOST_ARMS = 4


def figure(results: Results, *, name: str) -> Drawing | None:
    """Draw a row per flight of the first scene with a marker per replan; a panel per arm that replanned."""
    scene, replans = scene_at(results, "first"), results.study.replans
    if replans.empty or "completion_time_s" not in results.trials:
        return None
    flights = results.trials
    flights = flights[(flights[SCENE] == scene) & flights["completion_time_s"].notna()]
    ordered = sorted(results.arms, key=lambda arm: (arm != results.clock, arm != results.primary))
    taken = executed(replans, flights)
    taken = taken.assign(**{ARM: taken["trial"].map(flights.set_index("trial")[ARM])})
    arms = [arm for arm in ordered if (taken[ARM] == arm).any()][:_MOST_ARMS]
    if not arms:
        return None
    seeds = sorted(flights["seed"].unique())[:MOST_ROWS]
    rows = (len(arms) + 1) // 2
    drawn = base.new_figure(base.PAGE_IN, 0.75 + rows * max(1.1, 0.55 + 0.085 * len(seeds)))
    panels = drawn.subplots(rows, min(len(arms), 2), sharex=True, sharey=True, squeeze=False).flat
    for axes, arm in zip(panels, arms, strict=False):
        mine = flights[(flights[ARM] == arm) & flights["seed"].isin(seeds)]
        _draw_panel(axes, arm, mine, taken[taken["trial"].isin(mine["trial"])], seeds)
    shown = flights[flights[ARM].isin(arms) & flights["seed"].isin(seeds)]
    drawn.axes[0].set_xlim(0.0, 1.02 * float(shown["completion_time_s"].max()))
    for axes in list(drawn.axes)[len(arms) :]:
        axes.set_axis_off()
    drawn.supylabel("seed", fontsize=9)
    drawn.supxlabel("time [s]", fontsize=9)
    key = _key(_in_order(set(taken["cause"])))
    drawn.legend(handles=key, loc="outside upper center", ncols=len(key), fontsize=8)
    caption = _caption(arms, scene, [int(seed) for seed in seeds], flights)
    return Drawing(name=name, caption=caption, figure=drawn)


def _in_order(given: set[str]) -> list[str]:
    """The shipped causes as they are declared, then the others by name."""
    shipped = [cause.name for cause in (*causes.POLICY, *causes.PILOT) if cause.name in given]
    return [*shipped, *sorted(given - set(shipped))]


def _draw_panel(
    axes: Axes, arm: str, flights: pd.DataFrame, taken: pd.DataFrame, seeds: Sequence[int]
) -> None:
    row_of = {seed: row for row, seed in enumerate(seeds)}
    rows = flights["seed"].map(row_of)
    axes.hlines(rows, 0.0, flights["completion_time_s"], color=style.FAINT, lw=1.0, zorder=1)
    for won, marker, fill in ((True, "|", style.BLACK), (False, "x", style.VERMILLION)):
        chosen = flights["success"] == won
        ends_s = flights["completion_time_s"][chosen]
        axes.plot(ends_s, rows[chosen], marker, color=fill, ms=5, mew=1.3, zorder=3)
    size_pt = 4.2 if len(taken) < 25 * len(flights) else 2.4
    for cause, group in taken.groupby("cause"):
        at = group["trial"].map(flights.set_index("trial")["seed"]).map(row_of)
        axes.plot(group["time_s"], at, zorder=2, **replan_marks.marker(str(cause), size_pt) | {"mew": 0.3})
    each = len(taken) / max(len(flights), 1)
    near = f", {100.0 * taken['near_change'].astype(float).mean():.0f} % near a change" if len(taken) else ""
    axes.set_title(f"{arm}: {each:.1f} replans a flight{near}", fontsize=8, loc="left")
    every = 1 if len(seeds) <= 10 else 5
    axes.set_yticks(
        range(len(seeds)), [str(seed) if row % every == 0 else "" for row, seed in enumerate(seeds)]
    )
    axes.set_ylim(len(seeds) - 0.4, -0.6)
    base.tidy(axes, grid="x")


def _key(names: Sequence[str]) -> list[Line2D]:
    return [
        *(Line2D([], [], label=name, **replan_marks.marker(name, 5.0)) for name in names),
        Line2D([], [], color=style.BLACK, marker="|", ls="", mew=1.3, label="end: success"),
        Line2D([], [], color=style.VERMILLION, marker="x", ls="", mew=1.3, label="end: failure"),
    ]


def _caption(arms: Sequence[str], scene: str, seeds: Sequence[int], flights: pd.DataFrame) -> str:
    where = f" in the scene “{scene}”" if scene else ""
    more = flights["seed"].nunique() - len(seeds)
    return (
        f"Replans over time by cause, a row per flight: {', '.join(arms)}{where} (the experiment's first), "
        f"n = {len(seeds)} flights each, seeds {base.span(seeds)}"
        f"{f', the lowest; {more} more are not drawn' if more > 0 else ''}. Line: the flight's length. "
        "Near a change: the map was changing near the vehicle or its path when the replan was asked for."
    )
