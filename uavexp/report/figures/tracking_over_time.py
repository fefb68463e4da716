"""Position and tracking error of three flights over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.ticker import NullLocator, StrMethodFormatter

from uavexp.log import TrialLog
from uavexp.metrics import tracking
from uavexp.report import style
from uavexp.report.figures import base
from uavexp.report.figures.base import Drawing
from uavexp.report.flights import RULE, SharedWorld, scene_at, shared_world, three_arms
from uavexp.report.looks import Look, looks_of
from uavexp.report.replan_marks import causes_in_words, draw_replans
from uavexp.report.results import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LEAST_ERROR_M = 1e-3  # lower end of the logarithmic axis


def figure(results: Results, *, name: str) -> Drawing:
    """Draw position beside reference, and the tracking error, a column per arm."""
    arms = three_arms(results)
    shared, looks = shared_world(results, arms, scene_at(results, "first")), looks_of(results, arms)
    drawn = base.new_figure(base.PAGE_IN, 3.6)
    grid = drawn.subplots(2, len(shared.logs), sharex=True, sharey="row", squeeze=False)
    for (arm, log), (position, error) in zip(shared.logs.items(), grid.T, strict=True):
        _draw_position(position, log, looks[arm])
        rmse_m = _draw_error(error, log, looks[arm])
        position.set_title(f"{arm}: {log.outcome}, RMSE {rmse_m:.3f} m", fontsize=8)
        error.set(xlabel="time [s]")
    grid[0, 0].set_xlim(0.0, shared.longest_s)
    grid[0, 0].set_ylabel("position [m]")
    grid[1, 0].set_ylabel("tracking error [m]")
    grid[0, 0].legend(loc="best", fontsize=base.SMALL_PT, handlelength=1.8)
    return Drawing(name=name, caption=_caption(shared), figure=drawn)


def _draw_position(axes: Axes, log: TrialLog, look: Look) -> None:
    steps = log.steps
    time_s, position_m, reference_m = base.thin(steps.time_s, steps.position_m, steps.reference_position_m)
    for axis, (label, width) in enumerate((("x", 1.9), ("y", 1.1))):
        axes.plot(time_s, position_m[:, axis], color=look.colour, lw=width, label=f"{label} flown")
    axes.plot(time_s, reference_m[:, 0], color=style.BLACK, lw=0.7, ls=(0, (3, 2)), label="reference")
    axes.plot(time_s, reference_m[:, 1], color=style.BLACK, lw=0.7, ls=(0, (3, 2)))
    base.tidy(axes)


def _draw_error(axes: Axes, log: TrialLog, look: Look) -> float:
    """Draw the error with its replans; return its RMSE, m."""
    error_m = tracking.distances_m(log.steps.position_m, log.steps.reference_position_m)
    time_s, shown_m = base.thin(log.steps.time_s, np.maximum(error_m, _LEAST_ERROR_M))
    axes.plot(time_s, shown_m, color=look.colour, lw=1.1)
    axes.set_yscale("log")
    axes.set_ylim(bottom=_LEAST_ERROR_M)
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.yaxis.set_minor_locator(NullLocator())
    draw_replans(axes, log, 4.5)
    base.tidy(axes)
    return tracking.rmse_m(error_m)


def _caption(shared: SharedWorld) -> str:
    return (
        f"Position (x and y, flown and reference) and tracking error of {', '.join(shared.logs)} over time "
        f"in the same world ({shared.where}; n = 1 flight each, {RULE}). The error axis is logarithmic, "
        f"values below {_LEAST_ERROR_M * 1000:g} mm drawn there. Markers on the upper edge: replans by cause "
        f"({causes_in_words(shared.logs.values())})."
    )
