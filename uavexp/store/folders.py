"""Which folder a command writes to, and the right to write there."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from uavexp.config.composition import Command
from uavexp.errors import ConfigError
from uavexp.paths import outputs_root
from uavexp.store.study import STUDY, TRIALS, WORLDS
from uavexp.store.table import TABLE
from uavexp.store.writing import LOCK, locked


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
def opened(command: Command) -> Iterator[Path]:
    """Make a command's folder and hold its lock; if no trial came of it, what was made is removed again.

    Raises:
        ConfigError: it holds something else than a study, or cannot be written.
        RecordError: another command is flying into it.
    """
    made: list[Path] = []
    try:
        folder = _make(command, made)
        with locked(folder):
            try:
                yield folder
            finally:
                if not (folder / STUDY).exists():
                    (folder / LOCK).unlink(missing_ok=True)
    finally:
        for path in made:
            with suppress(OSError):
                path.rmdir()  # only an empty one


def _make(command: Command, made: list[Path]) -> Path:
    """Make the folder of a command; a numbered one is new, also when another command takes its number.

    Args:
        command: whose folder.
        made: takes the folders that were not there before, the inmost first.
    """
    numbered = command.out is None and command.experiment is None
    while True:
        folder = folder_of(command)
        made[:] = [
            path for path in (folder / TRIALS, folder / WORLDS, folder, *folder.parents) if not path.exists()
        ]
        try:
            folder.mkdir(parents=True, exist_ok=not numbered)
            tempfile.TemporaryFile(dir=folder).close()
        except FileExistsError as error:
            if not numbered:
                raise _unwritable(folder, error) from error
        except OSError as error:
            raise _unwritable(folder, error) from error
        else:
            return folder


def _unwritable(folder: Path, error: OSError) -> ConfigError:
    return ConfigError(f"cannot write to the output folder {folder} ({error.strerror}); use out=DIR")


def _prefix(command: Command) -> str:
    names = dict.fromkeys(cell.strategy for cell in command.cells)
    worlds = dict.fromkeys(cell.options["world"] for cell in command.cells)
    return "-".join([*names, *worlds])[:60]


def _next_folder(root: Path, prefix: str) -> Path:
    numbers = [int(match[1]) for item in root.glob("*") if (match := re.match(r"(\d+)-", item.name))]
    return root / f"{max(numbers, default=0) + 1:04d}-{prefix}"
