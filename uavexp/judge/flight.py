"""A recording in a building as a log and a world, so that the metrics and pictures of every flight apply."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from uavexp.arrays import Float
from uavexp.config.build import build
from uavexp.config.composition import Composer
from uavexp.config.overrides import parse_settings, quoted
from uavexp.errors import ConfigError, RecordError
from uavexp.geometry import multiply_quaternions, quaternion_from_yaw, rotation_from_quaternion, yaw_of
from uavexp.judge.recording import Plan, Recording, Track, at, departure_m, nearest
from uavexp.log import Replan, Steps, Ticks, TrialLog
from uavexp.scene import Scene
from uavexp.types import Difficulty, Outcome, PlanStatus, World
from uavexp.world.file import MAP_MARGIN_M, File
from uavexp.world.survey import Survey

_LEAST_STEP_S = 0.002
_AROUND_M = 3.0  # shown around a flight without a building
_OUTSIDE_M, _OUTSIDE_SHARE = (
    0.5,
    0.1,
)  # farther beyond the building's box than this, more often: another frame
_CROSSINGS, _CROSSING_EVERY_M = 3, 5.0  # through surfaces, so many and so often: another frame
_STALE_S = 0.5  # a setpoint older than this is none
_NO_PLAN = np.zeros((0, 3), dtype=np.float32)


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """Where the recording's origin stands in the building, and how it is turned."""

    position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw_rad: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """A recorded flight in a building, or in none."""

    log: TrialLog
    world: World
    notes: tuple[str, ...]


def judged(recording: Recording, path: str | None, settings: Sequence[str], pose: Pose) -> Judged:
    """Put a recording into a building.

    Args:
        recording: of `readers.read`.
        path: file of the building; None: there is none, and no clearance.
        settings: of its reading, e.g. "world.unit_m=0.001".
        pose: of the recording's origin in the building.

    Raises:
        WorldError: the building cannot be read.
        RecordError: the flight does not lie in it.
    """
    survey = None if path is None else _survey(path, settings)
    origin_m = np.zeros(3) if survey is None else survey.building.origin_m
    recording = _placed(recording, pose, np.array(pose.position_m) - origin_m)
    log = log_of(recording)
    world = _world(log, survey)
    notes: tuple[str, ...] = recording.notes
    if survey is not None:
        log = replace(log, steps=replace(log.steps, clearance_m=_clearance_m(log, survey)))
        notes = (*notes, *survey.building.notes, *_checked_frame(log, survey, recording))
    return Judged(log=log, world=world, notes=notes)


def log_of(recording: Recording) -> TrialLog:
    """The flight on even steps of the recording's usual time between positions; time begins at 0."""
    begin_s, end_s = recording.position_m.time_s[[0, -1]].tolist()
    step_s = max(round(float(np.median(np.diff(recording.position_m.time_s))), 6), _LEAST_STEP_S)
    time_s = step_s * np.arange(round((end_s - begin_s) / step_s) + 1)
    clock_s = np.minimum(begin_s + time_s, end_s)
    position_m = at(recording.position_m, clock_s)
    nothing = np.full_like(position_m, math.nan)
    turned = recording.quaternion_wxyz
    steps = Steps(
        time_s=time_s,
        position_m=position_m,
        velocity_mps=np.gradient(position_m, step_s, axis=0)
        if recording.velocity_mps is None
        else at(recording.velocity_mps, clock_s),
        quaternion_wxyz=np.tile([1.0, 0.0, 0.0, 0.0], (len(time_s), 1))
        if turned is None
        else nearest(turned, clock_s),
        estimated_position_m=nothing,
        reference_position_m=nothing
        if recording.reference_m is None
        else at(recording.reference_m, clock_s, _STALE_S),
        reference_acceleration_mps2=nothing,
        clearance_m=nothing[:, 0],
    )
    none = np.zeros(0)
    return TrialLog(
        outcome=Outcome.TIMEOUT,  # what it was meant to reach stands nowhere; nothing that is told reads this
        reason="",
        step_s=step_s,
        steps=steps,
        ticks=Ticks(
            tick_s=none, esdf_clearance_m=none, changed_voxels=np.zeros(0, np.int64), decision_score=none
        ),
        replans=_replans(recording, begin_s),
        dropped_triggers=0,
        contacts=(),
        goals_m=np.zeros((0, 3)),
        seen_share=math.nan,
        mapped_m=_NO_PLAN,
    )


def _replans(recording: Recording, begin_s: float) -> tuple[Replan, ...]:
    plans = recording.plans or ()
    before = (None, *plans)
    return tuple(_replan(recording, begin_s, plan, old) for old, plan in zip(before, plans, strict=False))


def _replan(recording: Recording, begin_s: float, plan: Plan, old: Plan | None) -> Replan:
    change_m = math.nan if old is None or not len(plan.path_m) else departure_m(old.path_m, plan.path_m)
    position_m = at(recording.position_m, np.array([plan.time_s]))[0]
    return Replan(
        time_s=plan.time_s - begin_s,
        effective_s=plan.time_s - begin_s,
        cause="first" if old is None else plan.cause,
        score=0.0,
        position_m=position_m,
        goal_m=plan.path_m[-1] if len(plan.path_m) else position_m,
        status=PlanStatus.OK,
        reason="",
        path_change_m=change_m,
        iterations=0,
        expansions=0,
        near_change=False,
        changed_m=_NO_PLAN,
        trajectory_m=plan.path_m.astype(np.float32),
    )


def _placed(recording: Recording, pose: Pose, position_m: Float) -> Recording:
    """The recording in the building's frame."""
    turn = quaternion_from_yaw(pose.yaw_rad)
    rotation = rotation_from_quaternion(turn)

    def moved(track: Track | None, offset_m: Float) -> Track | None:
        return None if track is None else replace(track, values=track.values @ rotation.T + offset_m)

    turned = recording.quaternion_wxyz
    position = moved(recording.position_m, position_m)
    assert position is not None
    return replace(
        recording,
        position_m=position,
        velocity_mps=moved(recording.velocity_mps, np.zeros(3)),
        reference_m=moved(recording.reference_m, position_m),
        quaternion_wxyz=None
        if turned is None
        else replace(turned, values=np.array([multiply_quaternions(turn, q) for q in turned.values])),
        plans=None
        if recording.plans is None
        else tuple(replace(plan, path_m=plan.path_m @ rotation.T + position_m) for plan in recording.plans),
    )


def _survey(path: str, settings: Sequence[str]) -> Survey:
    words = ["world=file", f"world.path={quoted(path)}", *settings]
    command = Composer().command(parse_settings(words))
    maker = build(command.cells[0].config).world
    if len(command.cells) > 1 or not isinstance(maker, File):
        raise ConfigError("a flight is judged in one building: give one value of each world.KEY=VALUE")
    return maker.survey()


def _world(log: TrialLog, survey: Survey | None) -> World:
    """The building with the flight's first and last place as its task; no shortest path is known."""
    places_m = log.steps.position_m
    box_m = np.stack([places_m.min(axis=0), places_m.max(axis=0)]) + np.array([[-_AROUND_M], [_AROUND_M]])
    bounds_m = box_m if survey is None else survey.flight_bounds_m
    margin_m = 0.0 if survey is None else MAP_MARGIN_M
    world = World(
        name="no building" if survey is None else survey.path.rsplit("/", 1)[-1],
        vertices_m=np.zeros((0, 3), np.float32),
        triangles=np.zeros((0, 3), np.int32),
        bounds_m=bounds_m + np.array([[-margin_m], [margin_m]]),
        flight_bounds_m=bounds_m,
        start_m=places_m[0],
        start_yaw_rad=yaw_of(log.steps.quaternion_wxyz[0]),
        target_m=places_m[-1],
        shortest_path=np.zeros((0, 3)),
        difficulty=Difficulty(
            clutter_density=math.nan,
            narrowest_gap_m=math.nan,
            straight_line_m=float(np.linalg.norm(places_m[-1] - places_m[0])),
            shortest_path_m=math.nan,
        ),
        digest="",
    )
    if survey is None:
        return world
    building = survey.building
    return replace(world, vertices_m=building.vertices_m, triangles=building.triangles, space=building.space)


def _clearance_m(log: TrialLog, survey: Survey) -> Float:
    places_m = log.steps.position_m
    distance_m = survey.scene.fixed_distance_m(places_m)
    return np.where(survey.building.space.is_solid(places_m), -distance_m, distance_m)


def _checked_frame(log: TrialLog, survey: Survey, recording: Recording) -> list[str]:
    """A note of surfaces that the path crosses.

    Raises:
        RecordError: so many, or so much of the path outside the building, that the frames cannot be the same.
    """
    where, places_m = recording.path, log.steps.position_m
    vertices_m = survey.building.vertices_m.astype(np.float64)
    low_m, high_m = vertices_m.min(axis=0), vertices_m.max(axis=0)
    beyond_m = np.maximum(low_m - places_m, places_m - high_m).max(axis=1)
    share = float(np.mean(beyond_m > _OUTSIDE_M))
    mend = "say where its origin stands in the building: --at X Y Z YAW_DEG"
    if share > _OUTSIDE_SHARE:
        box = f"{_text(low_m)} to {_text(high_m)}"
        flown = f"{_text(places_m.min(axis=0))} to {_text(places_m.max(axis=0))}"
        raise RecordError(
            f"{where}: {share:.0%} of the flight, {flown} m, lies outside {survey.path}, {box} m; {mend}"
        )
    crossings, length_m = _crossings(survey.scene, places_m)
    if crossings >= _CROSSINGS and crossings * _CROSSING_EVERY_M > length_m:
        raise RecordError(
            f"{where}: the flight goes through surfaces of {survey.path} {crossings} times in "
            f"{length_m:.0f} m; {mend}"
        )
    return [f"the path goes through surfaces of the building {crossings} times"] if crossings else []


def _crossings(scene: Scene, places_m: Float) -> tuple[int, float]:
    """How often a path (N, 3) goes through a surface, and its length m."""
    along_m = np.diff(places_m, axis=0)
    length_m = np.linalg.norm(along_m, axis=1)
    moves = length_m > 1e-4
    rays = np.concatenate([places_m[:-1][moves], along_m[moves]], axis=1).astype(np.float32)
    hit, _ = scene.fixed_cast(rays)
    return int(np.count_nonzero(hit < 1.0)), float(length_m.sum())


def _text(point_m: Float) -> str:
    return "[" + ", ".join(f"{value:.1f}" for value in point_m) + "]"
