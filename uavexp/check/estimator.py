"""What every estimator promises, whatever its errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavexp.check.promise import Make, keep, same, untouched
from uavexp.seeding import Stream, generator
from uavexp.types import State

_STEP_S = 0.01
_TRUTH = State(
    position_m=np.array([1.0, 2.0, 3.0]),
    velocity_mps=np.array([0.5, 0.0, -0.5]),
    quaternion_wxyz=np.array([np.cos(0.2), np.sin(0.2), 0.0, 0.0]),
    body_rate_radps=np.array([0.1, 0.2, 0.3]),
)


def _believed(make: Make, seed: int, steps: int = 200) -> list[State]:
    believe = make().begin(generator(seed, Stream.ESTIMATOR))
    return [believe(_moved(step), _STEP_S) for step in range(steps)]


def _moved(steps: int) -> State:
    return replace(_TRUTH, position_m=_TRUTH.position_m + steps * _STEP_S * _TRUTH.velocity_mps)


def begins_at_the_truth(make: Make) -> None:
    """The vehicle knows where it starts, to a decimetre."""
    apart_m = float(np.linalg.norm(_believed(make, 0, 1)[0].position_m - _TRUTH.position_m))
    keep(apart_m < 0.1, f"its first estimate is {apart_m:.3f} m from the truth")


def believes_in_an_attitude(make: Make) -> None:
    """Finite numbers and a quaternion of length 1."""
    for step, state in enumerate(_believed(make, 2)):
        norm = float(np.linalg.norm(state.quaternion_wxyz))
        keep(abs(norm - 1.0) < 1e-6, f"a quaternion of length {norm:.6f} at step {step}")
        keep(np.isfinite(state.position_m).all(), f"a position {state.position_m} at step {step}")


def gives_the_same_estimates_for_the_same_seed(make: Make) -> None:
    """To the last bit, also after another trial."""
    used = make()
    used.begin(generator(4, Stream.ESTIMATOR))(_TRUTH, _STEP_S)
    once, again = _believed(make, 3), _believed(lambda: used, 3)
    keep(same(once, again), f"step {sum(map(same, once, again))} of 200 differs in a second trial")


def writes_into_nothing_it_is_given(make: Make) -> None:
    """The truth stays the truth."""
    believe = make().begin(generator(0, Stream.ESTIMATOR))
    with untouched(truth=_TRUTH):
        for _ in range(5):
            believe(_TRUTH, _STEP_S)
