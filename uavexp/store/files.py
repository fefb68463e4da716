"""Files and folders of a study, opened as what anybody may have left under their names.

Only regular files of a sane size are read: a pipe would wait for ever, a device never end, and an
archive of a few kB unpack to more than the memory. Nothing is written through a link. Every fault is
one `RecordError` that names the file.
"""

from __future__ import annotations

import json
import os
import stat
from pathlib import Path
from typing import IO, Any

from uavexp.errors import RecordError

MOST_JSON_BYTES = 200_000_000
MOST_BYTES = 4 << 30  # of a file of arrays or of a table, packed or unpacked


def opened(path: Path, most_bytes: int = MOST_BYTES) -> IO[bytes]:
    """A regular file, open to read.

    Raises:
        RecordError: missing, no regular file, larger than allowed, or not to be read.
    """
    try:
        file = os.fdopen(os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK), "rb")
    except (OSError, ValueError) as error:  # a folder; a name with a NUL
        raise RecordError(f"{path}: cannot be read ({getattr(error, 'strerror', error)})") from error
    found = os.fstat(file.fileno())
    if stat.S_ISREG(found.st_mode) and found.st_size <= most_bytes:
        return file
    file.close()
    if not stat.S_ISREG(found.st_mode):
        raise RecordError(f"{path}: cannot be read (no regular file); move it away")
    raise RecordError(f"{path}: {found.st_size / 1e9:.1f} GB, at most {most_bytes / 1e9:.1f} GB are read")


def json_of(path: Path) -> dict[str, Any]:
    """The object in a JSON file.

    Raises:
        RecordError: it cannot be read, or holds something else.
    """
    try:
        with opened(path, MOST_JSON_BYTES) as file:
            content = json.loads(file.read().decode())
        json.dumps(content, ensure_ascii=False).encode()  # half a character, written \ud800, is no text
    except OSError as error:
        raise RecordError(f"{path}: cannot be read ({error.strerror})") from error
    except (ValueError, RecursionError) as error:
        raise RecordError(f"{path}: damaged, not JSON") from error
    if not isinstance(content, dict):
        raise RecordError(f"{path}: damaged, no object of JSON")
    return content


def own_folder(folder: Path, name: str) -> Path:
    """A folder inside of a study's, made if it is not there.

    Raises:
        RecordError: it cannot be made, or is a link: what is written would land elsewhere.
    """
    inner = folder / name
    if inner.is_symlink():
        raise RecordError(f"{inner} is a link, and nothing is written through one; move it away")
    try:
        inner.mkdir(exist_ok=True)
    except OSError as error:
        raise RecordError(f"{inner}: cannot be made ({error.strerror})") from error
    return inner
