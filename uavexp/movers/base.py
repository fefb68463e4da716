"""Movers role: what moves in the world by itself, in truth."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np

from uavexp.arrays import Float
from uavexp.scene import Scene
from uavexp.types import Bodies, Limits, World


class Movers(Protocol):
    """Moves its bodies through the world; built fresh for every trial."""

    def reset(self, world: World, scene: Scene, limits: Limits, rng: np.random.Generator) -> None:
        """Begin a trial: place the bodies in free space, none where the vehicle cannot avoid it.

        Raises:
            WorldError: the bodies do not fit in.
        """

    def at(self, time_s: float) -> Bodies:
        """The bodies at a time >= 0; a function of time alone, and of what was noticed until then."""


@runtime_checkable
class Reacting(Movers, Protocol):
    """Movers that look where the vehicle is."""

    def notice(self, position_m: Float, velocity_mps: Float) -> None:
        """Where the vehicle is by now, (3,), and its velocity (3,); told before each step's `at`."""
