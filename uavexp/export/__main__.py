"""`python -m uavexp.export TRIAL --to FORMAT`: a stored flight for another program."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from uavexp.export.formats import FORMATS, export
from uavexp.interrupts import exit_code_of
from uavexp.store.stored_trial import read_trial


def main(arguments: Sequence[str]) -> int:
    """Export one trial and return the exit code: 0; 1 the disk was full; 2 bad input; 130 interrupted."""
    return exit_code_of(lambda: _export(_parser().parse_args(arguments)))


def _export(options: argparse.Namespace) -> int:
    trial = read_trial(options.trial)
    tail = f".{options.to}".removesuffix(FORMATS[options.to].suffix) + FORMATS[options.to].suffix
    out = options.out or Path(trial.name + tail)
    for path in export(trial, options.to, out):
        sys.stdout.write(f"{path}\n")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m uavexp.export",
        description="Writes a stored flight for another program; nothing is flown.",
        epilog="formats:\n" + "\n".join(f"  {name:<8} {item.what}" for name, item in FORMATS.items()),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("trial", type=Path, metavar="TRIAL", help="a trial's folder, e.g. STUDY/trials/NAME")
    parser.add_argument("--to", required=True, choices=list(FORMATS), help="format")
    parser.add_argument("--out", type=Path, metavar="FILE", help="default: the trial's name, here")
    return parser


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
