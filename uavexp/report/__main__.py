"""`python -m uavexp.report DIR [DIR ...]`: tables, figures and page, or pictures, from stored trials."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from uavexp.errors import ConfigError
from uavexp.interrupts import exit_code_of, raise_from_now_on

_USAGE = """usage: python -m uavexp.report DIR [DIR ...] [--pictures]
       python -m uavexp.report DIR --watch [--port=N]

Writes tables, figures, claims and report.html of each study folder from its stored trials;
nothing is flown. DIR: a folder that `python -m uavexp` left behind, e.g. outputs/mcr/table1
  --pictures   draw picture.png of every flown trial that has none instead
  --watch      show a study while it is flown, on a page of this machine: progress, failures, tables so far
"""
_PICTURES, _WATCH, _PORT = "--pictures", "--watch", "--port="
_HIGHEST_PORT = 65535
_PATIENCE_S = 2.0  # nothing is said about work that is done sooner


def main(arguments: Sequence[str] | None = None) -> int:
    """Make the report of every folder named and return the exit code.

    0; 1 the disk was full; 2 bad input; 130 interrupted.
    """
    os.environ["MPLBACKEND"] = "Agg"
    typed = sys.argv[1:] if arguments is None else arguments
    flags = [word for word in typed if word.startswith("-")]
    names = [word for word in typed if word not in flags]
    is_asked = bool({"-h", "--help"} & set(flags))
    if is_asked or not names:
        (sys.stdout if is_asked else sys.stderr).write(_USAGE)
        return 0 if is_asked else 2
    return exit_code_of(lambda: _run(names, flags))


def _run(names: Sequence[str], flags: Sequence[str]) -> int:
    for flag in flags:
        if flag not in (_PICTURES, _WATCH) and not flag.startswith(_PORT):
            raise ConfigError(f"no such flag: {flag}; there are {_PICTURES}, {_WATCH} and {_PORT}N")
    if _WATCH in flags:
        return _watch(names, flags)
    return _make(names, _draw if _PICTURES in flags else _report)


def _watch(names: Sequence[str], flags: Sequence[str]) -> int:
    from uavexp.report.watch import watch

    ports = [flag.removeprefix(_PORT) for flag in flags if flag.startswith(_PORT)]
    if len(names) > 1:
        raise ConfigError(f"{_WATCH} shows one folder, got {', '.join(names)}")
    if any(not port.isdecimal() or int(port) > _HIGHEST_PORT for port in ports):
        raise ConfigError(f"{_PORT}N takes a number from 0 to {_HIGHEST_PORT}, got {ports[-1]}")
    for number in (signal.SIGINT, signal.SIGTERM):  # a job begun with & ignores the first
        signal.signal(number, signal.default_int_handler)
    try:
        watch(Path(names[0]), _tell, *map(int, ports[-1:]))
    except KeyboardInterrupt:  # how watching ends
        return 0
    return 0


def _tell(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def _make(names: Sequence[str], make: Callable[[Path], None]) -> int:
    for name in names:
        make(Path(name))
    return 0


def _draw(folder: Path) -> None:
    from uavexp.report.picture_files import draw_missing

    raise_from_now_on()
    for path in draw_missing(folder):
        sys.stdout.write(f"{path}\n")


def _report(folder: Path) -> None:
    from uavexp.report.make import make_report

    raise_from_now_on()
    begin_s = time.monotonic()

    def tell(line: str) -> None:
        _tell(f"{folder}: {line}")

    def say(line: str) -> None:
        if time.monotonic() - begin_s > _PATIENCE_S:
            tell(line)

    for path in make_report(folder, say, warn=tell):
        sys.stdout.write(f"{path}\n")


if __name__ == "__main__":
    sys.exit(main())
