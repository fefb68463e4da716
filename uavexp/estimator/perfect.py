"""Perfect state estimation: the vehicle believes the truth."""

from __future__ import annotations

import numpy as np

from uavexp.estimator.base import Believe
from uavexp.parameters import option
from uavexp.types import State


@option(frozen=True)
class Perfect:
    """Returns the true state."""

    def begin(self, rng: np.random.Generator) -> Believe:
        """Begin a trial; nothing is drawn."""
        return truth


def truth(true_state: State, step_s: float) -> State:
    """The true state."""
    return true_state
