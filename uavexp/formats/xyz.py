"""Point clouds as text: `.xyz`, `.pts`, `.asc`, `.txt`; a row begins with x, y, z."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from uavexp.errors import WorldError
from uavexp.formats import base
from uavexp.formats.base import Content, Options
from uavexp.formats.text import BLANKS, check_last_row, rows, words_of

_HEAD = 65536  # bytes in which the first point must lie
_AXES = ("x", "y", "z")


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """How rows of this file are written."""

    begin: int  # byte of the first row
    separator: str  # a letter or BLANKS
    decimal: str  # point or comma
    width: int  # words of the first row
    columns: tuple[int, ...]  # of x, y, z
    promised: int | None  # points, by a count before them


def read(path: Path, options: Options) -> Content:
    """Return the points: columns that a heading calls x, y, z, otherwise the first three.

    Comments begin with #, or with // at the top; a lone whole number before the points is their
    count, as in .pts, where more such blocks may follow; blanks, commas or semicolons separate.
    """
    layout = _layout(path)
    check_last_row(path, layout.begin, layout.separator, layout.width)
    with path.open("rb") as file:
        file.seek(layout.begin)
        points = rows(
            path,
            file,
            layout.columns,
            separator=layout.separator,
            decimal=layout.decimal,
            short=layout.promised is not None,
        )
    if layout.promised is not None:
        lone = np.isnan(points[:, 1:]).all(axis=1) & (points[:, 0] == np.floor(points[:, 0]))
        promised = layout.promised + int(points[lone, 0].sum())
        points = points[~lone]
        if len(points) != promised:
            raise WorldError(
                f"world file {path} is damaged or truncated: {promised} points promised, {len(points)} found"
            )
    return base.cloud(path, f"{path.suffix[1:].lower()} cloud", points)


def _layout(path: Path) -> Layout:
    with path.open("rb") as file:
        head = file.read(_HEAD)
    begin = 3 if head.startswith(b"\xef\xbb\xbf") else 0
    promised: int | None = None
    columns: tuple[int, ...] = (0, 1, 2)
    for line in head[begin:].splitlines(keepends=True):
        text = line.decode("latin-1").strip()
        separator = _separator(text)
        words = words_of(text.split("#")[0], separator)
        decimal = "," if separator == ";" and "," in text else "."
        named = words_of(text.lstrip("/# ").replace('"', "").lower(), separator)
        if all(axis in named for axis in _AXES):
            columns = tuple(named.index(axis) for axis in _AXES)
        elif not text or text.startswith(("#", "//")):
            pass
        elif len(words) == 1 and text.isascii() and text.isdigit() and promised is None:
            promised = int(text[:15])
        elif len(words) > max(columns) and all(_is_number(words[i].replace(decimal, ".")) for i in columns):
            return Layout(
                begin=begin,
                separator=separator,
                decimal=decimal,
                width=len(words),
                columns=columns,
                promised=promised,
            )
        else:
            break
        begin += len(line)
    raise WorldError(f"world file {path} is no cloud: no row of its beginning holds three numbers")


def _separator(text: str) -> str:
    return next((letter for letter in ";," if letter in text), BLANKS)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
