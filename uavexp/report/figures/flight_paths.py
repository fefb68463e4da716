"""Figures 3 and 4: where each strategy flew in one and the same world."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from uavexp.log import TrialLog
from uavexp.metrics import path, replanning
from uavexp.report import plan_view, style
from uavexp.report.figures import base
from uavexp.report.figures.base import Drawing
from uavexp.report.flights import RULE, SharedWorld, scene_at, shared_world, three_arms
from uavexp.report.looks import Look, looks_of
from uavexp.report.results import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LEGEND_IN, _AXIS_IN = 0.85, 0.75
_HEIGHT_IN = (2.4, 7.5)  # least and greatest of the plan


def figure(results: Results, *, name: str, scene: str = "first") -> Drawing | None:
    """Draw the flown paths of three arms in one plan, in the `first` scene or, if another, the `last`."""
    if scene == "last" and len(results.scenes) < 2:
        return None
    arms = three_arms(results)
    shared, looks = shared_world(results, arms, scene_at(results, scene)), looks_of(results, arms)
    view = plan_view.view_m(shared.world, *shared.logs.values())
    width_m, depth_m = view[1] - view[0]
    plan_in = min(max((base.PAGE_IN - _AXIS_IN) * depth_m / width_m, _HEIGHT_IN[0]), _HEIGHT_IN[1])
    drawn = base.new_figure(base.PAGE_IN, plan_in + _LEGEND_IN + 0.4)
    axes = drawn.add_subplot()
    plan_view.draw_truth(axes, shared.world, plan_view.visited_m(shared.world, *shared.logs.values()))
    shortest_m = shared.world.shortest_path
    axes.plot(shortest_m[:, 0], shortest_m[:, 1], color=base.GREY, lw=0.8, ls=(0, (1, 2)), zorder=3)
    for order, (arm, log) in enumerate(reversed(list(shared.logs.items()))):  # the solid line lowest
        _draw_flight(axes, log, looks[arm], order)
    plan_view.draw_task(axes, shared.world)
    plan_view.frame(axes, view)
    handles = [_handle(arm, log, looks[arm]) for arm, log in shared.logs.items()]
    drawn.legend(handles=[*handles, *_key(shared)], loc="outside lower center", ncols=2, fontsize=7.5)
    return Drawing(name=name, caption=_caption(shared), figure=drawn)


def _draw_flight(axes: Axes, log: TrialLog, look: Look, order: int) -> None:
    """Draw one flight over those of lower order, so that paths that coincide all stay visible."""
    x_m, y_m = base.thin(log.steps.position_m[:, 0], log.steps.position_m[:, 1])
    axes.plot(x_m, y_m, color="white", lw=4.0, zorder=3.5)
    axes.plot(x_m, y_m, lw=2.6 - 0.4 * order, zorder=4.0 + 0.1 * order, **look.line)
    for replan in replanning.executed(log):
        axes.plot(*replan.position_m[:2], ms=4.5, zorder=6.0 + 0.1 * order, **look.point)
    for contact in log.contacts:
        cross: dict[str, Any] = {"color": "white", "mec": look.colour, "mew": 1.3, "ms": 8.0 + 2.0 * order}
        axes.plot(*contact.position_m[:2], "X", zorder=10.0 - 0.1 * order, **cross)
    axes.plot(*log.steps.position_m[-1, :2], ms=7.0, zorder=9, **look.point)


def _handle(arm: str, log: TrialLog, look: Look) -> Line2D:
    label = (
        f"{arm}: {log.outcome}, {path.path_length_m(log):.1f} m in {path.completion_time_s(log):.1f} s, "
        f"{base.count(len(replanning.executed(log)), 'replan')}, "
        f"{base.count(len(log.contacts), 'contact')}"
    )
    return Line2D([], [], label=label, lw=1.8, marker=look.marker, ms=4.5, mec="white", mew=0.5, **look.line)


def _key(shared: SharedWorld) -> list[Line2D | Patch]:
    low_m, high_m = plan_view.band_m(shared.world)
    return [
        Line2D([], [], color=base.GREY, lw=0.8, ls=(0, (1, 2)), label="true shortest path"),
        Patch(color=style.SURFACE, label=f"true obstacles, z {low_m:.1f} to {high_m:.1f} m"),
        Line2D([], [], color="white", marker="X", ls="", mec=style.BLACK, mew=1.2, ms=7, label="contact"),
    ]


def _caption(shared: SharedWorld) -> str:
    return (
        f"Flight paths of {', '.join(shared.logs)} in the same world ({shared.where}; n = 1 flight each, "
        f"{RULE}). Circle: start; star: target; small markers: replans; large marker: where the flight "
        "ended; white cross: contact. Grey: what stands at flight height."
    )
