"""Collects the rows of a trial's log while it flies, and the clock times beside it."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from uavexp.arrays import Float, Float32, Int32
from uavexp.bodies import distance_m
from uavexp.field import OCCUPIED, DistanceField
from uavexp.log import (
    Contact,
    FirstPlan,
    Inspection,
    MoverRows,
    PlanLimits,
    Replan,
    Steps,
    Ticks,
    TrackRows,
    TrialLog,
)
from uavexp.map_grid import map_grid
from uavexp.mission.base import Flown
from uavexp.path_clearance import clearance_ahead_m
from uavexp.scene import Scene
from uavexp.seen_share import seen_share, seen_so_far
from uavexp.types import (
    Bodies,
    Limits,
    Observation,
    Outcome,
    PlanResult,
    Reference,
    State,
    Tracks,
)

_COLUMNS = 19
_POSITION, _VELOCITY, _QUATERNION = slice(0, 3), slice(3, 6), slice(6, 10)
_ESTIMATED, _REFERENCE, _ACCELERATION = slice(10, 13), slice(13, 16), slice(16, 19)
_Tick = tuple[float, float, int, float, float]


def times_s(first: int, end: int, step_s: float) -> Float:
    """Times (N,) of the steps from the first to before the second."""
    return np.asarray(step_s * np.arange(first, end), dtype=np.float64)


@dataclass(slots=True)
class Stopwatch:
    """Clock times of the parts; measured beside the flight, never an input to it."""

    laps_s: dict[str, list[float]] = field(default_factory=dict)

    def lap(self, name: str) -> Lap:
        """Time a `with` block under this name."""
        return Lap(self, name)

    def add(self, name: str, lap_s: float) -> None:
        """Add a lap that was timed elsewhere."""
        self.laps_s.setdefault(name, []).append(lap_s)


class Lap:
    """A block that is being timed; many are, so nothing but that is done."""

    __slots__ = ("_begin_s", "_name", "_watch")

    def __init__(self, watch: Stopwatch, name: str) -> None:
        self._watch = watch
        self._name = name

    def __enter__(self) -> None:
        self._begin_s = time.perf_counter()

    def __exit__(self, *_: object) -> None:
        self._watch.add(self._name, time.perf_counter() - self._begin_s)


class Recorder:
    """Rows of the log: one per step, one per ESDF update, and the goals pursued.

    Args:
        steps: of the flight at most.
        step_s: of each.

    Attributes:
        rows: (steps, 19), each step in its own: true position, velocity and attitude, estimated
            position, position and acceleration of the reference.
    """

    def __init__(self, steps: int, step_s: float) -> None:
        self.rows = np.empty((steps, _COLUMNS))
        self._step_s = step_s
        self._ticks: list[_Tick] = []
        self._occupied: list[Int32] = []  # voxels found so, one array per ESDF update
        self._first_seen: list[Int32] = []  # the same of those seen for the first time
        self._goals_m: list[Float] = []
        self._bodies: list[Bodies] = []  # one per step, if there are any
        self._tracks: list[Tracks] = []  # one per ESDF update

    def step(self, step: int, state: State, estimate: State, reference: Reference, bodies: Bodies) -> None:
        """Write the row of one simulation step."""
        if len(bodies):
            self._bodies.append(bodies)
        row = self.rows[step]
        row[_POSITION] = state.position_m
        row[_VELOCITY] = state.velocity_mps
        row[_QUATERNION] = state.quaternion_wxyz
        row[_ESTIMATED] = estimate.position_m
        row[_REFERENCE] = reference.position_m
        row[_ACCELERATION] = reference.acceleration_mps2

    def flown(self, first: int, end: int) -> Flown:
        """What a mission is shown of the steps from the first to before the second."""
        rows = self.rows[first:end]
        time_s = times_s(first, end, self._step_s)
        return Flown(time_s, rows[:, _POSITION], rows[:, _QUATERNION], rows[:, _ESTIMATED])

    def tick(self, observation: Observation, score: float) -> None:
        """Add the row of one ESDF update, and the goal if it is a new one.

        The observation is the one that was decided on: a plan asked for in this very tick is not
        flown yet, so a policy that answers at once has no delay.
        """
        clearance_m = float(observation.field.distance_m(observation.state.position_m[None])[0])
        changed = len(observation.update.voxel)
        self._ticks.append(
            (observation.time_s, clearance_m, changed, score, remaining_clearance_m(observation))
        )
        self._occupied.append(observation.update.voxel[observation.update.occupied])
        self._first_seen.append(observation.update.voxel[observation.update.first_seen])
        self._tracks.append(observation.tracks)
        goal = observation.goal
        if goal is not None and not (self._goals_m and np.array_equal(self._goals_m[-1], goal.position_m)):
            self._goals_m.append(goal.position_m)

    def moved_m(self, step: int, steps: int) -> float:
        """Largest distance from the position at a step in the so many before it; inf without so many."""
        if step < steps:
            return math.inf
        recent_m = self.rows[step - steps : step + 1 : 100, _POSITION]
        return float(np.linalg.norm(recent_m - self.rows[step, _POSITION], axis=1).max())

    def log(
        self,
        *,
        last_step: int,
        outcome: Outcome,
        reason: str,
        scene: Scene,
        field: DistanceField,
        replans: tuple[Replan, ...],
        dropped_triggers: int,
        contacts: tuple[Contact, ...],
        reachable_m: Float | None,
        first_plan: PlanResult | None,
        limits: Limits,
        inspection: Inspection,
        watch: Stopwatch,
    ) -> TrialLog:
        """Return the finished log; true clearances are measured here, all at once.

        `reachable_m` (E, 3) is the volume of which a share is seen; None: the flight has a target.
        """
        shares = np.zeros(0)
        if reachable_m is not None:
            shares = seen_so_far(field, reachable_m, self._first_seen)
        mapped = np.flatnonzero(field.state == OCCUPIED)
        rows = self.rows[: last_step + 1]
        position_m = rows[:, _POSITION]
        fixed_m, mover_m = scene.fixed_clearance_m(position_m), _mover_distance_m(position_m, self._bodies)
        return TrialLog(
            outcome=outcome,
            reason=reason,
            step_s=self._step_s,
            steps=_step_rows(rows, self._step_s, np.minimum(fixed_m, mover_m) if mover_m.size else fixed_m),
            ticks=replace(_tick_rows(self._ticks), seen_so_far=shares),
            replans=replans,
            dropped_triggers=dropped_triggers,
            contacts=(*contacts, *_inside_solids(fixed_m, position_m, contacts, self._step_s)),
            goals_m=np.array(self._goals_m).reshape(-1, 3),
            seen_share=math.nan if reachable_m is None else seen_share(field, reachable_m),
            mapped_m=field.voxel_centres_m(mapped).astype(np.float32),
            grid=map_grid(field, mapped, self._occupied, [row[0] for row in self._ticks]),
            movers=_mover_rows(self._bodies, mover_m, len(rows)),
            tracks=_track_rows(self._tracks),
            first_plan=_first_plan(first_plan),
            limits=PlanLimits(
                max_speed_mps=limits.max_speed_mps,
                max_acceleration_mps2=limits.max_acceleration_mps2,
                body_radius_m=limits.body_radius_m,
            ),
            inspection=inspection,
            wall_s={name: np.array(laps) for name, laps in watch.laps_s.items()},
        )


def _step_rows(rows: Float, step_s: float, clearance_m: Float) -> Steps:
    return Steps(
        time_s=times_s(0, len(rows), step_s),
        position_m=rows[:, _POSITION].copy(),
        velocity_mps=rows[:, _VELOCITY].copy(),
        quaternion_wxyz=rows[:, _QUATERNION].copy(),
        estimated_position_m=rows[:, _ESTIMATED].copy(),
        reference_position_m=rows[:, _REFERENCE].copy(),
        reference_acceleration_mps2=rows[:, _ACCELERATION].copy(),
        clearance_m=clearance_m,
    )


def _tick_rows(rows: Sequence[_Tick]) -> Ticks:
    tick_s, esdf_m, changed, score, remaining_m = zip(*rows, strict=True)
    return Ticks(
        tick_s=np.array(tick_s),
        esdf_clearance_m=np.array(esdf_m),
        changed_voxels=np.array(changed, dtype=np.int64),
        decision_score=np.array(score),
        remaining_clearance_m=np.array(remaining_m),
    )


def _mover_rows(bodies: Sequence[Bodies], clearance_m: Float, steps: int) -> MoverRows:
    if not bodies:
        return MoverRows(position_m=np.zeros((steps, 0, 3), dtype=np.float32))
    return MoverRows(
        shape=bodies[0].shape,
        half_size_m=bodies[0].half_size_m,
        position_m=np.stack([now.position_m for now in bodies]).astype(np.float32),
        clearance_m=clearance_m,
    )


def _track_rows(tracks: Sequence[Tracks]) -> TrackRows:
    return TrackRows(
        count=np.array([len(now) for now in tracks], dtype=np.int64),
        identity=np.concatenate([now.identity for now in tracks]),
        position_m=np.concatenate([now.position_m for now in tracks]),
        velocity_mps=np.concatenate([now.velocity_mps for now in tracks]),
        swerve_m=_swerves_m(tracks),
    )


def _swerves_m(tracks: Sequence[Tracks]) -> Float32:
    """Swerves (S, K, 3), as far as any is predicted; empty without."""
    steps = max(now.swerve_m.shape[1] for now in tracks)
    if steps == 0:
        return TrackRows().swerve_m
    parts = [now.swerve_m if now.swerve_m.size else np.zeros((len(now), steps, 3)) for now in tracks]
    return np.concatenate(parts).astype(np.float32)


def _first_plan(plan: PlanResult | None) -> FirstPlan:
    if plan is None or plan.trajectory is None:
        return FirstPlan()
    return FirstPlan(
        path_m=plan.path_m,
        breaks_s=plan.trajectory.breaks_s,
        coefficients=plan.trajectory.coefficients,
        history=plan.history,
        tree_m=plan.tree_m.astype(np.float32),
        collision_checks=plan.collision_checks,
    )


def _inside_solids(
    clearance_m: Float, position_m: Float, contacts: Sequence[Contact], step_s: float
) -> list[Contact]:
    """Stretches of rows spent inside of a solid without a surface being met: contacts like any other.

    Args:
        clearance_m: (T,) to fixed surfaces, negative inside.
        position_m: (T, 3).
        contacts: met with surfaces and movers; a stretch during one with a surface is that one.
        step_s: between rows.
    """
    rows = np.flatnonzero(clearance_m < 0.0)
    found = []
    for run in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1) if rows.size else []:
        start_s, end_s = step_s * int(run[0]), step_s * int(run[-1])
        if not any(item.mover < 0 and item.start_s <= end_s and start_s <= item.end_s for item in contacts):
            found.append(Contact(start_s=start_s, end_s=end_s, position_m=position_m[run[0]].copy()))
    return found


def _mover_distance_m(position_m: Float, bodies: Sequence[Bodies]) -> Float:
    """Distance (T,) of the body's centre to the nearest mover, step by step; empty without movers."""
    if not bodies:
        return np.zeros(0)
    return np.array([distance_m(now, point[None])[0] for now, point in zip(bodies, position_m, strict=True)])


def remaining_clearance_m(observation: Observation) -> float:
    """Least mapped distance over what is left of the flown trajectory, m; NaN when nothing is."""
    trajectory, now_s = observation.trajectory, observation.time_s
    if trajectory is None or now_s >= trajectory.end_s:
        return math.nan
    return float(clearance_ahead_m(trajectory, observation.field, now_s).min())
