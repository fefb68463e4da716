"""What commands beside the flying one take apart by themselves."""

from __future__ import annotations

from collections.abc import Sequence

from uavexp.errors import ConfigError


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
