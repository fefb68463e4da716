"""Rows of numbers in text."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import IO

import numpy as np
import pandas as pd

from uavexp.arrays import Float
from uavexp.errors import WorldError, one_line

BLANKS = r"\s+"  # a separator
_NAN = ["nan", "NaN", "NAN", "-nan", "-NaN", "nan(ind)", "-nan(ind)", "1.#QNAN", "-1.#IND"]  # as C prints it
_TAIL = 65536  # bytes of the end in which the last row is looked for


def rows(
    path: Path,
    file: IO[bytes],
    columns: Sequence[int],
    *,
    separator: str = BLANKS,
    decimal: str = ".",
    short: bool = False,
) -> Float:
    """Return some columns (N, C) of the rows from where `file` stands; blank lines and # comments aside.

    Args:
        path: named in the errors.
        file: opened for bytes.
        columns: their numbers, in the order wanted.
        separator: a letter, or `BLANKS`.
        decimal: point or comma.
        short: whether a row may have fewer numbers; the missing ones are NaN.

    Raises:
        WorldError: a row holds something else than numbers, or fewer.
    """
    try:
        table = pd.read_csv(
            file,
            sep=separator,
            decimal=decimal,
            header=None,
            usecols=sorted(columns),
            dtype=np.float64,
            comment="#",
            skipinitialspace=True,
            na_values=[*_NAN, ""] if short else _NAN,
            keep_default_na=False,
            quoting=3,  # none: a stray quote must not swallow lines
            encoding="latin-1",  # every byte is a letter
            engine="c",
        )
    except pd.errors.EmptyDataError:
        return np.empty((0, len(columns)))
    except (ValueError, OverflowError, pd.errors.ParserError) as error:
        raise WorldError(
            f"world file {path} is damaged or truncated: a row does not begin with the numbers that the "
            f"first one has ({one_line(error)[:120]})"
        ) from error
    return np.ascontiguousarray(table[list(columns)].to_numpy(np.float64))


def check_last_row(path: Path, begin: int, separator: str, width: int) -> None:
    """Raise `WorldError` when the last row after byte `begin` has fewer than `width` words."""
    with path.open("rb") as file:
        file.seek(max(begin, path.stat().st_size - _TAIL))
        lines = [line.split(b"#")[0].strip() for line in file.read().splitlines()]
    last = next((line for line in reversed(lines) if line), b"").decode("latin-1")
    if len(words_of(last, separator)) < width:
        raise WorldError(f"world file {path} is truncated: its last row has fewer than {width} numbers")


def words_of(line: str, separator: str) -> list[str]:
    """Words of a line between separators, as `rows` parts them."""
    return line.split() if separator == BLANKS else [word.strip() for word in line.split(separator)]
