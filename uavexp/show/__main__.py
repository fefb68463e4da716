"""`python -m uavexp.show DIR|TRIAL`: see a stored flight, or the flights of a study side by side."""

from __future__ import annotations

import argparse
import os
import sys
import webbrowser
from collections.abc import Sequence
from pathlib import Path

from uavexp.errors import ConfigError, RecordError
from uavexp.interrupts import exit_code_of, raise_from_now_on
from uavexp.show.chosen import Chosen, chosen
from uavexp.show.page import page_html
from uavexp.store.records import write_bytes

_PAGE = "show.html"


def main(arguments: Sequence[str]) -> int:
    """Show flights and return the exit code: 0; 1 the disk was full; 2 bad input; 130 interrupted."""
    return exit_code_of(lambda: _show(_parser().parse_args(arguments)))


def _show(options: argparse.Namespace) -> int:
    flights = chosen(options.folder)
    films = [file for file in (options.gif, options.mp4) if file is not None]
    for film in films:
        _write_film(flights, film)
    if options.out is not None or not films:
        _write_page(flights, options.out or options.folder / _PAGE, look=options.out is None)
    return 0


def _write_page(flights: Chosen, file: Path, *, look: bool) -> None:
    _write(file, page_html(flights.title, flights.trials).encode())
    screen = sys.platform in ("darwin", "win32") or {"DISPLAY", "WAYLAND_DISPLAY"} & set(os.environ)
    if look and screen and sys.stdout.isatty():
        webbrowser.open(file.absolute().as_uri())


def _write_film(flights: Chosen, file: Path) -> None:
    from uavexp.show.film import film_bytes

    raise_from_now_on()
    _write(file, film_bytes(flights.trials[-1], file.suffix))


def _write(file: Path, data: bytes) -> None:
    try:
        write_bytes(file, data)
    except (OSError, RecordError) as error:
        raise ConfigError(f"{file} cannot be written: {error}") from error
    sys.stdout.write(f"{file}\n")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m uavexp.show",
        description="Shows stored flights on one page that needs no network; nothing is flown.",
    )
    parser.add_argument(
        "folder", type=Path, metavar="DIR|TRIAL", help="a study's folder, or a trial's, e.g. DIR/trials/NAME"
    )
    parser.add_argument("--out", type=Path, metavar="FILE.html", help=f"the page; default: {_PAGE} there")
    parser.add_argument(
        "--gif", type=Path, metavar="FILE.gif", help="a film of the plan view and the clearance"
    )
    parser.add_argument("--mp4", type=Path, metavar="FILE.mp4", help="the same; needs imageio-ffmpeg")
    return parser


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
