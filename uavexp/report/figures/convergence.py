"""How the cost of anytime planners falls: over iterations, and over the time these took."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from uavexp.arrays import Float
from uavexp.report.comparison import SCENE
from uavexp.report.figures import base
from uavexp.report.figures.base import Drawing
from uavexp.report.looks import Look, looks_of
from uavexp.report.results import ARM, Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COST = "plan_cost_at_"  # column: cost of the best plan after so many iterations
_SAME = 0.25  # a cost that differs more from the path's length is no length
_SEARCH, _ITERATIONS = "wall_search_sum_s", "plan_iterations"


def figure(results: Results, *, name: str) -> Drawing | None:
    """Draw median and quartiles of cost over the least cost found by any arm, over iterations and time.

    Arms are compared with those of the same unit only: the cost of some is a length, of others a time.
    None where the trials have no history of cost.
    """
    histories = [str(column) for column in results.trials.columns if str(column).startswith(COST)]
    columns = sorted(histories, key=lambda column: int(column[len(COST) :]))
    if not columns:
        return None
    looks = looks_of(results, results.arms)
    trials = results.trials
    is_length = {arm: _is_length(trials[trials[ARM] == arm], columns) for arm in results.arms}
    trials = trials.assign(_is_length=trials[ARM].map(is_length))
    within = [SCENE, "seed", "_is_length"]
    trials = trials.join(trials.groupby(within)[columns].min().min(axis=1).rename("_best"), on=within)
    drawn = base.new_figure(base.PAGE_IN, 2.9)
    by_iteration, by_time = drawn.subplots(1, 2, sharey=True)
    iterations = np.array([float(column[len(COST) :]) for column in columns])
    for arm in results.arms:
        flown = trials[trials[ARM] == arm]
        share = flown[columns].to_numpy(dtype=float) / flown["_best"].to_numpy(dtype=float)[:, None]
        share[:, iterations > _longest(flown)] = np.nan
        if not np.isfinite(share).any():
            continue
        label = arm if is_length[arm] or not any(is_length.values()) else f"{arm} (time)"
        _draw(by_iteration, iterations, share, looks[arm], label)
        per_iteration_s = _seconds_per_iteration(flown)
        if np.isfinite(per_iteration_s):
            _draw(by_time, 1e3 * per_iteration_s * iterations, share, looks[arm], "")
    for axes, label in ((by_iteration, "iterations"), (by_time, "search time [ms]")):
        axes.set(xscale="log", xlabel=label)
    by_iteration.set_ylabel("cost over the least found")
    base.tidy(by_iteration, by_time)
    drawn.legend(loc="outside upper center", ncols=4, fontsize=7.5)
    return Drawing(name=name, caption=f"{_CAPTION} {results.notes[0]}", figure=drawn)


_CAPTION = (
    "Cost of the best plan so far over the least that any arm found in that world, of the arms that count "
    "the same: length, or time where that is said. Median and quartiles, from where half of the trials have "
    "a plan. Left over iterations (each planner's own unit), right over time: iterations times the arm's "
    "median time of one, on the machine named in run.json."
)


def _is_length(flown: pd.DataFrame, columns: list[str]) -> bool:
    """Whether an arm's cost is the length of its path, by the values."""
    if "plan_path_length_m" not in flown:
        return True
    ratio = flown[columns[-1]].astype(float) / flown["plan_path_length_m"].astype(float)
    return not abs(float(ratio.median()) - 1.0) > _SAME  # NaN, no plan at all, is no time either


def _longest(flown: pd.DataFrame) -> float:
    """Iterations of the longest search; inf when they were not counted."""
    return float(flown[_ITERATIONS].max()) if _ITERATIONS in flown else float("inf")


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
