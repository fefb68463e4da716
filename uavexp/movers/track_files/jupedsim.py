"""JuPedSim's SQLite trajectories, versions 1 and 2: tables `trajectory_data` and `metadata`, in m.

The file is opened to read alone, as it stands, and no query works longer than its size can ask for.
"""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from uavexp.errors import WorldError
from uavexp.movers.track_files.base import MOST_ROWS, Recording, number

VERSIONS = ("1", "2")
_FEWEST_STEPS = 1_000_000  # of SQLite's machine, and 20 more a byte: a row takes about ten, and eight bytes
_MOST_STEPS = 2**31 - 1
_LONGEST_VALUE = 10_000  # bytes


def read(path: Path) -> Recording:
    """Rows of the table of tracks."""
    journal = path.with_name(path.name + "-wal")
    if journal.is_file() and journal.stat().st_size:
        raise WorldError(f"{path} is still being written: {journal.name} stands beside it; close it first")
    try:
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro&immutable=1", uri=True)) as file:
            file.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, _LONGEST_VALUE)
            file.execute("PRAGMA trusted_schema = OFF")
            file.set_progress_handler(lambda: 1, min(_MOST_STEPS, _FEWEST_STEPS + 20 * path.stat().st_size))
            return _recording(path, file)
    except (sqlite3.Error, OverflowError) as error:
        raise WorldError(f"{path} is no trajectory of JuPedSim that can be read: {error}") from error


def _recording(path: Path, file: sqlite3.Connection) -> Recording:
    tables = {name for (name,) in file.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    lacking = [name for name in ("metadata", "trajectory_data") if name not in tables]
    if lacking:
        raise WorldError(f"{path} is no trajectory of JuPedSim: table {' and '.join(lacking)} missing")
    told = dict(file.execute("SELECT key, value FROM metadata WHERE key IN ('version', 'fps') LIMIT 4"))
    version = str(told.get("version", "none"))
    if version not in VERSIONS:
        raise WorldError(f"{path}: version {' or '.join(VERSIONS)} is read, got {version[:20]}")
    found = file.execute(
        "SELECT rowid, id, frame, pos_x, pos_y FROM trajectory_data ORDER BY rowid LIMIT ?", [MOST_ROWS + 1]
    )
    rows = [(place, str(person), frame, x, y) for place, person, frame, x, y in found]
    rate_hz = number(told["fps"], "fps", path, 1) if "fps" in told else None
    return Recording(rows=rows, names=("frame", "pos_x", "pos_y"), frame_rate_hz=rate_hz)
