"""Figures 5 and 8: position, tracking error and clearance of three flights over time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.ticker import NullLocator, StrMethodFormatter

from uavexp.log import TrialLog
from uavexp.metrics import replanning, tracking
from uavexp.report import style
from uavexp.report.figures import canvas
from uavexp.report.figures.flown import RULE, SharedWorld
from uavexp.report.figures.looks import Look
from uavexp.report.parts import Drawing

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LEAST_ERROR_M = 1e-3  # lower end of the logarithmic axis
_MOST_CLEARANCE_M = 2.0


def path_and_tracking(name: str, shared: SharedWorld, looks: Mapping[str, Look]) -> Drawing:
    """Draw position beside reference, and the tracking error, a column per arm."""
    figure = canvas.new_figure(canvas.PAGE_IN, 3.6)
    grid = figure.subplots(2, len(shared.logs), sharex=True, sharey="row", squeeze=False)
    for (arm, log), (position, error) in zip(shared.logs.items(), grid.T, strict=True):
        _draw_position(position, log, looks[arm])
        rmse_m = _draw_error(error, log, looks[arm])
        position.set_title(f"{arm}: {log.outcome}, RMSE {rmse_m:.3f} m", fontsize=8)
        error.set(xlabel="time [s]")
    grid[0, 0].set_xlim(0.0, _longest_s(shared))
    grid[0, 0].set_ylabel("position [m]")
    grid[1, 0].set_ylabel("tracking error [m]")
    grid[0, 0].legend(loc="best", fontsize=canvas.SMALL_PT, handlelength=1.8)
    return Drawing(name=name, caption=_tracking_caption(shared), figure=figure)


def _longest_s(shared: SharedWorld) -> float:
    return max(1.0, *(float(log.steps.time_s[-1]) for log in shared.logs.values()))


def _draw_position(axes: Axes, log: TrialLog, look: Look) -> None:
    steps = log.steps
    time_s, position_m, reference_m = canvas.thin(steps.time_s, steps.position_m, steps.reference_position_m)
    for axis, (label, width) in enumerate((("x", 1.9), ("y", 1.1))):
        axes.plot(time_s, position_m[:, axis], color=look.colour, lw=width, label=f"{label} flown")
    axes.plot(time_s, reference_m[:, 0], color=style.BLACK, lw=0.7, ls=(0, (3, 2)), label="reference")
    axes.plot(time_s, reference_m[:, 1], color=style.BLACK, lw=0.7, ls=(0, (3, 2)))
    canvas.tidy(axes)


def _draw_error(axes: Axes, log: TrialLog, look: Look) -> float:
    """Draw the error with its replans; return its RMSE, m."""
    error_m = tracking.distances_m(log.steps.position_m, log.steps.reference_position_m)
    time_s, shown_m = canvas.thin(log.steps.time_s, np.maximum(error_m, _LEAST_ERROR_M))
    axes.plot(time_s, shown_m, color=look.colour, lw=1.1)
    axes.set_yscale("log")
    axes.set_ylim(bottom=_LEAST_ERROR_M)
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.yaxis.set_minor_locator(NullLocator())
    draw_replans(axes, log, 4.5)
    canvas.tidy(axes)
    return tracking.rmse_m(error_m)


def draw_replans(axes: Axes, log: TrialLog, size_pt: float) -> None:
    """Mark the replans that took effect along the upper edge, by cause."""
    top: dict[str, Any] = {"transform": axes.get_xaxis_transform(), "clip_on": False, "zorder": 5}
    for replan in replanning.executed(log):
        look = style.cause_mark(replan.cause)
        axes.axvline(replan.time_s, color=look.colour, lw=0.6, alpha=0.7, zorder=1)
        axes.plot(replan.time_s, 1.0, **style.marker(replan.cause, size_pt), **top)


def _tracking_caption(shared: SharedWorld) -> str:
    return (
        f"Position (x and y, flown and reference) and tracking error of {', '.join(shared.logs)} over time "
        f"in the same world ({shared.where}; n = 1 flight each, {RULE}). The error axis is logarithmic, "
        f"values below {_LEAST_ERROR_M * 1000:g} mm drawn there. Markers on the upper edge: replans by cause "
        f"({causes_in_words(shared.logs.values())})."
    )


def causes_in_words(logs: Any) -> str:
    """Which marker stands for which cause, of the causes that occurred."""
    causes = dict.fromkeys(replan.cause for log in logs for replan in replanning.executed(log))
    return causes_key(list(causes))


def causes_key(causes: list[str]) -> str:
    """Which marker stands for which cause."""
    return ", ".join(f"{cause}: {_SHAPES[style.cause_mark(cause).marker]}" for cause in causes) or "none"


_SHAPES = {
    "^": "triangle",
    "D": "diamond",
    "s": "square",
    "o": "disc",
    "X": "cross",
    "p": "pentagon",
    "h": "hexagon",
    "<": "triangle to the left",
    "v": "triangle down",
    "P": "plus",
}


def clearance_over_time(
    name: str, shared: SharedWorld, looks: Mapping[str, Look], safety_threshold_m: float
) -> Drawing:
    """Draw the true clearance of every arm with the safety threshold, a row per arm."""
    figure = canvas.new_figure(canvas.PAGE_IN, 0.6 + 1.05 * len(shared.logs))
    rows = figure.subplots(len(shared.logs), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for axes, (arm, log) in zip(rows, shared.logs.items(), strict=True):
        _draw_clearance(axes, log, looks[arm], safety_threshold_m)
        axes.set_title(_clearance_title(arm, log, safety_threshold_m), fontsize=8, loc="left")
    rows[-1].set(xlabel="time [s]", xlim=(0.0, _longest_s(shared)), ylim=(0.0, _MOST_CLEARANCE_M))
    figure.supylabel("true clearance [m]", fontsize=9)
    return Drawing(name=name, caption=_clearance_caption(shared, safety_threshold_m), figure=figure)


def _draw_clearance(axes: Axes, log: TrialLog, look: Look, threshold_m: float) -> None:
    time_s, clearance_m = canvas.thin(log.steps.time_s, log.steps.clearance_m)
    axes.plot(time_s, clearance_m, color=look.colour, lw=1.3)
    axes.axhline(threshold_m, color=style.BLACK, lw=0.8, ls=(0, (4, 2)))
    below = clearance_m < threshold_m
    axes.fill_between(time_s, clearance_m, threshold_m, where=below, color=style.ORANGE, alpha=0.7, lw=0)
    for contact in log.contacts:
        axes.plot(
            contact.start_s, 0.05, "X", color="white", mec=style.BLACK, mew=1.0, ms=6, clip_on=False, zorder=6
        )
    axes.plot(log.steps.time_s[-1], clearance_m[-1], ms=5.0, zorder=6, **look.point)
    canvas.tidy(axes)


def _clearance_title(arm: str, log: TrialLog, threshold_m: float) -> str:
    below_s = log.step_s * float(np.count_nonzero(log.steps.clearance_m < threshold_m))
    return (
        f"{arm}: least {log.steps.clearance_m.min():.2f} m, {below_s:.1f} s below {threshold_m:g} m, "
        f"{canvas.count(len(log.contacts), 'contact')}, {log.outcome}"
    )


def _clearance_caption(shared: SharedWorld, threshold_m: float) -> str:
    return (
        f"Distance of the body's centre from the nearest true surface over time, {', '.join(shared.logs)} in "
        f"the same world ({shared.where}; n = 1 flight each, {RULE}). Dashed: the safety threshold of "
        f"{threshold_m:g} m, orange below it; crosses: contacts; last point: the flight's end. "
        f"The axis ends at {_MOST_CLEARANCE_M:g} m."
    )
