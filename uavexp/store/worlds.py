"""A world to disk and back: the true geometry of all trials that were flown in it, kept once."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import IO, Any

import numpy as np

from uavexp.errors import RecordError
from uavexp.space import Space
from uavexp.store.logs import check_packed, pack, unpack
from uavexp.types import Difficulty, ReferenceMap, World

_PARTS: dict[str, type] = {"difficulty": Difficulty, "reference": ReferenceMap, "space": Space}


def world_bytes(world: World) -> bytes:
    """A world as npz; equal worlds give equal bytes."""
    fields: dict[str, Any] = {item.name: getattr(world, item.name) for item in dataclasses.fields(World)}
    fields["notes"] = np.array(world.notes, dtype=np.str_)
    nested = {name: part for name in _PARTS if (part := fields.pop(name)) is not None}
    named = fields | {
        f"{part}.{item.name}": getattr(value, item.name)
        for part, value in nested.items()
        for item in dataclasses.fields(value)
    }
    return pack({name: np.asarray(value) for name, value in named.items()})


def is_whole(path: Path) -> bool:
    """Whether a world's file is there and as it was written; nothing is unpacked."""
    try:
        check_packed(path)
    except RecordError:
        return False
    return True


def read_world(path: Path | IO[bytes]) -> World:
    """Read a world back, from its file or an open one.

    Raises:
        RecordError: missing, damaged, or no world.
    """
    arrays = unpack(path)
    values: dict[str, Any] = {name: item.item() if item.ndim == 0 else item for name, item in arrays.items()}
    try:
        parts = {name: _part(kind, name, values) for name, kind in _PARTS.items() if _has(name, values)}
        return World(notes=tuple(map(str, values.pop("notes", ()))), **parts, **values)
    except (KeyError, TypeError) as error:
        raise RecordError(f"{path}: no world ({error})") from error


def _has(name: str, values: dict[str, Any]) -> bool:
    return any(key.startswith(f"{name}.") for key in values)


def _part(kind: type, name: str, values: dict[str, Any]) -> Any:
    """Take the fields of a part of a world out of the values, and make it."""
    return kind(**{item.name: values.pop(f"{name}.{item.name}") for item in dataclasses.fields(kind)})
