"""The log of a flight as `log.npz` and back, so that metrics can be recomputed without flying.

The file is flat: a field of a group of the log stands under its own name, after the group's
prefix where `PREFIX` has one; a field of an event under `replans.` or `contacts.`.
"""

from __future__ import annotations

import dataclasses
import hashlib
import io
import struct
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Any, get_type_hints

import numpy as np
import numpy.typing as npt

from uavexp.errors import RecordError, one_line
from uavexp.log import Contact, Replan, TrialLog
from uavexp.store.files import MOST_BYTES, opened
from uavexp.store.log_shapes import check_shapes
from uavexp.types import Outcome, PlanStatus

Arrays = dict[str, npt.NDArray[Any]]

GROUPS: dict[str, Any] = {
    name: kind for name, kind in get_type_hints(TrialLog).items() if dataclasses.is_dataclass(kind)
}
PREFIX = {"grid": "map_", "movers": "mover_", "tracks": "track_", "first_plan": "plan_"}
EVENTS = {"replans": Replan, "contacts": Contact}
_EPOCH = (1980, 1, 1, 0, 0, 0)  # a zip entry must carry a time; this one never changes
_LEVEL = 1  # of zlib: most of a log is coordinates, which 6 packs by 1 % smaller in three times the time
_KINDS = "fiubU"  # of arrays: numbers, truths, text
_DAMAGE = (
    OSError, ValueError, KeyError, EOFError, MemoryError, NotImplementedError, RuntimeError, TypeError,
    SyntaxError, zipfile.BadZipFile, zlib.error, struct.error,
)  # fmt: skip  # what unpacking a bad file raises
# added since: left out while empty, so that digests without them stay
LATER = ("track_swerve_m", "seen_so_far")
_RAGGED = ("changed_m", "trajectory_m")  # (n, 3) per replan, n differing


def log_arrays(log: TrialLog) -> Arrays:
    """Every field of a log as arrays, clock times apart (they are no part of the record)."""
    arrays: Arrays = {}
    for name, value in flat(log).items():
        if name in EVENTS:
            arrays |= _event_arrays(name, EVENTS[name], value)
        elif name not in LATER or value.size:
            arrays[name] = np.asarray(str(value) if isinstance(value, str) else value)
    return arrays


def flat(log: TrialLog) -> dict[str, Any]:
    """The fields of a log and of its groups by their flat names, clock times apart."""
    values = {name: getattr(log, name) for name in _names(TrialLog) if name not in (*GROUPS, "wall_s")}
    for group, kind in GROUPS.items():
        values |= {_flat_name(group, name): getattr(getattr(log, group), name) for name in _names(kind)}
    return values


def nested(values: Mapping[str, Any]) -> TrialLog:
    """The log of such fields; what they lack (older logs have fewer) takes its default."""
    fields = {name: values[name] for name in _names(TrialLog) if name in values}
    for group, kind in GROUPS.items():
        names = {name: _flat_name(group, name) for name in _names(kind)}
        fields[group] = kind(**{name: values[key] for name, key in names.items() if key in values})
    return TrialLog(**fields)


def _flat_name(group: str, name: str) -> str:
    return PREFIX.get(group, "") + name


def arrays_digest(arrays: Mapping[str, npt.NDArray[Any]]) -> str:
    """sha256 over names, types, shapes and values; independent of how a zip packs them."""
    total = hashlib.sha256()
    for name in sorted(arrays):
        array = np.asarray(arrays[name], order="C")
        total.update(f"{name}\0{array.dtype.str}\0{array.shape}\0".encode())
        total.update(array.tobytes())
    return total.hexdigest()


def pack(arrays: Mapping[str, npt.NDArray[Any]]) -> bytes:
    """Arrays as a compressed npz whose bytes depend on nothing but the arrays."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for name in sorted(arrays):
            entry = zipfile.ZipInfo(f"{name}.npy", _EPOCH)
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, np.asarray(arrays[name], order="C"), allow_pickle=False)
            # the archive's level would not be that of an entry made here
            archive.writestr(entry, buffer.getvalue(), zipfile.ZIP_DEFLATED, _LEVEL)
    return packed.getvalue()


def unpack(path: Path | IO[bytes]) -> Arrays:
    """Arrays of an npz file, or of an open one.

    Raises:
        RecordError: missing or damaged.
    """
    try:
        with opened(path) if isinstance(path, Path) else path as file, zipfile.ZipFile(file) as archive:
            unpacked = sum(entry.file_size for entry in archive.infolist())
            if unpacked > MOST_BYTES:
                raise RecordError(f"{path}: would unpack to {unpacked / 1e9:.1f} GB")
            return {
                entry.filename.removesuffix(".npy"): _array(archive, entry) for entry in archive.infolist()
            }
    except _DAMAGE as error:
        raise RecordError(f"{path}: damaged ({one_line(error)})") from error


def _array(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> npt.NDArray[Any]:
    """An array of numbers, truths or text; nothing is unpickled."""
    with archive.open(entry) as member:
        array: npt.NDArray[Any] = np.lib.format.read_array(member, allow_pickle=False)
    if array.dtype.kind not in _KINDS or (array.size and not array.itemsize):  # so many nothings cost nothing
        raise ValueError(f"{entry.filename} holds {array.dtype}")
    return array


def check_packed(path: Path) -> None:
    """Refuse an npz file that is missing, cut or changed since it was written, by its CRC.

    Nothing is unpacked.

    Raises:
        RecordError: so it is.
    """
    try:
        with opened(path) as file, zipfile.ZipFile(file) as archive:
            bad = archive.testzip()
    except _DAMAGE as error:
        raise RecordError(f"{path}: damaged ({error})") from error
    if bad is not None:
        raise RecordError(f"{path}: damaged ({bad})")


def read_log(path: Path) -> TrialLog:
    """Read a log back; its clock times stay empty.

    Raises:
        RecordError: missing, damaged, or not a log.
    """
    arrays = unpack(path)
    try:
        check_shapes(arrays)
        return _log_of(arrays)
    except (ValueError, KeyError, IndexError, TypeError) as error:
        raise RecordError(f"{path}: no log ({error})") from error


def _log_of(arrays: Arrays) -> TrialLog:
    values: dict[str, Any] = {
        name: array.item() if array.ndim == 0 else array for name, array in arrays.items() if "." not in name
    }
    replans = (row | {"status": PlanStatus(row["status"])} for row in _events("replans", arrays))
    return nested(
        values
        | {
            "outcome": Outcome(values["outcome"]),
            "replans": tuple(Replan(**row) for row in replans),
            "contacts": tuple(Contact(**row) for row in _events("contacts", arrays)),
        }
    )


def _event_arrays(prefix: str, kind: type, events: Sequence[Any]) -> Arrays:
    """One array per field of a sequence of events; ragged fields end to end, with counts."""
    arrays: Arrays = {}
    for name in _names(kind):
        rows = [getattr(event, name) for event in events]
        key = f"{prefix}.{name}"
        if name in _RAGGED:
            arrays[f"{key}.count"] = np.array([len(row) for row in rows], dtype=np.int64)
            arrays[key] = np.concatenate([np.zeros((0, 3), dtype=np.float32), *rows])
        elif rows and isinstance(rows[0], str):
            arrays[key] = np.array([str(row) for row in rows])
        else:
            arrays[key] = np.array(rows)
    return arrays


def _events(prefix: str, arrays: Arrays) -> list[dict[str, Any]]:
    names = [name for name in _names(EVENTS[prefix]) if f"{prefix}.{name}" in arrays]  # older logs have fewer
    columns: dict[str, list[Any]] = {}
    for name in names:
        array = arrays[f"{prefix}.{name}"]
        if name in _RAGGED:
            columns[name] = np.split(array, np.cumsum(arrays[f"{prefix}.{name}.count"])[:-1])
        else:
            columns[name] = list(array) if array.ndim > 1 else array.tolist()
    count = len(arrays[f"{prefix}.{names[0]}"])
    return [{name: column[index] for name, column in columns.items()} for index in range(count)]


def _names(kind: type) -> list[str]:
    return [item.name for item in dataclasses.fields(kind)]
