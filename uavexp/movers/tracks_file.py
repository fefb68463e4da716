"""Reads recorded tracks of people on the ground plane: csv with the columns t_s, id, x_m, y_m.

Further columns are ignored. Rows may be sorted by time or by person; within a person time must
increase.
"""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np

from uavexp.arrays import Float
from uavexp.errors import WorldError

COLUMNS = ("t_s", "id", "x_m", "y_m")


def read_tracks(path: Path) -> dict[str, Float]:
    """Read the track (N, 3) of time s, x m and y m of every person, by id, in the order of the file.

    Raises:
        WorldError: no such file, a missing column, a value that is not a finite number, or a time
            that repeats or does not increase; names file and line.
    """
    try:
        with path.open(newline="", encoding="utf-8") as file:
            return _read(csv.reader(file), path)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise WorldError(f"movers.path {path} cannot be read: {error}") from error


def _read(rows: csv._reader, path: Path) -> dict[str, Float]:  # type: ignore[name-defined]
    header = [name.strip() for name in next(rows, [])]
    lacking = [name for name in COLUMNS if name not in header]
    if lacking:
        raise WorldError(f"{path}:1: columns {', '.join(COLUMNS)} are needed, {', '.join(lacking)} missing")
    column = [header.index(name) for name in COLUMNS]
    people: dict[str, list[tuple[float, float, float]]] = {}
    for row in rows:
        if not row:
            continue
        where = f"{path}:{rows.line_num}"
        if len(row) <= max(column):
            raise WorldError(f"{where}: {len(header)} columns are needed, got {len(row)}")
        time_s, x_m, y_m = (_number(row[column[n]], COLUMNS[n], where) for n in (0, 2, 3))
        track = people.setdefault(row[column[1]].strip(), [])
        if track and time_s <= track[-1][0]:
            how = "repeats" if time_s == track[-1][0] else f"comes after {track[-1][0]:g} s"
            raise WorldError(
                f"{where}: t_s {time_s:g} of person {row[column[1]].strip()} {how}: time must increase"
            )
        track.append((time_s, x_m, y_m))
    if not people:
        raise WorldError(f"{path}: no rows")
    return {identity: np.array(track) for identity, track in people.items()}


def _number(text: str, name: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise WorldError(f"{where}: {name} must be a finite number, got {text!r}")
    return value
