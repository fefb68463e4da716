"""A world in which nothing moves but the vehicle."""

from __future__ import annotations

import numpy as np

from uavexp.parameters import option
from uavexp.scene import Scene
from uavexp.types import Bodies, Limits, World


@option
class NoMovers:
    """No body at all."""

    def reset(self, world: World, scene: Scene, limits: Limits, rng: np.random.Generator) -> None:
        """Begin a trial; draws nothing."""

    def at(self, time_s: float) -> Bodies:
        """No bodies."""
        return Bodies.none(time_s)
