"""How replans are drawn: a colour and a marker per cause, hollow where the request brought no plan."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from uavexp.causes import cause_named
from uavexp.log import TrialLog
from uavexp.metrics import replanning

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def marker(cause: str, size_pt: float) -> dict[str, Any]:
    """Line2D settings of a replan that took effect."""
    look = cause_named(cause)
    fill = {"color": look.colour, "mec": "white", "mew": 0.6}
    return {"marker": look.marker, "ls": "", "ms": size_pt, **fill}


def failed_marker(cause: str, size_pt: float) -> dict[str, Any]:
    """Line2D settings of a request that brought no plan: the same, hollow."""
    look = cause_named(cause)
    hollow = {"color": look.colour, "mfc": "white", "mew": 1.2}
    return {"marker": look.marker, "ls": "", "ms": 0.8 * size_pt, **hollow}


def draw_replans(axes: Axes, log: TrialLog, size_pt: float) -> None:
    """Mark the replans that took effect along the upper edge, by cause."""
    for replan in replanning.executed(log):
        axes.axvline(replan.time_s, color=cause_named(replan.cause).colour, lw=0.6, alpha=0.7, zorder=1)
        draw_above(axes, replan.time_s, marker(replan.cause, size_pt))


def draw_above(axes: Axes, time_s: float, look: dict[str, Any]) -> None:
    """Draw a marker on the upper edge."""
    axes.plot(time_s, 1.0, transform=axes.get_xaxis_transform(), clip_on=False, zorder=5, **look)


def causes_in_words(logs: Iterable[TrialLog]) -> str:
    """Which marker stands for which cause, of the causes that occurred."""
    causes = dict.fromkeys(replan.cause for log in logs for replan in replanning.executed(log))
    return causes_key(list(causes))


def causes_key(causes: list[str]) -> str:
    """Which marker stands for which cause."""
    return ", ".join(f"{cause}: {_SHAPES[cause_named(cause).marker]}" for cause in causes) or "none"


_SHAPES = {
    "^": "triangle",
    "D": "diamond",
    "s": "square",
    "o": "disc",
    "X": "cross",
    "p": "pentagon",
    "h": "hexagon",
    "<": "triangle to the left",
    ">": "triangle to the right",
    "v": "triangle down",
    "P": "plus",
    "*": "star",
    "d": "narrow diamond",
    "H": "upright hexagon",
    "8": "octagon",
}
