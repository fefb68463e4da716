"""One trial seed, one named random stream per part that draws.

The world of seed 7 is the same under every strategy because each part draws from its
own stream; a part that draws more or less than before never shifts another's numbers. What
is drawn from the global generators of numpy and Python depends on all that ran before, so
during a flight nobody may.
"""

import random
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import IntEnum
from typing import Any, NoReturn

import numpy as np
from numpy.random import mtrand

from uavexp.errors import ConfigError

_SHARED = random.random.__self__  # type: ignore[attr-defined]
_DRAWS = ("random", "getrandbits")  # what every function of the module `random` comes down to


class Stream(IntEnum):
    """Who draws. Values are part of the record: append, never renumber."""

    WORLD = 0
    SENSOR = 1
    ESTIMATOR = 2
    MOVERS = 3
    PLANNER = 4
    DETECTION = 5
    MISSION = 6


def generator(seed: int, stream: Stream) -> np.random.Generator:
    """Return the generator of one stream of one trial.

    Args:
        seed: the trial's seed, >= 0 (0 is a seed like any other).
        stream: the part that draws.
    """
    sequence = np.random.SeedSequence(entropy=seed, spawn_key=(int(stream),))
    return np.random.Generator(np.random.PCG64(sequence))


@contextmanager
def only_seeded_draws() -> Iterator[None]:
    """Refuse every draw from a global generator while the block runs.

    Raises:
        ConfigError: at the first draw, which ends the flight.
    """
    numpy_own, python_own = mtrand.get_bit_generator(), random.getstate()
    draws = {name: getattr(random, name) for name in _DRAWS}
    locked = _Locked()
    mtrand.set_bit_generator(locked)  # type: ignore[arg-type]
    locked.is_open = False
    random.seed(0)  # for whoever took a function out of the module before
    _set_draws(dict.fromkeys(_DRAWS, _refuse_python))
    try:
        yield
    finally:
        mtrand.set_bit_generator(numpy_own)
        _set_draws(draws)
        random.setstate(python_own)


class _Locked:
    """A bit generator whose lock, which numpy's legacy functions hold while they draw, does not open."""

    def __init__(self, *seed: object) -> None:
        if seed:  # numpy.random.seed makes another one
            _refuse("numpy")
        self._own = np.random.MT19937(0)
        self.capsule = self._own.capsule
        self.lock, self.is_open = self, True

    def __enter__(self) -> None:
        if not self.is_open:
            _refuse("numpy")

    def __exit__(self, *_: object) -> None: ...


def _set_draws(draws: dict[str, Callable[..., Any]]) -> None:
    for name, draw in draws.items():
        setattr(random, name, draw)
        setattr(_SHARED, name, draw)


def _refuse_python(*_: object) -> NoReturn:
    _refuse("Python")


def _refuse(whose: str) -> NoReturn:
    raise ConfigError(
        f"a part drew from {whose}'s global generator, which no seed of a trial rules: draw from the rng "
        "that the part is given, or from numpy.random.default_rng(SEED), SEED a parameter of its own"
    )
