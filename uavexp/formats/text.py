"""Rows of numbers in text."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import IO

import numpy as np
import pandas as pd

from uavexp.arrays import Float
from uavexp.errors import WorldError, one_line

_NAN = ["nan", "NaN", "NAN", "-nan", "-NaN", "nan(ind)", "-nan(ind)", "1.#QNAN", "-1.#IND"]  # as C prints it


def rows(
    path: Path,
    file: IO[bytes],
    columns: Sequence[int],
    *,
    separator: str = r"\s+",
    decimal: str = ".",
    short: bool = False,
) -> Float:
    r"""Return some columns (N, C) of the rows from where `file` stands; blank lines and # comments aside.

    Args:
        path: named in the errors.
        file: opened for bytes.
        columns: their numbers, in the order wanted.
        separator: a letter, or `\s+` for blanks.
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
