"""The closed loop: sense, map, choose a goal, decide whether to replan, plan, control, fly."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Annotated

import numpy as np

from uavexp.answers import ask
from uavexp.controller.base import Controller
from uavexp.detection.base import Detection
from uavexp.errors import require
from uavexp.estimator.base import Estimator
from uavexp.explorer.base import Explorer
from uavexp.finite import finite
from uavexp.geometry import quaternion_from_yaw
from uavexp.log import TrialLog
from uavexp.mapping.base import MapBackend
from uavexp.mission.base import Mission
from uavexp.mission.goto import Goto
from uavexp.motion.base import Craft, Ending, Judge, Motion
from uavexp.motion.compiled import compiled_motion
from uavexp.motion.stepwise import Stepwise
from uavexp.movers.base import Movers
from uavexp.parameters import NonNegative, Positive, Whole, between, option
from uavexp.passage import check_passage
from uavexp.pilot.base import Crew, Pilot
from uavexp.pilot.recovering import is_shut_in
from uavexp.planner.base import Planner
from uavexp.recorder import Recorder, Stopwatch
from uavexp.safety.base import Safety
from uavexp.scene import Scene
from uavexp.seeding import Stream, generator, only_seeded_draws
from uavexp.seen_share import reachable_m
from uavexp.sensor.base import Sensor
from uavexp.trigger.base import TriggerPolicy
from uavexp.types import Limits, MapUpdate, Observation, Outcome, Reference, State, Tracks, World
from uavexp.vehicle.base import Vehicle
from uavexp.vehicle.contact import ContactTracker
from uavexp.world.base import WorldGenerator

Progress = Callable[[float, str], None]  # simulated time s, a few words; NaN: a note of the world
_LOOK_STEPS = 100  # steps between two looks at whether the vehicle still moves
_MOST_STEPS = 10_000_000  # of a flight: a day at 0.01 s, and 1.5 GB
_STILL_M = 0.3  # moved less in `stuck_s`: stuck


@option(frozen=True)
class Parts:
    """One component per role and the few numbers that belong to no role."""

    world: WorldGenerator
    sensor: Sensor
    estimator: Estimator
    mapping: MapBackend
    explorer: Explorer
    trigger: TriggerPolicy
    planner: Planner
    controller: Controller
    vehicle: Vehicle
    safety: Safety
    movers: Movers
    detection: Detection
    mission: Mission
    pilot: Pilot
    world_seed: Whole | None = None  # of the layout alone; None: the trial's seed
    step_s: Annotated[float, between(1e-4, 0.1)] = 0.01
    latency_s: NonNegative = 0.03
    speed_margin: Annotated[float, between(0, 0.5)] = 0.04
    start_bubble_m: NonNegative = 0.6
    stuck_s: Positive = 20.0

    def __post_init__(self) -> None:
        steps_per(self.step_s, "latency_s", self.latency_s)
        for name, rate_hz in self.rates_hz().items():
            steps = steps_per(self.step_s, f"1 / {name}", 1.0 / rate_hz)
            require(
                steps >= 1, f"{name} must be at most 1 / step_s = {1.0 / self.step_s:g} Hz, got {rate_hz:g}"
            )

    def rates_hz(self) -> dict[str, float]:
        """The rates of all roles that have one; goals are chosen at the mission's, if it chooses them."""
        chooser = "mission" if hasattr(self.mission, "rate_hz") else "explorer"
        return {
            "sensor.rate_hz": self.sensor.rate_hz,
            "mapping.esdf_rate_hz": self.mapping.esdf_rate_hz,
            f"{chooser}.rate_hz": getattr(self, chooser).rate_hz,
            "controller.rate_hz": self.controller.rate_hz,
        }

    def tick_steps(self) -> tuple[int, int, int]:
        """Steps from one scan, one ESDF update and one choice of a goal to the next."""
        sensor, mapping, explorer, _ = (
            steps_per(self.step_s, name, 1.0 / rate_hz) for name, rate_hz in self.rates_hz().items()
        )
        return sensor, mapping, explorer


def _most_steps(parts: Parts) -> int:
    """Steps of the longest flight that the mission allows."""
    limit_s, longest_s = parts.mission.time_limit_s, _MOST_STEPS * parts.step_s
    require(
        limit_s <= longest_s,
        f"the mission allows {limit_s:g} s, at step_s = {parts.step_s:g} s at most {longest_s:g} s can be: "
        "lower mission.time_base_s or what is added to it",
    )
    return math.ceil(limit_s / parts.step_s)


def steps_per(step_s: float, name: str, duration_s: float) -> int:
    """Number of steps in a duration; raise `ConfigError` unless it is a whole number."""
    steps = round(duration_s / step_s)
    exact = math.isclose(steps * step_s, duration_s, rel_tol=1e-9, abs_tol=1e-12)
    require(exact, f"{name} = {duration_s:g} s must be a whole multiple of step_s = {step_s:g} s")
    return steps


@only_seeded_draws()
def fly_trial(parts: Parts, seed: int, progress: Progress | None = None) -> tuple[World, TrialLog]:
    """Draw the seed's world (that of `world_seed`, if set) and fly one trial in it.

    Args:
        parts: freshly built components.
        seed: the trial's seed, >= 0.
        progress: called about once a simulated second, and before with each of the world's notes.

    Returns:
        The world and the log of the flight.

    Raises:
        WorldError: when the world cannot be made.
        ConfigError: a part drew from a global generator.
    """
    world = make_world(parts, seed)
    if progress is not None:
        for note in world.notes:
            progress(math.nan, note)
    return world, fly(parts, world, seed, progress)


def make_world(parts: Parts, seed: int) -> World:
    """Draw the seed's world as it is when its flight begins.

    Raises:
        WorldError: it cannot be made, or not be flown by these parts.
    """
    layout = seed if parts.world_seed is None else parts.world_seed
    world = parts.world.generate(generator(layout, Stream.WORLD))
    if world.name == "file" and isinstance(parts.mission, Goto):  # other worlds promise their clearance
        check_passage(world, parts.planner, parts.explorer, parts.mapping)
    return parts.mission.prepare(world, generator(seed, Stream.MISSION))


def fly(parts: Parts, world: World, seed: int, progress: Progress | None = None) -> TrialLog:
    """Fly one trial in a given world; every rate is a whole number of steps (see `Parts`)."""
    flight = _begin(parts, world, seed)
    craft, motion, scene, watch = flight.craft, flight.motion, flight.scene, flight.watch
    pilot, every, tracks = craft.pilot, parts.tick_steps(), Tracks.none()

    for step, following in pairwise(flight.ticks(every)):
        time_s, reference = step * parts.step_s, None
        senses, maps, chooses = (step % steps == 0 for steps in every)
        if senses:
            with watch.lap("sense"):
                scan = parts.sensor.capture(motion.state, motion.estimate, time_s)
            if len(scene.bodies):
                with watch.lap("detect"):
                    scan, tracks = parts.detection.detect(scan, parts.mapping.field, scene.bodies)
            with watch.lap("integrate"):
                parts.mapping.integrate(scan)
        if maps:
            with watch.lap("esdf"):
                update = ask(MapUpdate, parts.mapping.update, time_s)
        if maps or chooses:
            reference = pilot.reference(time_s, parts.step_s)
            see = partial(flight.observe, time_s, reference, update, tracks)
            if chooses:
                pilot.explore(see())
            if maps:
                seen = see()
                craft.recorder.tick(seen, pilot.decide(seen))
            judge = flight.judge(see())
        with watch.lap("fly"), finite(motion, time_s):
            ending = motion.fly(step, following, reference, judge)
        if ending is not None:
            return flight.log(ending)
        if progress is not None and step % _LOOK_STEPS == 0:
            progress(time_s, f"{len(pilot.replans)} plans")
    return flight.log(Ending(following - 1, Outcome.TIMEOUT))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Flight:
    """What one trial is flown with; all of it has begun."""

    parts: Parts
    world: World
    scene: Scene
    craft: Craft
    motion: Motion
    watch: Stopwatch

    def ticks(self, every: Sequence[int]) -> list[int]:
        """Numbers of the steps at which more is due than to fly on, and of the one after the last."""
        end = len(self.craft.recorder.rows)
        return sorted({end}.union(*(range(0, end, steps) for steps in (*every, _LOOK_STEPS))))

    def observe(self, time_s: float, reference: Reference, update: MapUpdate, tracks: Tracks) -> Observation:
        """What the deciding roles see now."""
        return Observation(
            time_s=time_s,
            state=self.motion.estimate,
            reference=reference,
            trajectory=self.craft.pilot.trajectory,
            field=self.parts.mapping.field,
            update=update,
            goal=self.craft.pilot.goal,
            best_goal=self.craft.pilot.best_goal,
            target_m=self.parts.mission.target_m,
            flight_bounds_m=self.world.flight_bounds_m,
            tracks=tracks,
        )

    def judge(self, observation: Observation) -> Judge:
        """Who is asked of every step: the mission, and now and then whether the vehicle still moves."""
        pilot = self.craft.pilot

        def ending(first: int, end: int) -> Ending | None:
            found = self.parts.mission.outcome(self.craft.recorder.flown(first, end), observation)
            looks = first % _LOOK_STEPS == 0 and (found is None or found[0] > 0)
            if looks and not pilot.recovers and self._is_still(first):
                found = 0, Outcome.STUCK
            if found is not None and found[1] is Outcome.EXPLORED and pilot.recovers:
                found = None  # what is left may be beyond what it is stuck at
            if found is None and pilot.given_up is not None:
                found = 0, self._given_up(pilot.given_up)
            if found is None:
                return None
            if found[1] is Outcome.EXPLORED and is_shut_in(pilot.replans):
                found = found[0], Outcome.STUCK  # goals were given up because none could be planned to
            unplanned = (
                found[1] in (Outcome.STUCK, Outcome.UNREACHABLE, Outcome.EXPLORED) and not pilot.ever_planned
            )
            return Ending(first + found[0], Outcome.NO_PLAN if unplanned else found[1])

        return ending

    def _given_up(self, outcome: Outcome) -> Outcome:
        """What it is to a mission that nothing more can be reached."""
        nothing_left: Outcome = getattr(self.parts.mission, "nothing_left", Outcome.STUCK)
        return nothing_left if outcome is Outcome.UNREACHABLE else outcome

    def _is_still(self, step: int) -> bool:
        stuck_steps = math.ceil(self.parts.stuck_s / self.parts.step_s)
        return self.craft.recorder.moved_m(step, stuck_steps) < _STILL_M

    def log(self, ending: Ending) -> TrialLog:
        """Everything that was recorded."""
        parts, pilot, field = self.parts, self.craft.pilot, self.parts.mapping.field
        limits, exploring = parts.vehicle.limits, parts.mission.target_m is None
        return self.craft.recorder.log(
            last_step=ending.step,
            outcome=ending.outcome,
            reason=self._reason(ending.outcome),
            scene=self.scene,
            field=field,
            replans=tuple(pilot.replans),
            dropped_triggers=pilot.dropped_triggers,
            contacts=self.craft.contact.contacts,
            first_plan=pilot.first_plan,
            limits=limits,
            inspection=parts.mission.findings(),
            reachable_m=reachable_m(self.world, self.scene, limits) if exploring else None,
            watch=self.watch,
        )

    def _reason(self, outcome: Outcome) -> str:
        if outcome in (Outcome.REACHED, Outcome.EXPLORED, Outcome.INSPECTED):
            return ""
        if outcome is Outcome.TIMEOUT:
            return f"not there after {self.parts.mission.time_limit_s:g} s"
        failure = self.craft.pilot.failure
        if is_shut_in(self.craft.pilot.replans):
            return f"no plan led anywhere: {failure}"
        if self.craft.pilot.given_up is not None:
            return f"gave up: {failure}"
        why = f"; {failure}" if failure else ", and nothing asked for a new plan"
        return f"has not moved for {self.parts.stuck_s:g} s{why}"


def _hover(world: World) -> State:
    return State(
        position_m=world.start_m.copy(),
        velocity_mps=np.zeros(3),
        quaternion_wxyz=quaternion_from_yaw(world.start_yaw_rad),
        body_rate_radps=np.zeros(3),
    )


def _slower(limits: Limits, margin: float) -> Limits:
    """The limits, with a share of the speed left over."""
    return replace(limits, max_speed_mps=(1.0 - margin) * limits.max_speed_mps)


def _begin(parts: Parts, world: World, seed: int) -> _Flight:
    """Give every part its trial's context and its own random stream."""
    scene, limits, watch = Scene(world), parts.vehicle.limits, Stopwatch()
    planned, steered = (_slower(limits, share * parts.speed_margin) for share in (1.0, 0.5))
    parts.movers.reset(world, scene, limits, generator(seed, Stream.MOVERS))
    parts.detection.reset(limits, generator(seed, Stream.DETECTION))
    parts.sensor.reset(scene, generator(seed, Stream.SENSOR))
    parts.mapping.reset(world.bounds_m, scene)
    room_m = float(scene.fixed_distance_m(world.start_m[None])[0])  # what is said to be free is
    parts.mapping.mark_free(world.start_m, min(parts.start_bubble_m, room_m))
    parts.trigger.reset(limits)
    parts.planner.reset(planned, generator(seed, Stream.PLANNER))
    parts.controller.reset(steered, parts.vehicle.mass_kg)
    parts.vehicle.reset(_hover(world))
    with watch.lap("mission"):
        parts.mission.reset(world, scene, limits)
    guide = parts.mission.guide(parts.explorer)
    guide.reset(float(world.start_m[2]), limits)
    crew = Crew(
        explorer=guide,
        trigger=parts.trigger,
        planner=parts.planner,
        guard=parts.safety.begin(planned),
        limits=planned,
        latency_s=parts.latency_s,
        start_m=world.start_m.copy(),
        start_yaw_rad=world.start_yaw_rad,
        flight_bounds_m=world.flight_bounds_m,
        watch=watch,
        note_obstacle=parts.mapping.note_obstacle,
    )
    scene.place(parts.movers.at(0.0))
    hover = _hover(world)
    craft = Craft(
        pilot=parts.pilot.begin(crew),
        controller=parts.controller,
        vehicle=parts.vehicle,
        believe=parts.estimator.begin(generator(seed, Stream.ESTIMATOR)),
        movers=parts.movers,
        contact=ContactTracker(scene=scene, body_size_m=limits.body_size_m),
        recorder=Recorder(_most_steps(parts) + 1, parts.step_s),
        step_s=parts.step_s,
        command_steps=steps_per(parts.step_s, "controller.rate_hz", 1.0 / parts.controller.rate_hz),
    )
    return _Flight(
        parts=parts,
        world=world,
        scene=scene,
        craft=craft,
        motion=compiled_motion(craft, hover) or Stepwise(craft=craft, state=hover, estimate=hover),
        watch=watch,
    )
