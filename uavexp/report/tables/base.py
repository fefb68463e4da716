"""A table of a report, before anybody formats it."""

from __future__ import annotations

from dataclasses import dataclass

from uavexp.metrics.metric import Metric


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table of text cells; csv, Markdown and LaTeX are made of the same cells."""

    name: str  # file stem
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()  # sentences below it: n, intervals, tests, units
    means: tuple[Metric, ...] = ()  # whose means it shows: one number to a cell in the table `values`

    def __post_init__(self) -> None:
        if any(len(row) != len(self.columns) for row in self.rows):
            raise ValueError(f"table {self.name}: every row needs {len(self.columns)} cells")
