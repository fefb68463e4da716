"""Bare columns of numbers: trajectories of PedPy, PeTrack and JuPedSim, and `obsmat.txt` of ETH and UCY.

PedPy: `id frame x y [z ...]`, below comments that may tell `# framerate: 25 fps`, other columns, and a unit
as `x/cm` or `in cm`; m where they do not. Obsmat (Pellegrini et al. 2009): without a comment, eight columns
`frame id x z y vx vz vy`, in m; the rate of its frames stands nowhere (15 Hz in seq_eth, 25 Hz in seq_hotel).
A text that begins with the names of its columns is a `table`.
"""

from __future__ import annotations

import re
from pathlib import Path

from uavexp.errors import WorldError
from uavexp.movers.track_files import table
from uavexp.movers.track_files.base import Recording, Row, number, text_of

OBSMAT_COLUMNS = 8
_PEDPY = {"id": 0, "frame": 1, "x": 2, "y": 3}
_OBSMAT = {"frame": 0, "id": 1, "x": 2, "y": 4}
_RATE = re.compile(r"frame ?rate[ :=]*([-+]?[\d.]+)", re.IGNORECASE)
_UNIT = re.compile(r"\bx ?[/(\[] ?(m|cm|mm)\b|\bin (m|cm|mm)\b", re.IGNORECASE)


def read(path: Path) -> Recording:
    """Rows of either format."""
    lines = [(place, line.split()) for place, line in enumerate(text_of(path).splitlines(), start=1)]
    comments = [" ".join(words) for _, words in lines if words and words[0].startswith("#")]
    body = [(place, words) for place, words in lines if words and not words[0].startswith("#")]
    if body and body[0][1][0][0].isalpha():
        return table.read(path)
    column = _columns(path, comments, len(body[0][1]) if body else 0)
    rate = next((found for comment in comments if (found := _RATE.search(comment))), None)
    unit = next((found for comment in comments if (found := _UNIT.search(comment))), None)
    return Recording(
        rows=[_row(path, place, words, column) for place, words in body],
        unit_m=table.UNITS_M[(unit[1] or unit[2]).lower()] if unit else 1.0,
        frame_rate_hz=number(rate[1], "framerate", path, 1) if rate else None,
    )


def _columns(path: Path, comments: list[str], count: int) -> dict[str, int]:
    """Places of the columns: by the comment that names them, else as the format has them."""
    for comment in reversed(comments):
        words = [word.split("/")[0].lower() for word in comment.lstrip("# ").split()]
        names = ["frame" if word == "fr" else word for word in words]
        if all(name in names for name in _PEDPY):
            return {name: names.index(name) for name in _PEDPY}
    if not comments and count != OBSMAT_COLUMNS:
        raise WorldError(f"{path}: what its columns are is not said; put a line above them: # id frame x y")
    return _PEDPY if comments else _OBSMAT


def _row(path: Path, place: int, words: list[str], column: dict[str, int]) -> Row:
    least = 1 + max(column.values())
    if len(words) < least:
        raise WorldError(f"{path}:{place}: {least} columns are needed, got {len(words)}")
    frame, x, y = (words[column[name]] for name in ("frame", "x", "y"))
    return place, _plain(words[column["id"]]), frame, x, y


def _plain(identity: str) -> str:
    """The same person, whether an id is written 1 or 1.0000000e+00."""
    try:
        return f"{float(identity):.17g}"
    except ValueError:
        return identity
