"""A world to disk and back: the true geometry of all trials that were flown in it, kept once."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from uavexp.errors import RecordError
from uavexp.logs import pack, unpack
from uavexp.records import write_bytes
from uavexp.types import Difficulty, World


def world_bytes(world: World) -> bytes:
    """A world as npz; equal worlds give equal bytes."""
    fields: dict[str, Any] = {item.name: getattr(world, item.name) for item in dataclasses.fields(World)}
    difficulty = dataclasses.asdict(fields.pop("difficulty"))
    named = {**fields, **{f"difficulty.{name}": value for name, value in difficulty.items()}}
    return pack({name: np.asarray(value) for name, value in named.items()})


def write_world(path: Path, world: World) -> None:
    """Write a world atomically.

    Raises:
        RecordError: it cannot be written.
    """
    write_bytes(path, world_bytes(world))


def read_world(path: Path) -> World:
    """Read a world back.

    Raises:
        RecordError: missing, damaged, or no world.
    """
    arrays = unpack(path)
    values: dict[str, Any] = {name: item.item() if item.ndim == 0 else item for name, item in arrays.items()}
    try:
        difficulty = Difficulty(
            **{item.name: values.pop(f"difficulty.{item.name}") for item in dataclasses.fields(Difficulty)}
        )
        return World(difficulty=difficulty, **values)
    except (KeyError, TypeError) as error:
        raise RecordError(f"{path}: no world ({error})") from error
