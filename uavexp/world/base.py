"""World role: draws or reads the true geometry and a task in it."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from uavexp.types import World


class WorldGenerator(Protocol):
    """Makes a `World` from its parameters and one random generator, nothing else."""

    def generate(self, rng: np.random.Generator) -> World:
        """Return the world; raise `WorldError` in one line when none can be made."""
