"""Tables of people: csv with a header, separated by commas, semicolons or tabs.

Columns are found by name, in any case and order, and others ignored: time `t_s`, `t`, `time_s` or `time` in
seconds, or `frame`; person `id`; place `x_m` and `y_m`, or `x` and `y`. Lines that begin with # are
comments; a row of units may follow the header; with semicolons numbers may have decimal commas.
"""

from __future__ import annotations

import csv
from pathlib import Path

from uavexp.errors import WorldError
from uavexp.movers.track_files.base import Recording, Row, text_of

NAMES = {
    "time": ("t_s", "t", "time_s", "time", "frame"),
    "person": ("id",),
    "x": ("x_m", "x"),
    "y": ("y_m", "y"),
}
UNITS_M = {"m": 1.0, "cm": 0.01, "mm": 0.001}
_SEPARATORS = (",", ";", "\t")


def read(path: Path) -> Recording:
    """Rows of a table."""
    lines = [
        (place, line)
        for place, line in enumerate(text_of(path).splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not lines:
        raise WorldError(f"{path}: no rows")
    header = lines[0][1]
    separator = max(_SEPARATORS, key=header.count)
    column = _columns(path, lines[0][0], _cells(path, lines[0], separator))
    unit_m, body = 1.0, lines[1:]
    if body and (units := _units(_cells(path, body[0], separator), column)) is not None:
        unit_m, body = units, body[1:]
    rows = [_row(path, line, separator, column) for line in body]
    names = (column["time"][0], column["x"][0], column["y"][0])
    return Recording(rows=rows, names=names, counts_frames=names[0] == "frame", unit_m=unit_m)


def _cells(path: Path, line: tuple[int, str], separator: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([line[1]], delimiter=separator, strict=True))]
    except csv.Error as error:
        raise WorldError(f"{path}:{line[0]}: {error}") from error


def _columns(path: Path, place: int, header: list[str]) -> dict[str, tuple[str, int]]:
    """Name and place of each column that is needed."""
    names = [name.lower() for name in header]
    found = {
        part: next(((name, names.index(name)) for name in known if name in names), None)
        for part, known in NAMES.items()
    }
    lacking = [NAMES[part][0] for part, column in found.items() if column is None]
    if lacking:
        raise WorldError(
            f"{path}:{place}: columns t_s, id, x_m, y_m are needed, {', '.join(lacking)} missing; there are "
            f"{', '.join(header)[:80]}, if they are separated by commas, semicolons or tabs"
        )
    return {part: column for part, column in found.items() if column is not None}


def _units(cells: list[str], column: dict[str, tuple[str, int]]) -> float | None:
    """Length m of a unit that a row of units names; None: it is no such row."""
    shown = {part: cells[place].lower() for part, (_, place) in column.items() if place < len(cells)}
    named = shown.get("x") == shown.get("y") and shown.get("time") in ("s", "", "frame")
    return UNITS_M.get(shown.get("x", "")) if named else None


def _row(path: Path, line: tuple[int, str], separator: str, column: dict[str, tuple[str, int]]) -> Row:
    cells, place = _cells(path, line, separator), line[0]
    least = 1 + max(index for _, index in column.values())
    if len(cells) < least:
        raise WorldError(f"{path}:{place}: {least} columns are needed, got {len(cells)}")
    time, x, y = (cells[column[part][1]] for part in ("time", "x", "y"))
    if separator == ";":
        time, x, y = (text.replace(",", ".") for text in (time, x, y))
    return place, cells[column["person"][1]], time, x, y
