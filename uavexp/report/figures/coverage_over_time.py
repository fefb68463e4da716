"""How much of the visible surface has been seen, over time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from uavexp.arrays import Float
from uavexp.log import TrialLog
from uavexp.metrics import coverage
from uavexp.report.figures import base
from uavexp.report.figures.base import Drawing
from uavexp.report.flights import inspections
from uavexp.report.looks import looks_of
from uavexp.report.results import ARM, Results

_TIMES = 300  # at which coverage is drawn


def figure(results: Results, *, name: str) -> Drawing | None:
    """Draw median and quartiles of the coverage of visible cells over time, per arm; None without any."""
    drawn = over_time(results, inspections(results), coverage.over_time, "visible cells seen [%]")
    if drawn is None:
        return None
    return Drawing(name=name, caption=f"{_CAPTION} {results.notes[0]}", figure=drawn)


def over_time(
    results: Results, flights: pd.DataFrame, share: Callable[[TrialLog, Float], Float], label: str
) -> Figure | None:
    """Median and quartiles of a share over time, per arm; None without flights.

    Args:
        results: whose logs are read.
        flights: of `Results.trials`, those shown.
        share: of a log at times (T,) -> (T,), 0 to 1.
        label: of the share.
    """
    if not len(flights):
        return None
    looks = looks_of(results, results.arms)
    curves = {
        arm: [results.study.log(trial) for trial in flights.loc[flights[ARM] == arm, "trial"]]
        for arm in results.arms
    }
    last_s = max(log.steps.time_s[-1] for logs in curves.values() for log in logs)
    times_s = np.linspace(0.0, last_s, _TIMES)
    drawn = base.new_figure(base.PAGE_IN, 2.9)
    axes = drawn.add_subplot()
    for arm, logs in curves.items():
        if logs:
            low, middle, high = _quartiles(np.array([share(log, times_s) for log in logs]))
            axes.fill_between(times_s, low, high, color=looks[arm].colour, alpha=0.18, lw=0)
            axes.plot(times_s, middle, label=f"{arm} ({len(logs)})", **looks[arm].line)
    axes.set(xlabel="time [s]", ylabel=label, xlim=(0.0, last_s), ylim=(0.0, 103.0))
    base.tidy(axes)
    drawn.legend(loc="outside upper center", ncols=3, fontsize=7.5)
    return drawn


_CAPTION = (
    "Share of the visible cells seen over time: median and quartiles over the flights with a stored log "
    "(their number in brackets); a flight that has ended keeps its share."
)


def _quartiles(shares: Float) -> Float:
    return np.asarray(100.0 * np.percentile(shares, (25.0, 50.0, 75.0), axis=0))
