"""Worlds kept for other flights: the same to the byte, and never worse than none."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from uavexp.seeding import Stream, generator
from uavexp.store.world_cache import KeptWorld, kept
from uavexp.store.worlds import world_bytes
from uavexp.types import World
from uavexp.world.random_columns import RandomColumns

CONFIG = {"_target_": "uavexp.world.random_columns.RandomColumns", "size_m": [8.0, 6.0, 2.6]}
CODE = {"code": "one", "lock": "one"}


class Counting:
    """A generator that counts how often it draws."""

    def __init__(self) -> None:
        self.drawn = 0

    def generate(self, rng: np.random.Generator) -> World:
        self.drawn += 1
        return RandomColumns(size_m=(8.0, 6.0, 2.6)).generate(rng)


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "uavexp" / "worlds"


def world(
    drawing: Counting, seed: int = 0, config: dict[str, Any] = CONFIG, code: dict[str, str] = CODE
) -> bytes:
    return world_bytes(kept(drawing, config, seed, code).generate(generator(seed, Stream.WORLD)))


def test_a_world_is_drawn_once_and_read_back_to_the_byte() -> None:
    drawing = Counting()
    first = world(drawing)
    assert world(drawing) == first == world_bytes(Counting().generate(generator(0, Stream.WORLD)))
    assert drawing.drawn == 1


@pytest.mark.parametrize(
    "other", [{"seed": 1}, {"config": {**CONFIG, "gap_m": 1.0}}, {"code": {**CODE, "code": "two"}}]
)
def test_another_seed_configuration_or_code_is_another_world(other: dict[str, Any]) -> None:
    drawing = Counting()
    world(drawing)
    world(drawing, **other)
    assert drawing.drawn == 2


def test_code_that_no_version_tells_of_is_asked_every_time() -> None:
    drawing = Counting()
    for _ in range(2):
        world(drawing, config={**CONFIG, "_target_": "mine.world.World"})
    assert drawing.drawn == 2


def test_a_damaged_world_is_made_anew(cache: Path) -> None:
    drawing = Counting()
    whole = world(drawing)
    (file,) = cache.rglob("*.npz")
    data, places = file.read_bytes(), np.random.default_rng(0)
    for place in [0, 31, 32, len(data) - 1, *places.integers(len(data), size=20)]:
        file.write_bytes(data[:place] + bytes([data[place] ^ 1]) + data[place + 1 :])
        assert world(drawing) == whole
    file.write_bytes(data[: len(data) // 2])
    assert world(drawing) == whole
    assert file.read_bytes() == data, "and kept whole"
    assert drawing.drawn == 26


def test_a_folder_that_cannot_be_written_is_no_error(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    here = KeptWorld(generator=Counting(), file=tmp_path / "file" / "worlds" / "a.npz")
    assert here.generate(generator(0, Stream.WORLD)).name == "random_columns"


def test_worlds_of_old_code_do_not_pile_up(cache: Path) -> None:
    for number in range(5):
        world(Counting(), code={"code": str(number)})
        for folder in cache.iterdir():
            os.utime(folder, ns=(folder.stat().st_mtime_ns - 10**9,) * 2)
    assert len(list(cache.iterdir())) == 3
    drawing = Counting()
    world(drawing, code={"code": "4"})
    assert drawing.drawn == 0
