"""One trial to disk and back.

`record.json` is canonical JSON (sorted keys, shortest round-trip numbers) with its own
sha256. It holds no clock, path or worker count: the same configuration and seed give the
same bytes. JSON has no NaN; here NaN is null and the infinities are the words "inf" and
"-inf". The arrays of the flight are in `log.npz`, whose content the record's `log` digest
names; what may differ from run to run (clock times, the command) is in `wall.json`.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import tempfile
from collections.abc import Callable, Mapping
from enum import Enum, StrEnum
from pathlib import Path
from typing import IO, Any

import numpy as np

from uavexp.errors import RecordError
from uavexp.paths import PACKAGE, checkout_root
from uavexp.store.files import json_of

SCHEMA = 2
RECORD, WALL, LOG, PICTURE = "record.json", "wall.json", "log.npz", "picture.png"
_ASKING = (
    "cli",
    "sweep",
    "tune",
    "report",
    "results",
    "benchmark",
    "export",
    "show",
)  # they ask for flights, run and show them


class Status(StrEnum):
    """Whether a trial ran to its end. How the flight ended is its outcome, not its status."""

    OK = "ok"
    RAISED = "raised"  # an exception
    KILLED = "killed"  # its process died: a signal, a segmentation fault
    HUNG = "hung"  # ended after its time limit
    MEMORY = "memory"  # asked for more than its memory limit


class OtherVersionError(RecordError):
    """A whole record that another version of this package wrote."""


def canonical_json(value: Any) -> str:
    """JSON with sorted keys and no spaces; the same value always gives the same text."""
    return json.dumps(
        _jsonable(value), sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False
    )


def digest(value: Any) -> str:
    """sha256 (hex) of a value's canonical JSON."""
    return hashlib.sha256(canonical_json(value).encode()).hexdigest()


def seal(record: Mapping[str, Any]) -> str:
    """Text of `record.json`: the record, its schema version and its sha256, one key a line."""
    body = {**_jsonable(record), "schema": SCHEMA}
    lines = [
        f"{json.dumps(key)}:{canonical_json(value)}"
        for key, value in sorted({**body, "sha256": digest(body)}.items())
    ]
    return "{\n" + ",\n".join(lines) + "\n}\n"


def read_record(path: Path) -> dict[str, Any]:
    """Read a record, verify its sha256 and check its parts.

    Args:
        path: of a `record.json`, or of the folder that holds one.

    Returns:
        The record without its seal; null metrics are NaN again.

    Raises:
        OtherVersionError: of another schema.
        RecordError: missing, not JSON, changed since it was written, or of no trial.
    """
    from uavexp.store.parts import check_record  # metrics, which the start of a command need not wait for

    file = path / RECORD if path.is_dir() else path
    record = json_of(file)
    if "sha256" not in record:
        raise RecordError(f"{file}: damaged, no sha256")
    if record.pop("sha256") != digest(record):
        raise RecordError(f"{file}: damaged, its content does not match its sha256")
    if record.get("schema") != SCHEMA:
        raise OtherVersionError(f"{file}: schema {record.get('schema')}, this version reads {SCHEMA}")
    check_record(file, record)
    record["metrics"] = {key: restore(value) for key, value in record["metrics"].items()}
    return record


def restore(value: Any) -> Any:
    """A number as it was before canonical JSON: null is NaN, "inf" infinite."""
    if value is None:
        return math.nan
    return float(value) if value in ("inf", "-inf") else value


def trial_name(identity: Mapping[str, Any]) -> str:
    """Name of a trial's folder: a short readable prefix and a hash of what makes it this trial.

    Args:
        identity: `strategy`, `options`, `config` and `seed`; a record has them all.
    """
    prefix = re.sub(r"[^A-Za-z0-9_]+", "_", f"{identity['strategy']}-{identity['options']['world']}")[:40]
    whole = {key: identity[key] for key in ("strategy", "options", "config", "seed")}
    return f"{prefix}-s{identity['seed']}-{digest(whole)[:12]}"


def cell_digest(identity: Mapping[str, Any]) -> str:
    """Hash of a trial's configuration without its seed, the same for all trials of a cell."""
    return digest({key: identity[key] for key in ("strategy", "options", "config")})[:12]


def write_atomically(path: Path, write: Callable[[IO[bytes]], None]) -> None:
    """Write a file so that it is there whole or not at all: temporary name, fsync, rename.

    Raises:
        RecordError: the folder cannot be written or the disk is full; nothing is left behind.
    """
    temporary = None
    try:
        with tempfile.NamedTemporaryFile(
            dir=path.parent, prefix=f".{path.stem}-", suffix=f"{path.suffix}.part", delete=False
        ) as file:
            temporary = Path(file.name)
            write(file)
            file.flush()
            os.fsync(file.fileno())
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(path)
    except OSError as error:
        raise RecordError(f"{path}: cannot be written ({error.strerror or error})") from error
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file of these bytes atomically."""
    write_atomically(path, lambda file: _write_all(file, data))


def write_text(path: Path, text: str) -> None:
    """Write a text file atomically, UTF-8."""
    write_bytes(path, text.encode())


def code_digest() -> str:
    """sha256 over the source that a flight runs, file names included.

    Left out is what only asks for flights, runs and shows them. The configuration stands in
    the record itself, in full.
    """
    total = hashlib.sha256()
    for file in sorted(PACKAGE.rglob("*.py")):
        place = file.relative_to(PACKAGE)
        if place.parts[0] not in _ASKING:
            total.update(f"{place.as_posix()}\0".encode())
            total.update(hashlib.sha256(file.read_bytes()).digest())
    return total.hexdigest()


def lock_digest() -> str | None:
    """sha256 of the checkout's `requirements.lock`; None when the package is installed without one."""
    root = checkout_root()
    file = root / "requirements.lock" if root else None
    return hashlib.sha256(file.read_bytes()).hexdigest() if file and file.is_file() else None


def _jsonable(value: Any) -> Any:
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, np.generic):
        return _jsonable(value.item())
    if isinstance(value, np.ndarray):
        return _jsonable(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else ("inf" if value > 0.0 else "-inf")
    if isinstance(value, Mapping):
        return {str(key): _jsonable(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_jsonable(item) for item in value]
    return value


def _write_all(file: IO[bytes], data: bytes) -> None:
    file.write(data)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
