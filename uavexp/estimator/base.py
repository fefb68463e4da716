"""Estimator role: what the vehicle believes about its own state."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from uavexp.types import State


class Estimator(Protocol):
    """Turns the true state into the believed one, once per simulation step."""

    def reset(self, rng: np.random.Generator) -> None:
        """Begin a trial, drawing noise from `rng`."""

    def estimate(self, true_state: State, step_s: float) -> State:
        """Return the believed state after another `step_s`."""
