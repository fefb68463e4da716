"""Where the paper contradicts itself: `experiments/PAPER/contradictions.csv`."""

from __future__ import annotations

from uavexp.report.printed import read_rows
from uavexp.report.results import Results
from uavexp.report.tables.base import Table

_FILE = "contradictions.csv"
_COLUMNS = ("printed", "check", "so")


def table(results: Results, *, name: str) -> Table | None:
    """What is printed, the check, and what follows; none where nobody wrote any down."""
    rows = tuple(tuple(row[column] for column in _COLUMNS) for row in read_rows(results.study.name, _FILE))
    return (
        Table(name=name, title="Contradictions in the paper", columns=_COLUMNS, rows=rows) if rows else None
    )
