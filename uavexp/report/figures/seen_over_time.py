"""How much of the reachable volume has been seen, over time."""

from __future__ import annotations

from uavexp.metrics import exploration
from uavexp.report.figures.base import Drawing
from uavexp.report.figures.coverage_over_time import over_time
from uavexp.report.flights import stored
from uavexp.report.results import Results

_MEASURED = "seen_share"  # column that only flights without a target have
_CAPTION = (
    "Share of the reachable volume seen over time: median and quartiles over the flights with a stored log "
    "(their number in brackets); a flight that has ended keeps its share."
)


def figure(results: Results, *, name: str) -> Drawing | None:
    """Draw median and quartiles of the seen share over time, per arm; None without any exploration."""
    there = stored(results)
    if _MEASURED not in there:
        return None
    explored = there[there[_MEASURED].notna()]
    drawn = over_time(results, explored, exploration.over_time, "reachable volume seen [%]")
    if drawn is None:
        return None
    return Drawing(name=name, caption=f"{_CAPTION} {results.notes[0]}", figure=drawn)
