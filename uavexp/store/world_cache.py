"""Worlds drawn once for all flights in them, whatever the study: a file each in the user's cache.

A file is named by all that its world comes from, of which the code is a part; it holds the sha256 of the
rest, then arrays alone. One that is missing, damaged or of other code is made anew, and a folder that cannot
be written is as good as an empty one.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from uavexp.errors import RecordError
from uavexp.store.records import digest, write_bytes
from uavexp.store.worlds import read_world, world_bytes
from uavexp.types import World
from uavexp.world.base import WorldGenerator

_VERSIONS = 3  # of the code whose worlds are kept
_SEAL = 32  # bytes of a sha256
_OWN = "uavexp."  # whose code a version tells of


@dataclass(frozen=True, slots=True, kw_only=True)
class KeptWorld:
    """A generator of one world, which draws it only where no file has it."""

    generator: WorldGenerator
    file: Path

    def generate(self, rng: np.random.Generator) -> World:
        """Read the world, or draw it and keep it."""
        with contextlib.suppress(OSError):
            data = self.file.read_bytes()
            if data[:_SEAL] == hashlib.sha256(data[_SEAL:]).digest():
                return read_world(io.BytesIO(data[_SEAL:]))
        world = self.generator.generate(rng)
        with contextlib.suppress(RecordError, OSError):
            _make_room(self.file.parent)
            data = world_bytes(world)
            write_bytes(self.file, hashlib.sha256(data).digest() + data)
        return world


def kept(
    generator: WorldGenerator, config: Mapping[str, Any], layout: int, version: Mapping[str, Any]
) -> WorldGenerator:
    """The generator, with its world kept where a version tells of its code.

    Args:
        generator: of this configuration.
        config: of the group `world`, files by their contents (`outputs.identity`).
        layout: the seed that the world is drawn from.
        version: of the code and its packages.
    """
    if not str(config["_target_"]).startswith(_OWN):
        return generator
    name = digest({"world": config, "layout": layout})[:32]
    return KeptWorld(generator=generator, file=_cache() / digest(version)[:16] / f"{name}.npz")


def _cache() -> Path:
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "uavexp" / "worlds"


def _make_room(folder: Path) -> None:
    """Make a version's folder; a new one takes the place of the one that was longest without a new world."""
    if folder.is_dir():
        return
    folder.mkdir(parents=True, exist_ok=True)
    newest_last = sorted(folder.parent.iterdir(), key=lambda item: item.stat().st_mtime_ns)
    for old in newest_last[:-_VERSIONS]:
        shutil.rmtree(old, ignore_errors=True)
