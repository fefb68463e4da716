"""What everything that may stop the vehicle promises, on the flight that triggers are checked on."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from uavexp.check.hall import FLOWN, LIMITS, PILLAR, elsewhere, flight, observe, room
from uavexp.check.promise import Make, keep, untouched
from uavexp.pace import AS_PLANNED
from uavexp.types import Observation

_ROUNDING = 1e-9


def _answers(safety: Any, seen: tuple[Observation, ...]) -> list[bool]:
    guard = safety.begin(LIMITS)
    return [guard.must_brake(observation) for observation in seen]


def _keep_same(have: list[bool], want: list[bool], where: str) -> None:
    for observation, one, other in zip(flight(), have, want, strict=True):
        words = {True: "brakes", False: "flies on"}
        keep(
            one == other,
            f"at {observation.time_s:.1f} s it {words[one]} {where}, it {words[other]} otherwise",
        )


def says_yes_or_no_at_every_update(make: Make) -> None:
    """True, False, and nothing else."""
    for observation, answer in zip(flight(), _answers(make(), flight()), strict=True):
        keep(answer in (True, False), f"at {observation.time_s:.1f} s it answers {answer!r}")


def lets_the_vehicle_fly_where_all_is_free(make: Make) -> None:
    """Through a hall that is mapped and empty."""
    free = tuple(replace(observation, field=room()) for observation in flight())
    for observation, answer in zip(free, _answers(make(), free), strict=True):
        keep(not answer, f"it brakes at {observation.time_s:.1f} s in free space")


def has_nothing_to_stop_before_there_is_a_plan(make: Make) -> None:
    """Whatever the map says."""
    (answer,) = _answers(make(), (replace(observe(room(PILLAR)), trajectory=None),))
    keep(not answer, "it brakes before the first plan")


def flies_a_plan_at_a_pace_from_the_present_one(make: Make) -> None:
    """At rates from 0 to 1, from the one it has, and never back; where all is free, at last as planned."""
    guard = make().begin(LIMITS)
    for observation in flight():
        for rate in (1.0, 0.4, 0.0):
            at = f"at {observation.time_s:.1f} s, from a rate of {rate:g},"
            pace = guard.flyable(FLOWN, observation.time_s, (rate, 0.0), observation).pace
            own_s, begun, _ = pace.at(observation.time_s)
            keep(own_s == observation.time_s, f"{at} the plan goes on at its {own_s:.3f} s")
            keep(rate in (begun, 0.0) or pace is AS_PLANNED, f"{at} it goes on at {begun:.3f}")
            rates = [pace.at(observation.time_s + 0.02 * k)[1] for k in range(200)]
            keep(
                min(rates) >= 0.0 and max(rates) <= 1.0 + _ROUNDING,
                f"{at} rates go from {min(rates)} to {max(rates)}",
            )


def begins_every_trial_anew(make: Make) -> None:
    """The second flight of one object is the first of another."""
    used = make()
    _answers(used, flight())
    _keep_same(_answers(used, flight()), _answers(make(), flight()), "in its second flight")


def decides_the_same_wherever_the_world_stands(make: Make) -> None:
    """A hall that stands elsewhere is the same hall."""
    there = tuple(map(elsewhere, flight()))
    _keep_same(_answers(make(), there), _answers(make(), flight()), "in a hall that stands elsewhere")


def writes_into_nothing_it_is_given(make: Make) -> None:
    """Map, plan and observation are the trial's own."""
    guard = make().begin(LIMITS)
    for observation in flight():
        with untouched(observation=observation):
            guard.must_brake(observation)
            guard.flyable(FLOWN, observation.time_s, (1.0, 0.0), observation)
