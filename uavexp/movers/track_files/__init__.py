"""Recorded tracks of people on the ground plane: one module per format, found by the file's suffix.

Every fault is one `WorldError` line that names the file, and the line where there is one.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from uavexp.arrays import Float
from uavexp.errors import WorldError
from uavexp.movers.track_files import columns, jupedsim, table, trajnet
from uavexp.movers.track_files.base import MOST_BYTES, Options, Recording, tracks_of

__all__ = ["READERS", "Options", "read"]

READERS: dict[str, Callable[[Path], Recording]] = {
    ".csv": table.read,
    ".tsv": table.read,
    ".txt": columns.read,
    ".ndjson": trajnet.read,
    ".sqlite": jupedsim.read,
    ".sqlite3": jupedsim.read,
    ".db": jupedsim.read,
}


def read(path: Path, options: Options | None = None) -> dict[str, Float]:
    """Read the track (N, 3) of time s, x m and y m of every person, by name, in the order of the file.

    Raises:
        WorldError: no such file, or one that cannot be read whole.
    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise WorldError(f"movers.path {path} cannot be read: its suffix must be one of {', '.join(READERS)}")
    given = options or Options()
    try:
        if not path.is_file():
            raise WorldError(f"movers.path {path} cannot be read: no such file")
        if path.stat().st_size > MOST_BYTES:
            raise WorldError(f"{path}: more than {MOST_BYTES // 2**20} MiB; cut the recording")
        return tracks_of(reader(path), path, given)
    except OSError as error:
        raise WorldError(f"movers.path {path} cannot be read: {error}") from error
