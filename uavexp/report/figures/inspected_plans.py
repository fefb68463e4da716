"""Inspections: the plan of one flight of the first and one of the last arm, with its cells."""

from __future__ import annotations

import math

import numpy as np

from uavexp.log import TrialLog
from uavexp.metrics import coverage
from uavexp.report import inspection_view, movers_view, plan_view
from uavexp.report.figures import base
from uavexp.report.figures.base import Drawing
from uavexp.report.flights import inspections
from uavexp.report.results import ARM, Results
from uavexp.types import World

_LEGEND_IN, _TITLE_IN, _AXIS_IN = 1.0, 0.4, 0.45


def figure(results: Results, *, name: str) -> Drawing | None:
    """Draw the flown path and the cells of one flight of the first and one of the last kind of scene.

    None where nothing was inspected.
    """
    flights = _chosen(results)
    if not flights:
        return None
    views = [plan_view.view_m(world, log) for world, log, _ in flights]
    width_m, depth_m = np.max([view[1] - view[0] for view in views], axis=0)
    plan_in = (base.PAGE_IN / len(flights) - _AXIS_IN) * depth_m / width_m
    drawn = base.new_figure(base.PAGE_IN, plan_in + _LEGEND_IN + _TITLE_IN)
    for number, (world, log, title) in enumerate(flights):
        axes = drawn.add_subplot(1, len(flights), number + 1)
        inspection_view.draw(axes, world, log, views[number])
        seen = 100.0 * coverage.coverage_visible(log)
        axes.set_title(f"{title}: {seen:.2f} % of the visible seen", fontsize=8)
        axes.tick_params(labelsize=7)
        axes.set_xlabel("x [m]", fontsize=8)
        axes.set_ylabel("" if number else "y [m]", fontsize=8)
    world, log, _ = flights[-1]
    handles = [*inspection_view.handles(world, log), *movers_view.handles(log, math.nan)]
    drawn.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=7)
    return Drawing(name=name, caption=f"{_CAPTION} {results.notes[0]}", figure=drawn)


_CAPTION = (
    "Floor plan, flown path and cells of the surface from above, one flight left and one right (the "
    "first and the last arm, lowest seed with a stored log). Counts in the legend are of the flight on the "
    "right."
)


def _chosen(results: Results) -> list[tuple[World, TrialLog, str]]:
    """Of the first and the last arm the flight with the lowest seed: its world, its log, its name."""
    study, there = results.study, inspections(results)
    arms = [arm for arm in results.arms if arm in set(there[ARM])]
    chosen = []
    for arm in dict.fromkeys([*arms[:1], *arms[-1:]]):
        row = there[there[ARM] == arm].sort_values("seed").iloc[0]
        world, log = study.world(str(row["world_digest"])), study.log(str(row["trial"]))
        chosen.append((world, log, f"{arm}, seed {row['seed']}"))
    return chosen
