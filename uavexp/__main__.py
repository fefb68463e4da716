"""The command line: parse, compose, check, hand on (`python -m uavexp --help`)."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence

from uavexp import __version__
from uavexp.errors import ConfigError
from uavexp.interrupts import Parser, exit_code_of, leave_at_once


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command line and return its exit code.

    0; 1 a trial did not run to its end or the disk was full; 2 bad input; 130 interrupted.
    """
    os.environ["MPLBACKEND"] = "Agg"
    leave_at_once()
    typed = sys.argv[1:] if arguments is None else arguments
    if typed[:1] == ["tune"]:
        from uavexp.tune.__main__ import main as tune

        return tune(typed[1:])
    if typed[:1] == ["benchmark"]:
        from uavexp.benchmark.__main__ import main as benchmark

        return benchmark(typed[1:])
    return exit_code_of(lambda: _run(typed))


def _parse(arguments: Sequence[str]) -> argparse.Namespace:
    parser = Parser(prog="uavexp", add_help=False, allow_abbrev=False)
    parser.add_argument("overrides", nargs="*")
    parser.add_argument("-h", "--help", action="store_true")
    parser.add_argument("-m", "--multirun", action="store_true")
    parser.add_argument("--debug", action="store_true")
    parser.add_argument("--cfg", choices=("job", "hydra", "all"))
    parser.add_argument("--info", action="store_true")
    parser.add_argument("--version", action="store_true")
    parser.add_argument("--config-dir", "-cd", metavar="DIR")
    parser.add_argument("--config-name", "-cn", metavar="NAME")
    parser.add_argument("--shell-completion", "-sc", metavar="REQUEST")
    return parser.parse_intermixed_args(arguments)


def _run(typed: Sequence[str]) -> int:
    from uavexp.config.options import user_folder

    arguments = _parse(typed)
    folder = user_folder(arguments.config_dir) if arguments.config_dir is not None else None
    if arguments.shell_completion is not None:
        from uavexp.cli.completion import completion

        sys.stdout.write(completion(arguments.shell_completion, folder))
        return 0
    if arguments.help:
        from uavexp.cli.helptext import group_names, help_text

        words, groups = [word for word in arguments.overrides if "=" not in word], group_names(folder)
        for word in words:
            if word not in groups:
                raise ConfigError(f"--help {word}: no such group; there are {', '.join(groups)}")
        sys.stdout.write(help_text(folder, *words[:1]))
        return 0

    if arguments.version:
        sys.stdout.write(f"uavexp {__version__}\n")
        return 0
    if arguments.info:
        from uavexp.cli.show import info_text

        sys.stdout.write(info_text(folder))
        return 0

    from uavexp.config.overrides import parse_settings

    settings = parse_settings(arguments.overrides)
    if arguments.config_name is not None:
        from uavexp.config.named import with_named

        settings = with_named(arguments.config_name, folder, settings)
    if not arguments.cfg and not arguments.debug:
        from uavexp.sweep.head_start import give_head_start

        give_head_start(settings)

    from uavexp.config.composition import Composer

    composer = Composer(user_folder=folder)
    command = composer.command(settings)
    if arguments.cfg:
        from uavexp.cli.show import config_text

        sys.stdout.write(config_text(composer, command, arguments.cfg))
        return 0

    from uavexp.cli.terminal import Terminal
    from uavexp.sweep.run import execute

    return execute(command, Terminal(bar=not arguments.debug), folder, typed, here=arguments.debug)


if __name__ == "__main__":
    sys.exit(main())
