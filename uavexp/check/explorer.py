"""What every explorer promises, in a hall of which half is known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from uavexp.check.fields import box, empty, field_from
from uavexp.check.hall import LIMITS, hovering, observe
from uavexp.check.promise import Make, keep, same, untouched
from uavexp.types import Goal, Observation

_HEIGHT_M = 1.05
_SIZE_M = (9.0, 6.0, 2.4)
_TARGET_M = np.array([8.05, 2.05, _HEIGHT_M])


def _begun(make: Make) -> Any:
    explorer = make()
    explorer.reset(_HEIGHT_M, LIMITS)
    return explorer


def _seen() -> list[Observation]:
    """2 s of a flight along the hall, five observations a second; unknown recedes before it."""
    grid = empty(_SIZE_M)
    grid[[0, -1]], grid[:, [0, -1]], grid[:, :, [0, -1]] = True, True, True
    box(grid, (3.0, 2.5, 0.0), (3.4, 4.5, 2.4))
    seen = []
    for tick in range(10):
        unknown = empty(_SIZE_M)
        unknown[45 + 3 * tick :] = True
        field = field_from(grid & ~unknown, unknown=unknown, max_distance_m=2.0)
        here = hovering((1.05 + 0.1 * tick, 2.05, _HEIGHT_M))
        seen.append(
            replace(
                observe(field, time_s=0.2 * tick),
                state=here,
                reference=replace(observe(field).reference, position_m=here.position_m),
                target_m=_TARGET_M,
                flight_bounds_m=np.array([[0.3, 0.3, 0.4], [8.7, 5.7, 2.0]]),
            )
        )
    return seen


def _goals(explorer: Any, seen: list[Observation]) -> list[Goal | None]:
    return [explorer.select(observation) for observation in seen]


def chooses_a_goal_within_the_flight_bounds(make: Make) -> None:
    """Or none; a goal that is the target says so."""
    seen = _seen()
    for observation, goal in zip(seen, _goals(_begun(make), seen), strict=True):
        at, (low, high) = f"at {observation.time_s:.1f} s", observation.flight_bounds_m
        keep(goal is None or isinstance(goal, Goal), f"{at} it chooses a {type(goal).__name__}")
        if goal is not None:
            inside = ((goal.position_m >= low) & (goal.position_m <= high)).all()
            keep(inside, f"{at} it chooses {goal.position_m}, outside {low} to {high}")
            is_target = bool(np.allclose(goal.position_m, _TARGET_M))
            keep(is_target or not goal.is_target, f"{at} it calls {goal.position_m} the target")


def chooses_no_goal_in_an_obstacle(make: Make) -> None:
    """Nor one that the body would touch one at."""
    seen = _seen()
    for observation, goal in zip(seen, _goals(_begun(make), seen), strict=True):
        if goal is not None:
            clear_m = float(observation.field.distance_m(goal.position_m[None])[0])
            keep(
                clear_m > LIMITS.body_radius_m,
                f"at {observation.time_s:.1f} s it chooses a goal {clear_m:.3f} m from an obstacle, "
                f"the body's radius is {LIMITS.body_radius_m:.3f} m",
            )


def sets_a_rejected_goal_aside(make: Make) -> None:
    """A check later it is not chosen again."""
    explorer, (first, second, *_) = _begun(make), _seen()
    goal = explorer.select(first, fresh=True)
    if goal is None:
        return
    explorer.reject(goal.position_m, first.time_s)
    again = explorer.select(second, fresh=True)
    chosen = again is not None and np.linalg.norm(again.position_m - goal.position_m) < 0.05
    keep(not chosen, f"a goal rejected at {first.time_s:.1f} s is chosen again at {second.time_s:.1f} s")


def forgets_the_last_trial_at_a_reset(make: Make) -> None:
    """Same map, same goals."""
    used, seen = _begun(make), _seen()
    for goal in _goals(used, seen):
        if goal is not None:
            used.reject(goal.position_m, seen[-1].time_s)
    used.reset(_HEIGHT_M, LIMITS)
    goals = zip(seen, _goals(used, seen), _goals(_begun(make), seen), strict=True)
    for observation, one, other in goals:
        keep(same(one, other), f"at {observation.time_s:.1f} s it chooses another goal in a second trial")


def writes_into_nothing_it_is_given(make: Make) -> None:
    """Map and observation are the trial's own."""
    explorer = _begun(make)
    for observation in _seen():
        with untouched(observation=observation):
            explorer.select(observation)


def has_a_rate(make: Make) -> None:
    """Choices a second."""
    rate_hz: Any = make().rate_hz
    keep(0.0 < rate_hz < np.inf, f"rate_hz is {rate_hz}")
