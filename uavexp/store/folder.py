"""A command's folder while it is written: which one, one writer, trials there whole or not at all."""

from __future__ import annotations

import contextlib
import fcntl
import os
import re
import shutil
import stat
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO

from uavexp.config.composition import CommandLine
from uavexp.errors import ConfigError, RecordError
from uavexp.paths import expanded, outputs_root
from uavexp.store.files import own_folder
from uavexp.store.records import write_bytes
from uavexp.store.study import ASIDE, STUDY, TRIALS, WORLDS
from uavexp.store.table import TABLE

LOCK = ".lock"
_PART = ".part"


def folder_of(command: CommandLine) -> Path:
    """Folder of a command: as typed, the experiment's own, or a new numbered one.

    Raises:
        ConfigError: it holds something else than a study.
    """
    if command.out is not None:
        folder = expanded(command.out).absolute()
    elif command.experiment is not None:
        folder = outputs_root() / command.experiment.name
    else:
        folder = _next_folder(outputs_root(), _prefix(command))
    if (folder / TABLE).exists() and not (folder / STUDY).exists():
        raise ConfigError(
            f"{folder} holds the trials of an earlier command; name another folder with out=DIR"
        )
    return folder


@contextlib.contextmanager
def opened(command: CommandLine) -> Iterator[Path]:
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
            with contextlib.suppress(OSError):
                path.rmdir()  # only an empty one


def _make(command: CommandLine, made: list[Path]) -> Path:
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


def _prefix(command: CommandLine) -> str:
    names = dict.fromkeys(cell.strategy for cell in command.cells)
    worlds = dict.fromkeys(cell.options["world"] for cell in command.cells)
    return "-".join([*names, *worlds])[:60]


def _next_folder(root: Path, prefix: str) -> Path:
    numbers = [int(match[1]) for item in root.glob("*") if (match := re.match(r"(\d+)-", item.name))]
    return root / f"{max(numbers, default=0) + 1:04d}-{prefix}"


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold a study folder's lock; the system frees it when this process ends, however that happens.

    Raises:
        RecordError: another process holds it.
    """
    with _lock_file(folder) as file:
        with contextlib.suppress(OSError):  # a full disk: the lock holds without the number
            os.ftruncate(file.fileno(), 0)
            os.write(file.fileno(), str(os.getpid()).encode())
        yield


def _lock_file(folder: Path) -> IO[str]:
    """The folder's lock file, open and locked.

    Who leaves an empty folder removes the file while holding it (`opened`), so a lock counts only when
    the file that was locked is still the one of that name.
    """
    while True:
        file = _opened_lock(folder)
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if (folder / LOCK).stat().st_ino == os.fstat(file.fileno()).st_ino:
                return file
        except BlockingIOError:
            file.seek(0)
            holder = file.read().strip() or "unknown"
            raise RecordError(
                f"{folder}: another command (process {holder}) is flying into it; wait for its end, "
                "or name another folder with out=DIR"
            ) from None
        except FileNotFoundError:  # removed between the opening and the locking
            pass
        except OSError as error:
            file.close()
            if not (folder / STUDY).exists():
                (folder / LOCK).unlink(missing_ok=True)
            raise RecordError(
                f"{folder}: its file system cannot lock a file ({error.strerror}), and two commands "
                "might fly into it at once; name a folder on another one with out=DIR"
            ) from error
        file.close()


def _opened_lock(folder: Path) -> IO[str]:
    """The lock file, made if it is not there; no link is followed, no pipe waited for."""
    try:
        flags = os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
        file = os.fdopen(os.open(folder / LOCK, flags, 0o666), "a+")
    except OSError as error:
        raise RecordError(f"{folder}: cannot be locked ({error.strerror})") from error
    if stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        return file
    file.close()
    raise RecordError(f"{folder / LOCK} is no regular file; move it away")


def put_trial(folder: Path, name: str, files: Mapping[str, bytes]) -> None:
    """Add a trial's folder, whole or not at all; an earlier one of that name is set aside.

    Raises:
        RecordError: it cannot be written, as when the disk is full; nothing is left behind.
    """
    trial = folder / TRIALS / name
    part = trial.with_name(f".{name}{_PART}")
    own_folder(folder, TRIALS)
    try:
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir()
        for file, data in files.items():
            _write(part / file, data)
        _sync(part)
        if trial.exists():
            set_aside(folder, name)
        part.rename(trial)
        _sync(trial.parent)
    except OSError as error:
        raise RecordError(f"{trial}: cannot be written ({error.strerror or error})") from error
    finally:
        shutil.rmtree(part, ignore_errors=True)


def put_world(folder: Path, digest: str, data: bytes) -> None:
    """Add a world, or mend the file of that name; equal worlds have equal bytes.

    Raises:
        RecordError: it cannot be written.
    """
    file = folder / WORLDS / f"{digest}.npz"
    own_folder(folder, WORLDS)
    if not file.is_file() or file.read_bytes() != data:
        write_bytes(file, data)


def set_aside(folder: Path, name: str) -> Path:
    """Move a trial out of the way, under the first free number; returns where it is now."""
    trial = folder / TRIALS / name
    number = 1
    while (aside := trial.with_name(f"{name}{ASIDE}{number}")).exists():
        number += 1
    return trial.rename(aside)


def remove_unfinished(folder: Path) -> int:
    """Remove what a killed sweep was writing; returns how many pieces."""
    pieces = [
        *(folder / TRIALS).glob(f".*{_PART}"),
        *folder.glob(f".*{_PART}"),
        *(folder / WORLDS).glob(f".*{_PART}"),
    ]
    for piece in pieces:
        if piece.is_dir() and not piece.is_symlink():
            shutil.rmtree(piece)
        else:
            piece.unlink()
    return len(pieces)


def _write(path: Path, data: bytes) -> None:
    file: IO[bytes]
    with path.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def _sync(folder: Path) -> None:
    """Make the names in a folder durable."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
