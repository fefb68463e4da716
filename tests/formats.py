"""Damage to files, and what may come of it."""

from __future__ import annotations

from pathlib import Path

from uavexp.errors import WorldError
from uavexp.formats import Content, Options, read


def only_world_errors(damaged: Path, place: int, byte: int, path: Path | None = None) -> None:
    """Set one byte of a file, and cut it there too: reading ends in content or a line."""
    whole = damaged.read_bytes()
    place %= len(whole)
    for content in (whole[:place] + bytes([byte]) + whole[place + 1 :], whole[:place]):
        damaged.write_bytes(content)
        try:
            message, found = "", read(path or damaged, Options())
        except WorldError as error:
            message, found = str(error), None
        assert "\n" not in message
        assert found is None or isinstance(found, Content)
    damaged.write_bytes(whole)
