"""The first plans of all arms in one world: tree, searched paths, trajectories, speed and acceleration."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from uavexp.arrays import Float
from uavexp.log import TrialLog
from uavexp.metrics import plan
from uavexp.report import plan_view, style
from uavexp.report.figures import base
from uavexp.report.figures.base import Drawing
from uavexp.report.flights import RULE, SharedWorld, shared_worlds
from uavexp.report.looks import Look, looks_of
from uavexp.report.results import Results
from uavexp.trajectory import Trajectory, evaluate

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_PROFILES_IN, _LEGEND_IN = 1.9, 0.6
_HEIGHT_IN = (2.2, 6.0)  # least and greatest of the plan
_TREE = "#B8B8B8"
_GRID_S = 0.01


def figure(results: Results, *, name: str) -> Drawing | None:
    """Draw the plans of all arms in the first world that all left a log of; None where none did."""
    shared = next(shared_worlds(results, results.arms, results.scenes or ("",)), None)
    return None if shared is None else draw(name, shared, looks_of(results, results.arms))


def draw(name: str, shared: SharedWorld, looks: Mapping[str, Look]) -> Drawing | None:
    """Draw the plans of a world above their speed and acceleration; None when no arm has a plan."""
    plans = {arm: plan.planned(log) for arm, log in shared.logs.items()}
    there = {arm: one for arm, one in plans.items() if one is not None}
    if not there:
        return None
    view = plan_view.view_m(shared.world, *shared.logs.values())
    width_m, depth_m = view[1] - view[0]
    plan_in = min(max((base.PAGE_IN - 0.75) * depth_m / width_m, _HEIGHT_IN[0]), _HEIGHT_IN[1])
    drawn = base.new_figure(base.PAGE_IN, plan_in + _PROFILES_IN + _LEGEND_IN)
    grid = drawn.add_gridspec(2, 2, height_ratios=(plan_in, _PROFILES_IN))
    above = drawn.add_subplot(grid[0, :])
    speed, acceleration = (drawn.add_subplot(grid[1, column]) for column in (0, 1))
    plan_view.draw_truth(above, shared.world, plan_view.visited_m(shared.world, *shared.logs.values()))
    treed = _draw_tree(above, shared.logs)
    for arm, trajectory in there.items():
        _draw_plan(above, shared.logs[arm], trajectory, looks[arm])
        _draw_profile(speed, acceleration, trajectory, looks[arm])
    plan_view.draw_task(above, shared.world)
    plan_view.frame(above, view)
    limits = next(iter(shared.logs.values())).limits
    for axes, limit, label in (
        (speed, limits.max_speed_mps, "planned speed [m/s]"),
        (acceleration, limits.max_acceleration_mps2, "planned acceleration [m/s²]"),
    ):
        axes.axhline(limit, color=style.BLACK, lw=0.9, ls=(0, (4, 2)))
        axes.set(xlabel="time [s]", ylabel=label)
        axes.set_ylim(bottom=0.0)
    base.tidy(speed, acceleration)
    drawn.legend(handles=_handles(there, looks, treed), loc="outside lower center", ncols=4, fontsize=7.5)
    return Drawing(name=name, caption=_caption(shared, treed), figure=drawn)


def _draw_tree(axes: Axes, logs: Mapping[str, TrialLog]) -> str:
    """Draw the tree of the first arm that has one; returns that arm, or nothing."""
    for arm, log in logs.items():
        tree_m = log.first_plan.tree_m
        if len(tree_m):
            edges = LineCollection(list(tree_m[:, :, :2]), colors=_TREE, linewidths=0.35, zorder=2)
            axes.add_collection(edges, autolim=False)
            return arm
    return ""


def _draw_plan(axes: Axes, log: TrialLog, trajectory: Trajectory, look: Look) -> None:
    """Draw the trajectory, and the searched path as dots at its corners where there are few."""
    position_m = evaluate(trajectory, _times_s(trajectory))[0]
    axes.plot(position_m[:, 0], position_m[:, 1], lw=1.6, zorder=4, **look.line)
    path_m = log.first_plan.path_m
    axes.plot(path_m[:, 0], path_m[:, 1], color=look.colour, lw=0.6, ls=(0, (1, 1.5)), zorder=3.5)


def _draw_profile(speed: Axes, acceleration: Axes, trajectory: Trajectory, look: Look) -> None:
    times_s = _times_s(trajectory)
    _, velocity_mps, acceleration_mps2 = evaluate(trajectory, times_s)
    for axes, vectors in ((speed, velocity_mps), (acceleration, acceleration_mps2)):
        axes.plot(times_s - times_s[0], np.linalg.norm(vectors, axis=1), lw=1.1, **look.line)


def _times_s(trajectory: Trajectory) -> Float:
    count = max(int(np.ceil(trajectory.duration_s / _GRID_S)), 1) + 1
    return np.linspace(trajectory.start_s, trajectory.end_s, count)


def _handles(plans: Mapping[str, Trajectory], looks: Mapping[str, Look], treed: str) -> list[Line2D | Patch]:
    handles: list[Line2D | Patch] = [
        Line2D([], [], label=f"{arm}, {one.duration_s:.1f} s", lw=1.6, **looks[arm].line)
        for arm, one in plans.items()
    ]
    handles.append(Line2D([], [], color=base.GREY, lw=0.8, ls=(0, (1, 1.5)), label="searched paths"))
    if treed:
        handles.append(Line2D([], [], color=_TREE, lw=1.0, label=f"tree of {treed}"))
    handles.append(Line2D([], [], color=style.BLACK, lw=0.9, ls=(0, (4, 2)), label="limit"))
    return handles


def _caption(shared: SharedWorld, treed: str) -> str:
    tree = f", with the tree that {treed} ended with" if treed else ""
    return (
        f"First plans in the same world ({shared.where}; n = 1 plan each, {RULE}){tree}; below, the norms of "
        "their velocity and acceleration as planned, with the limits. Circle: start; star: target."
    )
