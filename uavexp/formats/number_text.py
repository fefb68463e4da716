"""Numbers and words of the text that a file holds."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

from uavexp.arrays import Float
from uavexp.errors import WorldError

SHOWN = 60  # characters of a file that an error quotes


def numbers(path: Path, text: bytes | str, count: int | None = None) -> Float:
    """Return the numbers (N,) of a text of nothing but numbers between blanks.

    Raises:
        WorldError: it holds something else, or not so many.
    """
    if isinstance(text, str):
        text = text.encode("ascii", "replace")
    values = np.empty(0)
    if text.strip():  # numpy makes -1 of blanks alone
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # numpy's word for a text not read to its end
            try:
                values = np.fromstring(text, dtype=np.float64, sep=" ")
            except (ValueError, DeprecationWarning) as error:
                raise WorldError(
                    f"world file {path} is damaged: where numbers belong it holds {_other(text)}"
                ) from error
    if count is not None and values.size != count:
        raise WorldError(
            f"world file {path} is damaged or truncated: {count} numbers needed, {values.size} found"
        )
    return values


def integers(path: Path, values: Float) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Return whole numbers, which a float holds exactly up to 2^53; raise `WorldError` when one is not."""
    whole = np.abs(values) < 2.0**53  # false for NaN
    if not whole.all() or (values != np.floor(values)).any():
        wrong = values[~whole] if not whole.all() else values[values != np.floor(values)]
        raise WorldError(f"world file {path} is damaged: where an index belongs it holds {wrong[0]:g}")
    return values.astype(np.int64)


def quoted(text: bytes) -> str:
    """Return the beginning of a text of a file for an error's line."""
    return repr(text[:SHOWN].decode("ascii", "replace"))


def _other(text: bytes) -> str:
    for word in text.split():
        try:
            float(word)
        except ValueError:
            return quoted(word)
    return "something else"
