"""Which folder a command writes to, and the right to write there."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from uavexp.cli.composition import Command
from uavexp.errors import ConfigError
from uavexp.paths import outputs_root
from uavexp.study import STUDY, TRIALS, WORLDS
from uavexp.sweep.folder import LOCK, locked
from uavexp.table import TABLE


def folder_of(command: Command) -> Path:
    """Folder of a command: as typed, the experiment's own, or a new numbered one.

    Raises:
        ConfigError: it holds something else than a study.
    """
    if command.out is not None:
        folder = Path(command.out).expanduser().absolute()
    elif command.experiment is not None:
        folder = outputs_root() / command.experiment.name
    else:
        folder = _next_folder(outputs_root(), _prefix(command))
    if (folder / TABLE).exists() and not (folder / STUDY).exists():
        raise ConfigError(
            f"{folder} holds the trials of an earlier command; name another folder with out=DIR"
        )
    return folder


@contextmanager
def opened(folder: Path) -> Iterator[None]:
    """Make the folder and hold its lock; if no trial came of it, what was made is removed again.

    Raises:
        ConfigError: it cannot be written.
        RecordError: another command is flying into it.
    """
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
        except OSError as error:
            raise ConfigError(
                f"cannot write to the output folder {folder} ({error.strerror}); use out=DIR"
            ) from error
        with locked(folder):
            try:
                yield
            finally:
                if not (folder / STUDY).exists():
                    (folder / LOCK).unlink(missing_ok=True)
    finally:
        for path in (folder / TRIALS, folder / WORLDS, *made):
            try:
                path.rmdir()  # only an empty one
            except OSError:
                continue


def _prefix(command: Command) -> str:
    names = dict.fromkeys(cell.strategy for cell in command.cells)
    worlds = dict.fromkeys(cell.options["world"] for cell in command.cells)
    return "-".join([*names, *worlds])[:60]


def _next_folder(root: Path, prefix: str) -> Path:
    numbers = [int(match[1]) for item in root.glob("*") if (match := re.match(r"(\d+)-", item.name))]
    return root / f"{max(numbers, default=0) + 1:04d}-{prefix}"
