"""Estimator role: what the vehicle believes about its own state."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from uavexp.types import State

Believe = Callable[[State, float], State]  # the believed state of the true one after another step, s


class Estimator(Protocol):
    """The error's law; what it begins is asked once per simulation step of one trial."""

    def begin(self, rng: np.random.Generator) -> Believe:
        """Begin a trial, drawing noise from `rng`."""
