"""One seed rules a flight: what the global generators of numpy and Python give, no part of it may draw."""

# ruff: noqa: NPY002
from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.random import rand

from uavexp.errors import ConfigError
from uavexp.seeding import Stream, generator, only_seeded_draws

DRAWS: dict[str, Callable[[], Any]] = {
    "numpy.random": np.random.random,
    "a function taken out of the module": rand,
    "numpy.normal": lambda: np.random.normal(size=3),
    "numpy.choice": lambda: np.random.choice(3),
    "numpy.shuffle": lambda: np.random.shuffle([1, 2]),
    "numpy.multivariate_normal": lambda: np.random.multivariate_normal([0.0], [[1.0]]),
    "numpy.seed": lambda: np.random.seed(1),
    "random": lambda: random.random(),
    "random.gauss": lambda: random.gauss(0.0, 1.0),
    "random.choice": lambda: random.choice([1, 2]),
    "random.shuffle": lambda: random.shuffle([1, 2]),
    "random.uniform": lambda: random.uniform(0.0, 1.0),
}


@pytest.mark.parametrize("name", DRAWS)
def test_a_global_draw_is_refused_and_says_what_to_draw_from(name: str) -> None:
    with only_seeded_draws(), pytest.raises(ConfigError, match="from the rng that the part is given"):
        DRAWS[name]()
    DRAWS[name]()  # afterwards, it is nobody's business here


def test_generators_of_one_s_own_draw_as_ever() -> None:
    with only_seeded_draws():
        drawn = np.random.default_rng(7).random(), random.Random(7).random()
    assert drawn == (np.random.default_rng(7).random(), random.Random(7).random())


def test_the_global_generators_go_on_where_they_were() -> None:
    random.seed(5), np.random.seed(5)
    before = random.getstate(), repr(np.random.get_state(legacy=False))
    with only_seeded_draws(), pytest.raises(ConfigError):
        random.random()
    assert (random.getstate(), repr(np.random.get_state(legacy=False))) == before


def test_a_stream_is_numpy_s_child_of_that_number() -> None:
    """So every seed and stream draws on its own (numpy's SeedSequence, the same spawned in order)."""
    for seed in (0, 7):
        children = np.random.SeedSequence(seed).spawn(len(Stream))
        for stream, child in zip(Stream, children, strict=True):
            drawn = generator(seed, stream).random(4)
            assert (drawn == np.random.Generator(np.random.PCG64(child)).random(4)).all()
