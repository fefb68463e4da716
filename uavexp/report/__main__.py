"""`python -m uavexp.report DIR [DIR ...]`: tables, figures and page, or pictures, from stored trials."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from uavexp.interrupts import exit_code_of

_USAGE = """usage: python -m uavexp.report DIR [DIR ...] [--pictures]

Writes tables, figures, claims and report.html of each study folder from its stored trials;
nothing is flown. DIR: a folder that `python -m uavexp` left behind, e.g. outputs/mcr/table1
  --pictures   draw picture.png of every flown trial that has none instead
"""
_PICTURES = "--pictures"
_PATIENCE_S = 2.0  # nothing is said about work that is done sooner


def main(arguments: Sequence[str] | None = None) -> int:
    """Make the report of every folder named and return the exit code.

    0; 1 the disk was full; 2 bad input; 130 interrupted.
    """
    os.environ["MPLBACKEND"] = "Agg"
    typed = sys.argv[1:] if arguments is None else arguments
    names = [word for word in typed if word != _PICTURES]
    if not names or {"-h", "--help"} & set(names):
        (sys.stdout if names else sys.stderr).write(_USAGE)
        return 0 if names else 2
    return exit_code_of(lambda: _make(names, _report if len(names) == len(typed) else _draw))


def _make(names: Sequence[str], make: Callable[[Path], None]) -> int:
    for name in names:
        make(Path(name))
    return 0


def _draw(folder: Path) -> None:
    from uavexp.report.picture_files import draw_missing

    for path in draw_missing(folder):
        sys.stdout.write(f"{path}\n")


def _report(folder: Path) -> None:
    from uavexp.report.make import make_report

    begin_s = time.monotonic()

    def tell(line: str) -> None:
        sys.stdout.write(f"{folder}: {line}\n")
        sys.stdout.flush()

    def say(line: str) -> None:
        if time.monotonic() - begin_s > _PATIENCE_S:
            tell(line)

    for path in make_report(folder, say, warn=tell):
        sys.stdout.write(f"{path}\n")


if __name__ == "__main__":
    sys.exit(main())
