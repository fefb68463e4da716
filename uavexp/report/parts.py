"""What a report is made of: tables, drawings and verdicts, before anybody formats them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table of text cells; csv, Markdown and LaTeX are made of the same cells."""

    name: str  # file stem
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()  # sentences below it: n, intervals, tests, units

    def __post_init__(self) -> None:
        if any(len(row) != len(self.columns) for row in self.rows):
            raise ValueError(f"table {self.name}: every row needs {len(self.columns)} cells")


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawing:
    """A finished figure and what it shows."""

    name: str  # file stem, e.g. "figure_9"
    caption: str  # what is shown, of which trials, n; every figure names its seeds
    figure: Figure


class Verdict(StrEnum):
    """Whether a claim of the paper holds here."""

    REPRODUCED = "reproduced"
    NOT_REPRODUCED = "not reproduced"
    NOT_TESTABLE = "not testable"


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """A statement of a paper and what was found."""

    statement: str
    source: str  # where it stands, e.g. "Table 1", "§4.5"
    verdict: Verdict
    evidence: str  # the numbers it rests on, or the reason why it cannot be tested
