"""Perfect state estimation: the vehicle believes the truth."""

from __future__ import annotations

import numpy as np

from uavexp.parameters import option
from uavexp.types import State


@option
class Perfect:
    """Returns the true state."""

    def reset(self, rng: np.random.Generator) -> None:
        """Begin a trial; nothing is drawn."""

    def estimate(self, true_state: State, step_s: float) -> State:
        """Return the true state."""
        return true_state
