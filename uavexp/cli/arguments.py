"""What commands beside the flying one take apart by themselves."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence

from uavexp.errors import ConfigError
from uavexp.interrupts import exit_code_of


def run_or_explain(arguments: Sequence[str] | None, usage: str, run: Callable[[list[str]], int]) -> int:
    """Run a command that reports, on what was typed, or say how it is used; its exit code.

    Args:
        arguments: those typed; None: the process's own.
        usage: printed when asked for (exit code 0), or when nothing was typed (2).
        run: takes the words typed.
    """
    os.environ["MPLBACKEND"] = "Agg"
    typed = sys.argv[1:] if arguments is None else list(arguments)
    is_asked = bool({"-h", "--help"} & set(typed))
    if is_asked or not typed:
        (sys.stdout if is_asked else sys.stderr).write(usage)
        return 0 if is_asked else 2
    return exit_code_of(lambda: run(typed))


def without_config_dir(typed: Sequence[str], command: str) -> tuple[list[str], str | None]:
    """The words that are no flags, and the folder of `--config-dir`.

    Raises:
        ConfigError: another flag.
    """
    words, folder = list(typed), None
    for flag in ("--config-dir", "-cd"):
        if flag in words[:-1]:
            place = words.index(flag)
            folder = words[place + 1]
            del words[place : place + 2]
    for word in words:
        if word.startswith("-"):
            raise ConfigError(f"no such flag: {word}; see python -m uavexp {command} --help")
    return words, folder
