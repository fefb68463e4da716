"""How the compared arms are drawn: each by its colour, its marker and its dashes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from uavexp.report import style
from uavexp.report.results import Results


@dataclass(frozen=True, slots=True)
class Look:
    """Colour, marker and dashes of one arm."""

    colour: str
    marker: str
    dashes: Any  # matplotlib's linestyle

    @property
    def line(self) -> dict[str, Any]:
        """Line2D settings of a curve."""
        return {"color": self.colour, "ls": self.dashes}

    @property
    def point(self) -> dict[str, Any]:
        """Line2D settings of a point."""
        return {"color": self.colour, "marker": self.marker, "ls": "", "mec": "white", "mew": 0.6}


PRIMARY = Look(style.BLUE, "o", "-")
CLOCK = Look(style.VERMILLION, "s", (0, (4, 1.5)))
ONCE = Look(style.BLACK, "X", (0, (1, 1.2)))
OTHERS = (
    Look(style.GREEN, "^", (0, (5, 1, 1, 1))),
    Look(style.PURPLE, "D", (0, (3, 1))),
    Look(style.ORANGE, "v", (0, (6, 2))),
    Look(style.SKY, "P", (0, (2, 1))),
    Look("#8C6D31", "p", (0, (7, 1, 1, 1, 1, 1))),
    Look("#606060", "h", (0, (1, 2))),
    Look(style.YELLOW, "*", "-"),
)


def looks_of(results: Results, names: Sequence[str]) -> dict[str, Look]:
    """Look of every name, the same in all figures of a study.

    The primary arm, the one by the clock and SSP keep theirs in every study; others take
    theirs in the order given.
    """
    fixed = {results.primary: PRIMARY, results.clock: CLOCK, "SSP": ONCE, "ssp": ONCE}
    free = [name for name in names if name not in fixed]
    return {name: fixed.get(name) or OTHERS[free.index(name) % len(OTHERS)] for name in names}
