"""Inspections: the plan of one flight per kind of scene with its cells, and coverage over time per arm."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pandas as pd

from uavexp.arrays import Float
from uavexp.log import TrialLog
from uavexp.metrics import coverage
from uavexp.report import inspection_view, movers_view, plan_view
from uavexp.report.figures import canvas, flown
from uavexp.report.figures.looks import Look
from uavexp.report.parts import Drawing
from uavexp.store.study import Study
from uavexp.types import World

KIND = "scene_kind"  # column: what the reference does not show
_LEGEND_IN, _TITLE_IN, _AXIS_IN = 1.0, 0.4, 0.45
_TIMES = 300  # at which coverage is drawn


def plans(study: Study, note: str) -> Drawing | None:
    """Draw the flown path and the cells of one flight of the first and one of the last kind of scene.

    None where nothing was inspected.
    """
    flights = _chosen(study)
    if not flights:
        return None
    views = [plan_view.view_m(world, log) for world, log, _ in flights]
    width_m, depth_m = np.max([view[1] - view[0] for view in views], axis=0)
    plan_in = (canvas.PAGE_IN / len(flights) - _AXIS_IN) * depth_m / width_m
    figure = canvas.new_figure(canvas.PAGE_IN, plan_in + _LEGEND_IN + _TITLE_IN)
    for number, (world, log, name) in enumerate(flights):
        axes = figure.add_subplot(1, len(flights), number + 1)
        inspection_view.draw(axes, world, log, views[number])
        seen = 100.0 * coverage.coverage_visible(log)
        axes.set_title(f"{name}: {seen:.2f} % of the visible seen", fontsize=8)
        axes.tick_params(labelsize=7)
        axes.set_xlabel("x [m]", fontsize=8)
        axes.set_ylabel("" if number else "y [m]", fontsize=8)
    world, log, _ = flights[-1]
    handles = [*inspection_view.handles(world, log), *movers_view.handles(log, math.nan)]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=7)
    return Drawing(name="plans", caption=f"{_PLANS} {note}", figure=figure)


_PLANS = (
    "Floor plan, flown path and cells of the surface from above, one flight left and one right (the "
    "first and the last arm, lowest seed with a stored log). Counts in the legend are of the flight on the "
    "right."
)


def over_time(study: Study, arms: tuple[str, ...], looks: Mapping[str, Look], note: str) -> Drawing | None:
    """Draw median and quartiles of the coverage of visible cells over time, per arm; None without any."""
    flights = _inspections(study)
    if not len(flights):
        return None
    curves = {
        arm: [study.log(name) for name in flights.loc[flights[flown.ARM] == arm, "trial"]] for arm in arms
    }
    last_s = max(log.steps.time_s[-1] for logs in curves.values() for log in logs)
    times_s = np.linspace(0.0, last_s, _TIMES)
    figure = canvas.new_figure(canvas.PAGE_IN, 2.9)
    axes = figure.add_subplot()
    for arm, logs in curves.items():
        if logs:
            low, middle, high = _quartiles(np.array([coverage.over_time(log, times_s) for log in logs]))
            axes.fill_between(times_s, low, high, color=looks[arm].colour, alpha=0.18, lw=0)
            axes.plot(times_s, middle, label=f"{arm} ({len(logs)})", **looks[arm].line)
    axes.set(xlabel="time [s]", ylabel="visible cells seen [%]", xlim=(0.0, last_s), ylim=(0.0, 103.0))
    canvas.tidy(axes)
    figure.legend(loc="outside upper center", ncols=3, fontsize=7.5)
    return Drawing(name="coverage_over_time", caption=f"{_OVER_TIME} {note}", figure=figure)


_OVER_TIME = (
    "Share of the visible cells seen over time: median and quartiles over the flights with a stored log "
    "(their number in brackets); a flight that has ended keeps its share."
)


def _quartiles(shares: Float) -> Float:
    return np.asarray(100.0 * np.percentile(shares, (25.0, 50.0, 75.0), axis=0))


def _inspections(study: Study) -> pd.DataFrame:
    """The stored flights that had a surface to see."""
    if KIND not in study.trials:
        return study.trials.iloc[:0]
    there = flown.stored(study, flown.flights_of(study))
    return there[there[KIND].fillna("").astype(str) != ""]


def _chosen(study: Study) -> list[tuple[World, TrialLog, str]]:
    """Of the first and the last arm the flight with the lowest seed: its world, its log, its name."""
    there = _inspections(study)
    arms = [arm for arm in flown.arms_of(study) if arm in set(there[flown.ARM])] if len(there) else []
    chosen = []
    for arm in dict.fromkeys([*arms[:1], *arms[-1:]]):
        row = there[there[flown.ARM] == arm].sort_values("seed").iloc[0]
        world, log = study.world(str(row["world_digest"])), study.log(str(row["trial"]))
        chosen.append((world, log, f"{arm}, seed {row['seed']}"))
    return chosen
