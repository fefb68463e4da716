"""What third-party readers raise on damaged bytes, as one line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from uavexp.errors import WorldError, one_line

_LONGEST = 120  # letters of a library's own words in a message


@contextmanager
def damaged(path: Path, kind: str) -> Iterator[None]:
    """Turn whatever is raised inside into a `WorldError` that says `path` is no whole `kind` file.

    Libraries document few of the exceptions that a damaged file can cause, so all are taken.
    """
    try:
        yield
    except WorldError:
        raise
    except Exception as error:
        reason = one_line(error)[:_LONGEST] or type(error).__name__
        raise WorldError(f"world file {path} is damaged, truncated or no {kind} file ({reason})") from error
