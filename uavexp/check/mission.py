"""What every mission promises, begun in a small building."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from uavexp.check.building import building
from uavexp.check.hall import LIMITS, flight, hovering
from uavexp.check.promise import Make, keep, same, untouched
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
    outcome = mission.outcome(hovering(world.start_m), _at_the_start(world))
    keep(outcome is None, f"it ends at 0 s: {outcome}")


def ends_as_flights_end(make: Make) -> None:
    """Wherever the vehicle is, the answer is an outcome or that the flight goes on."""
    mission, world = _begun(make)
    for share, point in enumerate(np.linspace(world.start_m, world.target_m, 20)):
        seen = replace(_at_the_start(world), time_s=5.0 * share, best_goal=None)
        outcome = mission.outcome(hovering(point), seen)
        ends = outcome is None or isinstance(outcome, Outcome)
        keep(ends, f"at {5.0 * share:g} s it answers {outcome!r}")


def names_who_chooses_the_goals(make: Make) -> None:
    """The explorer it is given, or a guide of its own that can be asked in the same way."""
    guide = _begun(make)[0].guide(_Explorer())
    lacking = [name for name in ("rate_hz", "reset", "select", "reject") if not hasattr(guide, name)]
    keep(not lacking, f"its guide lacks {', '.join(lacking)}")


def writes_into_nothing_it_is_given(make: Make) -> None:
    """World, state and observation are the trial's own."""
    with untouched(world=building()):
        mission, world = _begun(make)
    seen, here = _at_the_start(world), hovering(world.start_m)
    with untouched(true_state=here, observation=seen):
        mission.outcome(here, seen)
