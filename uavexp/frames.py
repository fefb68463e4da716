"""Frames of an error in words that may stand in a record: no path of this machine."""

from __future__ import annotations

import sys
import traceback
from pathlib import Path

from uavexp.paths import PACKAGE


def portable_trace(error: BaseException) -> tuple[str, ...]:
    """Frames of an error, outermost first, by module file and line."""
    frames = traceback.extract_tb(error.__traceback__)
    return tuple(
        f"{portable_file(frame.filename)}:{frame.lineno} {frame.name}: {frame.line}" for frame in frames
    )


def portable_file(filename: str) -> str:
    """A module's file from the folder on that Python found it, else its last two names."""
    path = Path(filename)
    roots = (PACKAGE.parent, *sorted((Path(entry or ".").absolute() for entry in sys.path), key=_depth))
    for root in roots:
        if path.is_absolute() and path.is_relative_to(root):
            return path.relative_to(root).as_posix()
    return "/".join(path.parts[-2:])


def _depth(folder: Path) -> int:
    return -len(folder.parts)
