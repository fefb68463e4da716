"""Figure 10: what fired each replan of a flight: the changed voxels or the goal, and both plans."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.lines import Line2D

from uavexp.arrays import Float
from uavexp.errors import RecordError
from uavexp.log import Replan, TrialLog
from uavexp.metrics import replanning
from uavexp.report import plan_view, replan_marks, style
from uavexp.report.figures import base
from uavexp.report.figures.base import Drawing
from uavexp.report.flights import SharedWorld, shared_worlds
from uavexp.report.replan_marks import draw_replans
from uavexp.report.results import Results
from uavexp.types import World

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLUMNS, _ROWS = 3, 2  # of close-ups
_REACH_M = 3.4  # half the edge of a close-up
_MOST_SCORE = 4.0  # the axis is cut here


def is_fired_by_map(log: TrialLog) -> bool:
    """Whether a change of the map fired a replan that took effect."""
    return any(len(replan.changed_m) for replan in replanning.executed(log))


def figure(results: Results, *, name: str) -> Drawing:
    """Draw a close-up of each of a flight's first replans, and the event's score over time.

    Raises:
        RecordError: no stored flight of the primary arm has a replan fired by a change of the map.
    """
    arm = results.primary
    for shared in shared_worlds(results, [arm], results.scenes or ("",)):
        if is_fired_by_map(shared.logs[arm]):
            return _draw(name, arm, shared)
    raise RecordError(f"no stored flight of {arm} has a replan fired by a change of the map")


def _draw(name: str, arm: str, shared: SharedWorld) -> Drawing:
    log = shared.logs[arm]
    shown = replanning.executed(log)[: _COLUMNS * _ROWS]
    rows = -(-len(shown) // _COLUMNS)
    drawn = base.new_figure(base.PAGE_IN, 2.0 + 2.65 * rows)
    names = [[f"{row} {column}" for column in range(_COLUMNS)] for row in range(rows)]
    parts: dict[str, Axes] = drawn.subplot_mosaic(
        [*names, ["score"] * _COLUMNS], height_ratios=[2.5] * rows + [1.0]
    )
    score = parts.pop("score")
    for axes in parts.values():
        axes.set_axis_off()
    for number, (axes, replan) in enumerate(zip(parts.values(), shown, strict=False)):
        axes.set_axis_on()
        _draw_close_up(axes, shared.world, log, replan, _letter(number))
        axes.set_xlabel("x [m]")
        axes.set_ylabel("y [m]" if number % _COLUMNS == 0 else "")
    _draw_score(score, log, shown)
    drawn.legend(handles=_key(), loc="outside upper center", ncols=7, fontsize=7, columnspacing=1.0)
    return Drawing(name=name, caption=_caption(arm, shared, len(shown)), figure=drawn)


def _draw_close_up(axes: Axes, world: World, log: TrialLog, replan: Replan, letter: str) -> None:
    changed_m = replan.changed_m.astype(np.float64)
    plan_view.draw_truth(axes, world, plan_view.visited_m(world, log))
    axes.plot(changed_m[:, 0], changed_m[:, 1], "s", color=style.ORANGE, ms=1.6, mew=0, zorder=3)
    flown_m = log.steps.position_m[log.steps.time_s <= replan.time_s]
    axes.plot(flown_m[:, 0], flown_m[:, 1], color=style.BLACK, lw=1.6, zorder=4)
    new_m, old_m = replan.trajectory_m, _old_plan_m(log, replan)
    axes.plot(new_m[:, 0], new_m[:, 1], color=style.BLUE, lw=2.2, zorder=4.5)
    axes.plot(old_m[:, 0], old_m[:, 1], color=style.VERMILLION, lw=1.5, ls=(0, (3, 1.5)), zorder=5)
    axes.plot(*replan.goal_m[:2], "o", mfc="white", mec=style.BLUE, mew=1.3, ms=5, zorder=6)
    axes.plot(*replan.position_m[:2], zorder=7, **replan_marks.marker(replan.cause, 8.0))
    centre_m = _centre_m(replan)
    plan_view.frame(axes, np.stack([centre_m - _REACH_M, centre_m + _REACH_M]))
    what = f", {base.count(len(changed_m), 'voxel')}" if len(changed_m) else ""
    title = f"{letter}: {replan.cause}{what}, {replan.time_s:.1f} s\n{_departure(replan)}"
    axes.set_title(title, fontsize=7.5, loc="left")


def _departure(replan: Replan) -> str:
    known = np.isfinite(replan.path_change_m)
    return f"path moved by {replan.path_change_m:.2f} m" if known else "no path before"


def _centre_m(replan: Replan) -> Float:
    """Middle of the vehicle and of what the replan is about."""
    about_m = replan.changed_m if len(replan.changed_m) else replan.trajectory_m
    if not len(about_m):
        return np.asarray(replan.position_m[:2])
    return np.asarray(0.5 * (replan.position_m[:2] + np.median(about_m[:, :2], axis=0)))


def _old_plan_m(log: TrialLog, replan: Replan) -> Float:
    """Samples (P, 3) of what was left of the plan flown until this replan."""
    before = [
        item for item in log.replans if item.effective_s < replan.effective_s and len(item.trajectory_m)
    ]
    if not before:
        return np.zeros((0, 3))
    plan_m = before[-1].trajectory_m.astype(np.float64)
    nearest = int(np.argmin(np.linalg.norm(plan_m - replan.position_m, axis=1)))
    return plan_m[nearest:]


def _draw_score(axes: Axes, log: TrialLog, shown: Sequence[Replan]) -> None:
    axes.plot(log.ticks.tick_s, log.ticks.decision_score, color=style.BLACK, lw=0.9, drawstyle="steps-post")
    axes.axhline(1.0, color=style.BLACK, lw=0.8, ls=(0, (4, 2)))
    draw_replans(axes, log, 5.5)
    above: dict[str, Any] = {"textcoords": "offset points", "ha": "center", "fontsize": 8}
    for number, replan in enumerate(shown):
        axes.annotate(
            _letter(number), (replan.time_s, 1.0), (0, 5), xycoords=axes.get_xaxis_transform(), **above
        )
    axes.set(xlabel="time [s]", ylabel="event over\nthreshold", xlim=(0.0, float(log.steps.time_s[-1])))
    axes.set_ylim(0.0, _MOST_SCORE)
    base.tidy(axes)


def _letter(number: int) -> str:
    return "abcdefgh"[number]


def _key() -> list[Line2D]:
    return [
        Line2D([], [], color=style.ORANGE, marker="s", ls="", ms=4, mew=0, label="changed voxels"),
        Line2D([], [], color=style.BLACK, lw=1.6, label="flown"),
        Line2D([], [], color=style.VERMILLION, lw=1.5, ls=(0, (3, 1.5)), label="old plan"),
        Line2D([], [], color=style.BLUE, lw=2.2, label="new plan"),
        Line2D([], [], color="white", marker="o", ls="", mec=style.BLUE, mew=1.3, ms=5, label="new goal"),
        Line2D([], [], label="map event", **replan_marks.marker("map", 6.0)),
        Line2D([], [], label="goal event", **replan_marks.marker("goal", 6.0)),
    ]


def _caption(arm: str, shared: SharedWorld, shown: int) -> str:
    return (
        f"What fired the first {shown} replans of {arm}, {shared.where} (n = 1 flight: the first scene and "
        "lowest seed with a stored log in which a change of the map fired a replan). Plans in m, seen from "
        "above; grey: true obstacles at flight height; voxels: those whose change fired the replan, at any "
        "height. Below: size of the largest event over its threshold at each map update (axis cut at "
        f"{_MOST_SCORE:g}). A replan needs 1 or more (dashed); a policy may ask for more, MCR also that the "
        "clearance left is below a limit."
    )
