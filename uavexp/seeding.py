"""One trial seed, one named random stream per part that draws.

The world of seed 7 is the same under every strategy because each part draws from its
own stream; a part that draws more or less than before never shifts another's numbers.
"""

from enum import IntEnum

import numpy as np


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
