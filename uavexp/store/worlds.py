"""A world to disk and back: the true geometry of all trials that were flown in it, kept once."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import IO, Any

import numpy as np

from uavexp.errors import RecordError
from uavexp.store.logs import check_packed, pack, unpack
from uavexp.types import Difficulty, ReferenceMap, World


def world_bytes(world: World) -> bytes:
    """A world as npz; equal worlds give equal bytes."""
    fields: dict[str, Any] = {item.name: getattr(world, item.name) for item in dataclasses.fields(World)}
    reference = fields.pop("reference")
    nested = {"difficulty": fields.pop("difficulty"), **({"reference": reference} if reference else {})}
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
        known = "reference.triangles" in values
        return World(
            difficulty=_part(Difficulty, "difficulty", values),
            reference=_part(ReferenceMap, "reference", values) if known else None,
            **values,
        )
    except (KeyError, TypeError) as error:
        raise RecordError(f"{path}: no world ({error})") from error


def _part(kind: type, name: str, values: dict[str, Any]) -> Any:
    """Take the fields of a part of a world out of the values, and make it."""
    return kind(**{item.name: values.pop(f"{name}.{item.name}") for item in dataclasses.fields(kind)})
