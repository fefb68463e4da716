"""`python -m uavexp.check GROUP=OPTION ...`: which of its group's promises an option keeps."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from uavexp.interrupts import Parser, exit_code_of

_ABOUT = """Which promises of its group an option keeps: python -m uavexp.check planner=mine --config-dir DIR

Without GROUP=OPTION every option is checked. A parameter may be set: planner.clearance_m=0.5.
The exit code is 0 when every promise is kept, 1 when one is broken, 2 for bad input.
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Check the options that are named and return the exit code."""
    return exit_code_of(lambda: _check(_parse(sys.argv[1:] if arguments is None else arguments)))


def _parse(arguments: Sequence[str]) -> argparse.Namespace:
    parser = Parser(
        prog="python -m uavexp.check",
        description=_ABOUT,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("settings", nargs="*", metavar="GROUP=OPTION")
    parser.add_argument("--config-dir", "-cd", metavar="DIR", help="a folder with options of your own")
    return parser.parse_intermixed_args(arguments)


def _check(arguments: argparse.Namespace) -> int:
    from uavexp.check.subject import subjects
    from uavexp.config.composition import Composer
    from uavexp.config.options import user_folder
    from uavexp.config.overrides import parse_settings

    folder = user_folder(arguments.config_dir) if arguments.config_dir is not None else None
    broken = 0
    for subject in subjects(Composer(user_folder=folder), parse_settings(arguments.settings)):
        if subject.lacking:
            _say(f"{subject}: not checked, {subject.lacking} must be given")
        for words, how in subject.breaches():
            broken += bool(how)
            _say(f'{subject}: "{words}" is {f"broken: {how}" if how else "kept"}')
    _say(f"{broken} broken" if broken else "every promise is kept")
    return 1 if broken else 0


def _say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
