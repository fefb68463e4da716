"""What every mission promises, begun in a small building."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from uavexp.arrays import Float
from uavexp.check.building import building
from uavexp.check.hall import LIMITS, flight, hovering
from uavexp.check.promise import Make, keep, same, untouched
from uavexp.mission.base import Flown
from uavexp.scene import Scene
from uavexp.seeding import Stream, generator
from uavexp.types import Goal, Limits, Observation, Outcome, World


class _Explorer:
    """Has no goal: what is chosen is the mission's choice."""

    rate_hz = 5.0

    def reset(self, flight_height_m: float, limits: Limits) -> None:
        pass

    def select(self, observation: Observation, *, fresh: bool = False) -> Goal | None:
        return None

    def reject(self, position_m: Any, time_s: float) -> None:
        pass


def _begun(make: Make) -> tuple[Any, World]:
    mission = make()
    world = mission.prepare(building(), generator(1, Stream.MISSION))
    mission.reset(world, Scene(world), LIMITS)
    return mission, world


def _at_the_start(world: World) -> Observation:
    """What is seen at 0 s: nothing is known yet, and there is a goal."""
    return replace(
        flight()[0],
        time_s=0.0,
        state=hovering(world.start_m),
        trajectory=None,
        flight_bounds_m=world.flight_bounds_m,
    )


def _without_a_goal(world: World) -> Observation:
    return replace(_at_the_start(world), best_goal=None)


def _flown(position_m: Float) -> Flown:
    """At places (N, 3), one after the other, until 95 s have passed."""
    upright = np.tile([1.0, 0.0, 0.0, 0.0], (len(position_m), 1))
    return Flown(np.linspace(0.0, 95.0, len(position_m)), position_m, upright, position_m)


def _on_the_way(world: World) -> Flown:
    """In 20 steps from the start to the target."""
    return _flown(np.linspace(world.start_m, world.target_m, 20))


def leaves_the_task_in_the_world(make: Make) -> None:
    """Start and flight bounds stay as they were drawn; the world may differ from what is known of it."""
    world = make().prepare(building(), generator(1, Stream.MISSION))
    task = [(place.start_m, place.flight_bounds_m, place.bounds_m) for place in (world, building())]
    keep(same(*task), "start or bounds were changed")


def prepares_the_same_world_for_the_same_seed(make: Make) -> None:
    """To the last bit."""
    one, other = (make().prepare(building(), generator(1, Stream.MISSION)) for _ in range(2))
    keep(same(one, other), "the same seed gives another world")


def has_a_time_limit(make: Make) -> None:
    """A flight ends."""
    limit_s = _begun(make)[0].time_limit_s
    keep(0.0 < limit_s < np.inf, f"time_limit_s is {limit_s}")


def has_its_target_within_the_flight_bounds(make: Make) -> None:
    """Or none."""
    mission, world = _begun(make)
    target_m, (low, high) = mission.target_m, world.flight_bounds_m
    inside = target_m is None or bool(((target_m >= low) & (target_m <= high)).all())
    keep(inside, f"its target {target_m} is outside {low} to {high}")


def is_not_over_before_it_has_begun(make: Make) -> None:
    """At the start, with a goal to fly to, the flight goes on."""
    mission, world = _begun(make)
    outcome = mission.outcome(_flown(world.start_m[None]), _at_the_start(world))
    keep(outcome is None, f"it ends at 0 s: {outcome}")


def ends_as_flights_end(make: Make) -> None:
    """The answer is one of the steps shown and an outcome, or that the flight goes on."""
    mission, world = _begun(make)
    answer = mission.outcome(_on_the_way(world), _without_a_goal(world))
    ends = answer is None or (answer[0] in range(20) and isinstance(answer[1], Outcome))
    keep(ends, f"of 20 steps it answers {answer!r}")


def ends_in_the_same_step_however_many_it_is_shown_at_once(make: Make) -> None:
    """Between two ticks steps are shown together, beside a surface one by one."""
    mission, world = _begun(make)
    together = mission.outcome(_on_the_way(world), _without_a_goal(world))
    mission, world = _begun(make)
    way, alone = _on_the_way(world), None
    for step in range(20):
        one = Flown(*(values[step : step + 1] for values in way))
        if alone is None and (answer := mission.outcome(one, _without_a_goal(world))) is not None:
            alone = step, answer[1]
    keep(together == alone, f"shown 20 steps at once it answers {together}, one by one {alone}")


def names_who_chooses_the_goals(make: Make) -> None:
    """The explorer it is given, or a guide of its own that can be asked in the same way."""
    guide = _begun(make)[0].guide(_Explorer())
    lacking = [name for name in ("rate_hz", "reset", "select", "reject") if not hasattr(guide, name)]
    keep(not lacking, f"its guide lacks {', '.join(lacking)}")


def writes_into_nothing_it_is_given(make: Make) -> None:
    """World, state and observation are the trial's own."""
    with untouched(world=building()):
        mission, world = _begun(make)
    seen, here = _at_the_start(world), _flown(world.start_m[None])
    with untouched(flown=here, observation=seen):
        mission.outcome(here, seen)
