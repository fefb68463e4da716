"""Files of a stranger's folder of configurations, looked at before anything reads them."""

from __future__ import annotations

from pathlib import Path

from uavexp.errors import ConfigError, one_line

_MOST_VALUES = 100_000  # of one file, its aliases unpacked


def yaml_files(folder: Path, *patterns: str) -> list[Path]:
    """The regular files of a folder, sorted.

    Raises:
        ConfigError: the folder cannot be searched.
    """
    try:
        return sorted(file for pattern in patterns for file in folder.glob(pattern) if file.is_file())
    except OSError as error:
        raise ConfigError(f"{folder} is no folder of configurations: {one_line(error)}") from error


def refuse_unpacking(file: Path) -> None:
    """Refuse a file whose aliases unpack to more than anybody writes.

    Raises:
        ConfigError: it does; of all else that is wrong with it, its reader tells.
    """
    import yaml  # type: ignore[import-untyped]

    try:
        text = file.read_text(encoding="utf-8")
        values = _values(yaml.compose(text, yaml.SafeLoader), {}) if "*" in text and "&" in text else 0
    except (OSError, ValueError, RecursionError, yaml.YAMLError):
        return
    if values > _MOST_VALUES:
        raise ConfigError(f"{file}: its aliases unpack to more than {_MOST_VALUES} values; write fewer")


def _values(node: object, known: dict[int, int]) -> int:
    """How many values a yaml node and all below it have; what holds itself is counted once."""
    if id(node) not in known:
        known[id(node)] = 0
        held = getattr(node, "value", None)
        items = held if isinstance(held, list) else []
        parts = [part for item in items for part in (item if isinstance(item, tuple) else (item,))]
        known[id(node)] = 1 + sum(_values(part, known) for part in parts)
    return known[id(node)]
