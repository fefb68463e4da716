"""The files that a Gazebo world names: models in folders beside it or above it, and their meshes."""

from __future__ import annotations

from pathlib import Path

from uavexp.formats.xml_file import parse

ABOVE = 5  # folders above a file that are searched, and the models/ in each
REMOTE = ("http", "https", "fuel")


def find(uri: str, file: Path, world: Path) -> Path | None:
    """Return what a URI names in a file of a world; None: nothing near either has that name.

    `model://a/b`, `package://a/b`, `file://models/a/b` and `a/b` are searched in the folders
    of the file and of the world, in those above them, and in `models` in each.
    """
    scheme, _, name = uri.strip().rpartition("://")
    if scheme in REMOTE or not name or "\0" in name:
        return None
    folders = [*file.absolute().parents[: ABOVE + 1], *world.absolute().parents[: ABOVE + 1]]
    for folder in folders:
        for inner in (folder / name, folder / "models" / name):
            if inner.is_file() or inner.is_dir():
                return inner
    return None


def model_file(found: Path) -> Path | None:
    """Return the file of a model's folder that holds its newest description; None: it has none."""
    if found.is_file():
        return found
    names = ["model.sdf"]
    config = found / "model.config"
    if config.is_file():
        entries = parse(config).findall("sdf")
        entries.sort(key=lambda entry: _version(entry.get("version", "0")))
        names = [(entry.text or "").strip() for entry in reversed(entries)] + names
    return next((found / name for name in names if name and (found / name).is_file()), None)


def _version(text: str) -> tuple[int, ...]:
    return tuple(int(word) if word.isdecimal() else 0 for word in text.split("."))
