"""True clearance of three flights over time, with the safety threshold."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from uavexp.log import TrialLog
from uavexp.report import style
from uavexp.report.figures import base
from uavexp.report.figures.base import Drawing
from uavexp.report.flights import RULE, SharedWorld, safety_threshold_m, scene_at, shared_world, three_arms
from uavexp.report.looks import Look, looks_of
from uavexp.report.results import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MOST_CLEARANCE_M = 2.0


def figure(results: Results, *, name: str) -> Drawing:
    """Draw the true clearance of three arms with the safety threshold, a row per arm."""
    arms = three_arms(results)
    shared, looks = shared_world(results, arms, scene_at(results, "first")), looks_of(results, arms)
    threshold_m = safety_threshold_m(results)
    drawn = base.new_figure(base.PAGE_IN, 0.6 + 1.05 * len(shared.logs))
    rows = drawn.subplots(len(shared.logs), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for axes, (arm, log) in zip(rows, shared.logs.items(), strict=True):
        _draw_clearance(axes, log, looks[arm], threshold_m)
        axes.set_title(_title(arm, log, threshold_m), fontsize=8, loc="left")
    rows[-1].set(xlabel="time [s]", xlim=(0.0, shared.longest_s), ylim=(0.0, _MOST_CLEARANCE_M))
    drawn.supylabel("true clearance [m]", fontsize=9)
    return Drawing(name=name, caption=_caption(shared, threshold_m), figure=drawn)


def _draw_clearance(axes: Axes, log: TrialLog, look: Look, threshold_m: float) -> None:
    time_s, clearance_m = base.thin(log.steps.time_s, log.steps.clearance_m)
    axes.plot(time_s, clearance_m, color=look.colour, lw=1.3)
    axes.axhline(threshold_m, color=style.BLACK, lw=0.8, ls=(0, (4, 2)))
    below = clearance_m < threshold_m
    axes.fill_between(time_s, clearance_m, threshold_m, where=below, color=style.ORANGE, alpha=0.7, lw=0)
    for contact in log.contacts:
        axes.plot(
            contact.start_s, 0.05, "X", color="white", mec=style.BLACK, mew=1.0, ms=6, clip_on=False, zorder=6
        )
    axes.plot(log.steps.time_s[-1], clearance_m[-1], ms=5.0, zorder=6, **look.point)
    base.tidy(axes)


def _title(arm: str, log: TrialLog, threshold_m: float) -> str:
    below_s = log.step_s * float(np.count_nonzero(log.steps.clearance_m < threshold_m))
    return (
        f"{arm}: least {log.steps.clearance_m.min():.2f} m, {below_s:.1f} s below {threshold_m:g} m, "
        f"{base.count(len(log.contacts), 'contact')}, {log.outcome}"
    )


def _caption(shared: SharedWorld, threshold_m: float) -> str:
    return (
        f"Distance of the body's centre from the nearest true surface over time, {', '.join(shared.logs)} in "
        f"the same world ({shared.where}; n = 1 flight each, {RULE}). Dashed: the safety threshold of "
        f"{threshold_m:g} m, orange below it; crosses: contacts; last point: the flight's end. "
        f"The axis ends at {_MOST_CLEARANCE_M:g} m."
    )
