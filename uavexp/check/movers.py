"""What everything that moves by itself promises."""

from __future__ import annotations

from typing import Any

import numpy as np

from uavexp.check.building import building, scene
from uavexp.check.hall import LIMITS
from uavexp.check.promise import Make, keep, same, untouched
from uavexp.seeding import Stream, generator

_STEP_S = 0.01


def _begun(make: Make, seed: int = 0) -> Any:
    movers = make()
    movers.reset(building(), scene(), LIMITS, generator(seed, Stream.MOVERS))
    return movers


def keeps_the_same_bodies_in_the_same_order(make: Make) -> None:
    """All flight long; places and velocities are finite, the time is the one asked for."""
    movers = _begun(make)
    first = movers.at(0.0)
    for step in range(0, 3000, 50):
        time_s = _STEP_S * step
        bodies = movers.at(time_s)
        keep(abs(bodies.time_s - time_s) < 1e-9, f"at {time_s:.2f} s it tells of {bodies.time_s:.2f} s")
        as_before = same((bodies.shape, bodies.half_size_m), (first.shape, first.half_size_m))
        keep(as_before, f"other bodies at {time_s:.2f} s than at 0 s")
        finite = np.isfinite(bodies.position_m).all() and np.isfinite(bodies.velocity_mps).all()
        keep(finite, f"a place or a velocity at {time_s:.2f} s is not finite")


def moves_by_time_alone(make: Make) -> None:
    """Where they are does not depend on when they were asked before."""
    asked, fresh = _begun(make), _begun(make)
    for step in range(0, 1500, 37):
        asked.at(_STEP_S * step)
    for time_s in (14.99, 0.5):
        keep(same(asked.at(time_s), fresh.at(time_s)), f"asked before, they are elsewhere at {time_s:.2f} s")


def begins_anew_at_a_reset(make: Make) -> None:
    """Same seed, same bodies."""
    movers = _begun(make, seed=2)
    movers.reset(building(), scene(), LIMITS, generator(3, Stream.MOVERS))
    movers.reset(building(), scene(), LIMITS, generator(2, Stream.MOVERS))
    keep(same(movers.at(3.0), _begun(make, seed=2).at(3.0)), "after a reset they are elsewhere at 3 s")


def is_never_faster_than_the_vehicle(make: Make) -> None:
    """What is faster cannot be avoided."""
    movers = _begun(make)
    for step in range(0, 3000, 11):
        fastest = np.linalg.norm(movers.at(_STEP_S * step).velocity_mps, axis=1).max(initial=0.0)
        keep(
            fastest <= LIMITS.max_speed_mps,
            f"{fastest:.3f} m/s at {_STEP_S * step:.2f} s, the vehicle flies {LIMITS.max_speed_mps:g} m/s",
        )


def writes_into_nothing_it_is_given(make: Make) -> None:
    """The world is the trial's own."""
    with untouched(world=building()):
        _begun(make).at(1.0)
