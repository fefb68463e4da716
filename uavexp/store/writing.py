"""A study folder while it is written: one writer, trials that are there whole or not at all."""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO

from uavexp.errors import RecordError
from uavexp.store.records import write_bytes
from uavexp.store.study import ASIDE, TRIALS, WORLDS

LOCK = ".lock"
_PART = ".part"


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

    Who leaves an empty folder removes the file while holding it (`uavexp.store.folders`), so a
    lock counts only when the file that was locked is still the one of that name.
    """
    while True:
        try:
            file = (folder / LOCK).open("a+")
        except OSError as error:
            raise RecordError(f"{folder}: cannot be locked ({error.strerror})") from error
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if (folder / LOCK).stat().st_ino == os.fstat(file.fileno()).st_ino:
                return file
        except BlockingIOError as error:
            file.seek(0)
            holder = file.read().strip() or "unknown"
            raise RecordError(
                f"{folder}: another command (process {holder}) is flying into it; wait for its end, "
                "or name another folder with out=DIR"
            ) from error
        except FileNotFoundError:  # removed between the opening and the locking
            pass
        file.close()


def put_trial(folder: Path, name: str, files: Mapping[str, bytes]) -> None:
    """Add a trial's folder, whole or not at all; an earlier one of that name is set aside.

    Raises:
        RecordError: it cannot be written, as when the disk is full; nothing is left behind.
    """
    trial = folder / TRIALS / name
    part = trial.with_name(f".{name}{_PART}")
    try:
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir(parents=True)
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
    if not file.is_file() or file.read_bytes() != data:
        with contextlib.suppress(FileExistsError):
            file.parent.mkdir()
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
        if piece.is_dir():
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
