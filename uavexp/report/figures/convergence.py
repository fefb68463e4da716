"""How the cost of anytime planners falls: over iterations, and over the time these took."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from uavexp.report.comparison import arm_names
from uavexp.report.figures import canvas
from uavexp.report.figures.looks import Look
from uavexp.report.findings import arm_axes
from uavexp.report.parts import Drawing
from uavexp.study import Study
from uavexp.types import Float

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COST = "plan_cost_at_"  # column: cost of the best plan after so many iterations
_SEARCH, _ITERATIONS = "wall_search_sum_s", "plan_iterations"


def convergence(study: Study, arms: tuple[str, ...], looks: Mapping[str, Look], note: str) -> Drawing | None:
    """Draw median and quartiles of cost over cost found in the end by any arm, over iterations and time.

    None where the trials have no history of cost.
    """
    names = [str(name) for name in study.trials.columns if str(name).startswith(COST)]
    columns = sorted(names, key=lambda name: int(name[len(COST) :]))
    if not columns:
        return None
    trials = study.trials.assign(_arm=arm_names(study.trials, tuple(arm_axes(study))))
    best = trials.groupby([*_world(trials)])[columns].min().min(axis=1).rename("_best")
    trials = trials.join(best, on=_world(trials))
    figure = canvas.new_figure(canvas.PAGE_IN, 2.9)
    by_iteration, by_time = figure.subplots(1, 2, sharey=True)
    iterations = np.array([float(column[len(COST) :]) for column in columns])
    for arm in arms:
        flown = trials[trials["_arm"] == arm]
        share = flown[columns].to_numpy(dtype=float) / flown["_best"].to_numpy(dtype=float)[:, None]
        if not np.isfinite(share).any():
            continue
        _draw(by_iteration, iterations, share, looks[arm], arm)
        per_iteration_s = _seconds_per_iteration(flown)
        if np.isfinite(per_iteration_s):
            _draw(by_time, 1e3 * per_iteration_s * iterations, share, looks[arm], "")
    for axes, label in ((by_iteration, "iterations"), (by_time, "search time [ms]")):
        axes.set(xscale="log", xlabel=label)
    by_iteration.set_ylabel("cost over the best found by any")
    canvas.tidy(by_iteration, by_time)
    figure.legend(loc="outside upper center", ncols=4, fontsize=7.5)
    return Drawing(name="convergence", caption=f"{_CAPTION} {note}", figure=figure)


_CAPTION = (
    "Cost of the best plan so far over the best that any arm found in that world: median and quartiles, from "
    "where half of the trials have a plan. Left over iterations (each planner's own unit), right over time: "
    "iterations times the arm's median time of one, on the machine named in run.json."
)


def _world(trials: pd.DataFrame) -> list[str]:
    return [name for name in ("scene", "seed") if name in trials]


def _seconds_per_iteration(flown: pd.DataFrame) -> float:
    if not {_SEARCH, _ITERATIONS} <= set(flown):
        return float("nan")
    ratio = flown[_SEARCH].astype(float) / flown[_ITERATIONS].astype(float).where(lambda n: n > 0)
    return float(ratio.median())


def _draw(axes: Axes, x: Float, share: Float, look: Look, label: str) -> None:
    known = np.isfinite(share).mean(axis=0) >= 0.5
    if not known.any():
        return
    low, middle, high = np.nanpercentile(share[:, known], (25.0, 50.0, 75.0), axis=0)
    axes.fill_between(x[known], low, high, color=look.colour, alpha=0.18, lw=0)
    axes.plot(x[known], middle, label=label or None, **look.line)
