"""The compiled motion is the one step by step, byte for byte, however a flight is cut into stretches."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

import uavexp
from tests.components import build, options
from tests.unit.pilot.test_holding import START, make, room, see
from tests.unit.trigger.test_trigger import LIMITS
from tests.unit.vehicle.test_contact import scene_of
from uavexp import trial
from uavexp.check.hall import hovering
from uavexp.controller.position_velocity import PositionVelocity
from uavexp.estimator.perfect import Perfect
from uavexp.motion.base import Craft, Ending, Motion
from uavexp.motion.compiled import Compiled, compiled_motion
from uavexp.motion.stepwise import Stepwise
from uavexp.movers.none import NoMovers
from uavexp.pace import pace_over
from uavexp.pilot.flown import Flown
from uavexp.pilot.holding import Holding
from uavexp.recorder import Recorder
from uavexp.safety.none import NoBrake
from uavexp.scene import Scene
from uavexp.store.logs import arrays_digest, log_arrays
from uavexp.trajectory import Trajectory
from uavexp.trigger.ssp import Ssp
from uavexp.types import Bodies, Goal, Outcome
from uavexp.vehicle.contact import ContactTracker
from uavexp.vehicle.quadrotor import Quadrotor

OPEN, STEPS, STEP_S = scene_of(((90, 90, 90), (91, 91, 91))), 500, 0.01
BOARDS = scene_of(((2.0, 1.6, 0.5), (2.05, 2.1, 1.5)), ((-1.0, -1.0, 0.2), (6.0, 6.0, 0.3)))
GROUPS = ("controller", "vehicle", "estimator", "pilot")
SHIPPED = {"controller": PositionVelocity, "vehicle": Quadrotor, "estimator": Perfect, "pilot": Holding}


def craft(
    scene: Scene = OPEN, trajectory: Trajectory | None = None, command_steps: int = 1, **parts: Any
) -> Craft:
    """A craft at the start of a flight along a trajectory."""
    made = {group: parts.get(group) or kind() for group, kind in SHIPPED.items()}
    made["controller"].reset(LIMITS, made["vehicle"].mass_kg)
    made["vehicle"].reset(hovering(START))
    pilot = made["pilot"].begin(make(Ssp()).crew)
    pilot.flown = None if trajectory is None else Flown(trajectory=trajectory)
    return Craft(
        pilot=pilot,
        controller=made["controller"],
        vehicle=made["vehicle"],
        believe=made["estimator"].begin(np.random.default_rng(3)),
        movers=NoMovers(),
        contact=ContactTracker(scene=scene, body_size_m=LIMITS.body_size_m),
        recorder=Recorder(STEPS, STEP_S),
        step_s=STEP_S,
        command_steps=command_steps,
    )


def swinging(seed: int) -> Trajectory:
    """To and fro past the boards, with jumps in acceleration; ends before the flight does."""
    rng = np.random.default_rng(seed)
    knots_s = np.array([0.003, 0.5, 1.1, 2.0, 2.6, 4.1])
    velocity_mps = rng.uniform((-0.5, -0.5, -0.4), (2.5, 0.5, 0.3), (5, 3))
    coefficients, at_m = np.zeros((5, 4, 3)), START
    for k, span_s in enumerate(np.diff(knots_s)):
        coefficients[k, :2] = at_m, velocity_mps[k]
        coefficients[k, 2] = rng.uniform(-0.3, 0.3, 3)
        at_m = at_m + span_s * velocity_mps[k] + span_s**2 * coefficients[k, 2]
    return Trajectory(breaks_s=knots_s, coefficients=coefficients, at_rest=False)


def flown(motion: Motion, cuts: Sequence[int], events: dict[int, Any] | None = None) -> bytes:
    """All that a flight leaves behind; an event happens to the pilot at its tick."""
    flying: Craft = motion.craft  # type: ignore[attr-defined]
    seen: list[int] = []

    def judge(first: int, end: int) -> Ending | None:
        seen.extend(range(first, end))
        return None

    for first, end in itertools.pairwise(cuts):
        decides = first % 3 < 2  # else only the sensor is due
        reference = flying.pilot.reference(first * STEP_S, STEP_S) if decides else None
        (events or {}).get(first, lambda pilot: None)(flying.pilot)
        assert motion.fly(first, end, reference, judge) is None
    assert seen == list(range(cuts[-1]))
    state = motion.state
    ends = (*(getattr(state, name) for name in ("position_m", "quaternion_wxyz", "body_rate_radps")),)
    contacts = [(one.start_s, one.end_s, *one.position_m) for one in flying.contact.contacts]
    return b"".join(np.asarray(part).tobytes() for part in (flying.recorder.rows, *ends, contacts))


def both(make_craft: Any, cuts: Sequence[int], events: dict[int, Any] | None = None) -> Compiled:
    """Fly both motions, the plain one a step at a time; returns the other one."""
    plain, fast = make_craft(), compiled_motion(make_craft(), hovering(START))
    assert fast is not None
    stepwise = Stepwise(craft=plain, state=hovering(START), estimate=hovering(START))
    assert flown(stepwise, cuts, events) == flown(fast, cuts, events)
    return fast


def cuts_of(seed: int) -> list[int]:
    inner = np.random.default_rng(seed).choice(np.arange(1, STEPS), 80, replace=False)
    return [0, *sorted(inner.tolist()), STEPS]


@pytest.mark.parametrize("names", [*itertools.product(*map(options, GROUPS))], ids="-".join)
def test_whatever_is_compiled_flies_the_same_bytes(names: tuple[str, ...]) -> None:
    def make_craft() -> Craft:
        parts = {group: build(group, name) for group, name in zip(GROUPS, names, strict=True)}
        return craft(BOARDS, swinging(0), **parts)

    shipped = names in itertools.product(
        ("position_velocity", "flatness"), ("quadrotor",), ("perfect",), ("holding",)
    )
    if compiled_motion(make_craft(), hovering(START)) is None:
        assert not shipped
    else:
        both(make_craft, range(0, STEPS + 1, 5))


@pytest.mark.parametrize("seed", [0, 1, 2, 4, 5, 6])  # 3 flies past the boards
def test_wherever_it_is_cut_and_whatever_it_meets(seed: int) -> None:
    fast = both(partial(craft, BOARDS, swinging(seed), 1 + seed % 3), cuts_of(seed))
    assert len(fast.craft.contact.contacts) > 0, "the boards are in the way"


def test_through_all_that_a_pilot_does_between_two_ticks() -> None:
    later = replace(swinging(1), breaks_s=swinging(1).breaks_s + 0.42)
    goal = Goal(position_m=START, is_target=True, score=0.0, yaw_rad=-2.9)

    def look(yaw_rad: float, pilot: Any) -> None:
        pilot.best_goal = replace(goal, yaw_rad=yaw_rad)

    events = {
        40: lambda pilot: setattr(pilot, "_pending", Flown(trajectory=later, goal=goal, moves_s=0.7)),
        100: partial(look, -2.9),
        150: partial(look, math.nan),
        200: lambda pilot: pilot._brake(see(room(), 2.0, pilot.reference(2.0, 0.0)), "told to"),
    }
    both(partial(craft, OPEN, None), range(0, STEPS + 1, 10), events)


def test_at_the_pace_that_the_safety_sets() -> None:
    """Slower, at rest, and delayed from then on."""
    own_s, rate = np.linspace(0.9, 1.5, 31), np.linspace(1.0, 0.0, 31)

    def slow(pilot: Any) -> None:
        pilot.flown = replace(pilot.flown, pace=pace_over(0.9, own_s, rate, 0.005))

    def go_on(pilot: Any) -> None:
        seen = see(room(), 2.7, pilot.reference(2.7, 0.0))
        pilot.flown = pilot.flown.repaced(seen, NoBrake().begin(LIMITS), stops=False)

    both(partial(craft, OPEN, swinging(2)), range(0, STEPS + 1, 10), {90: slow, 270: go_on})


def test_a_flight_that_ends_between_two_ticks_is_told_the_step() -> None:
    for motion in (
        compiled_motion(craft(trajectory=swinging(0)), hovering(START)),
        Stepwise(craft=craft(trajectory=swinging(0)), state=hovering(START), estimate=hovering(START)),
    ):
        assert motion is not None

        def judge(first: int, end: int) -> Ending | None:
            return Ending(13, Outcome.REACHED) if end > 13 else None

        reference = motion.craft.pilot.reference(0.0, STEP_S)
        assert motion.fly(0, 20, reference, judge) == (13, Outcome.REACHED)


def test_a_subclass_and_movers_fly_step_by_step() -> None:
    class Own(PositionVelocity):
        """Whatever it does at each command must be done."""

    assert compiled_motion(craft(controller=Own()), hovering(START)) is None
    among = craft(scene_of(((90, 90, 90), (91, 91, 91))))
    one = np.zeros((1, 3))
    bodies = Bodies(
        time_s=0.0, shape=np.zeros(1, np.uint8), half_size_m=one + 0.1, position_m=one + 9.0, velocity_mps=one
    )
    among.contact.scene.place(bodies)
    assert compiled_motion(among, hovering(START)) is None


@pytest.mark.parametrize(("strategy", "safety"), [("mcr", "brake"), ("ssp", "brake"), ("safe", "committed")])
def test_a_whole_flight_is_the_same(strategy: str, safety: str, monkeypatch: pytest.MonkeyPatch) -> None:
    values = {
        "strategy": strategy, "seed": 2, "world": "random_columns", "world.size_m": [8.0, 6.0, 2.6],
        "world.density_per_m2": 0.25, "stuck_s": 3.0, "safety": safety,
    }  # fmt: skip
    logs = [uavexp.fly(**values).log]
    monkeypatch.setattr(trial, "compiled_motion", lambda craft, state: None)
    logs.append(uavexp.fly(**values).log)
    fast, plain = (arrays_digest(log_arrays(log)) for log in logs)
    assert fast == plain
