"""A figure of a report, empty ones of a paper's size, and what all of them share."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from uavexp.metrics.metric import Metric
from uavexp.report.comparison import Panel, estimate
from uavexp.report.printed import Reference

if TYPE_CHECKING:
    from collections.abc import Iterable

    from matplotlib.axes import Axes

COLUMN_IN, PAGE_IN = 3.5, 7.2  # width of one column and of both
SMALL_PT = 7.0  # the least a reader of the printed page can be asked to read
MOST_POINTS = 2000  # of a curve over time
GREY = "#606060"


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawing:
    """A finished figure and what it shows."""

    name: str  # file stem, e.g. "figure_9"
    caption: str  # what is shown, of which trials, n; every figure names its seeds
    figure: Figure


def new_figure(width_in: float, height_in: float) -> Figure:
    """An empty figure whose parts find their own room."""
    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def png_of(figure: Figure, dpi: int = 150) -> bytes:
    """A figure as PNG, as notebooks show it."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi, metadata={"Software": None})
    return buffer.getvalue()


def tidy(*axes: Axes, grid: Literal["both", "x", "y"] = "both") -> None:
    """Faint grid, no frame on top and on the right."""
    for item in axes:
        item.grid(visible=True, axis=grid)
        item.spines[["top", "right"]].set_visible(False)


def thin(*curves: npt.NDArray[Any]) -> tuple[npt.NDArray[Any], ...]:
    """The same rows of every curve, evenly chosen, when there are more than can be seen."""
    stride = max(1, len(curves[0]) // MOST_POINTS)
    return tuple(curve[::stride] for curve in curves)


def count(number: int, thing: str) -> str:
    """A number of things in words: "1 replan", "2 replans"."""
    return f"{number} {thing}{'s' * (number != 1)}"


def span(numbers: Iterable[int]) -> str:
    """Numbers in words: "3", "0 to 19" when none is missing, else "0, 2, 5"."""
    found = np.unique(np.fromiter(numbers, dtype=np.int64))
    if found.size > 2 and found.size == found[-1] - found[0] + 1:
        return f"{found[0]} to {found[-1]}"
    return ", ".join(map(str, found[:12])) + (f", ... {found[-1]}" if found.size > 12 else "")


def paper(reference: Reference, metric: Metric) -> str:
    """What a caption says of the paper's numbers, where it prints some of this metric."""
    return (
        " Hollow diamonds: the paper's means." if any(name == metric.column for name, _ in reference) else ""
    )


def draw_estimate(axes: Axes, panel: Panel, metric: Metric, arm: str, **point: Any) -> None:
    """Draw mean and interval in the row of an arm; the trials with a value, where fewer than all."""
    found, place = estimate(panel, metric, arm), panel.arms.index(arm)
    if not found.n:
        return
    axes.plot(found.interval, (place, place), color=point["color"], lw=1.2, zorder=2)
    axes.plot(found.mean, place, zorder=3, clip_on=False, **point)
    if found.n < panel.n(arm):
        at: dict[str, Any] = {"textcoords": "offset points", "ha": "center", "fontsize": SMALL_PT}
        note = axes.annotate(str(found.n), (found.mean, place), (0, 4), **at)
        note.set_path_effects([withStroke(linewidth=1.5, foreground="white")])  # it may stand on an axis
