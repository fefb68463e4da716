"""Perfect state estimation: the vehicle believes the truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavexp.types import State


@dataclass(slots=True, kw_only=True)
class Perfect:
    """Returns the true state."""

    def reset(self, rng: np.random.Generator) -> None:
        """Begin a trial; nothing is drawn."""

    def estimate(self, true_state: State, step_s: float) -> State:
        """Return the true state."""
        return true_state
