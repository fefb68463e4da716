"""Collects the rows of a trial's log while it flies, and the clock times beside it."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy import ndimage

from uavexp.arrays import Float
from uavexp.bodies import distance_m
from uavexp.field import OCCUPIED, DistanceField
from uavexp.scene import Scene
from uavexp.trigger.validity import clearance_ahead_m
from uavexp.types import (
    Bodies,
    Contact,
    Limits,
    Observation,
    Outcome,
    PlanResult,
    Reference,
    Replan,
    State,
    Tracks,
    TrialLog,
    World,
)


@dataclass(slots=True)
class Stopwatch:
    """Clock times of the parts; measured beside the flight, never an input to it."""

    laps_s: dict[str, list[float]] = field(default_factory=dict)

    @contextmanager
    def lap(self, name: str) -> Iterator[None]:
        """Time the block under this name."""
        begin = time.perf_counter()
        try:
            yield
        finally:
            self.add(name, time.perf_counter() - begin)

    def add(self, name: str, lap_s: float) -> None:
        """Add a lap that was timed elsewhere."""
        self.laps_s.setdefault(name, []).append(lap_s)


@dataclass(slots=True)
class Recorder:
    """Rows of the log: one per step, one per ESDF update, and the goals pursued."""

    steps: list[tuple[float, Float, Float, Float, Float, Float, Float]] = field(default_factory=list)
    ticks: list[tuple[float, float, int, float, float]] = field(default_factory=list)
    goals_m: list[Float] = field(default_factory=list)
    bodies: list[Bodies] = field(default_factory=list)  # one per step
    tracks: list[Tracks] = field(default_factory=list)  # one per ESDF update

    def step(
        self, time_s: float, state: State, estimate: State, reference: Reference, bodies: Bodies
    ) -> None:
        """Add the row of one simulation step."""
        self.bodies.append(bodies)
        self.steps.append(
            (
                time_s,
                state.position_m,
                state.velocity_mps,
                state.quaternion_wxyz,
                estimate.position_m,
                reference.position_m,
                reference.acceleration_mps2,
            )
        )

    def tick(self, observation: Observation, score: float) -> None:
        """Add the row of one ESDF update, and the goal if it is a new one.

        The observation is the one that was decided on: a plan asked for in this very tick is not
        flown yet, so a policy that answers at once has no delay.
        """
        clearance_m = float(observation.field.distance_m(observation.state.position_m[None])[0])
        changed = len(observation.update.voxel)
        self.ticks.append(
            (observation.time_s, clearance_m, changed, score, remaining_clearance_m(observation))
        )
        self.tracks.append(observation.tracks)
        goal = observation.goal
        if goal is not None and not (self.goals_m and np.array_equal(self.goals_m[-1], goal.position_m)):
            self.goals_m.append(goal.position_m)

    def moved_m(self, steps: int) -> float:
        """Largest distance from the present position in the last so many steps; inf before that."""
        if len(self.steps) <= steps:
            return math.inf
        recent_m = np.stack([row[1] for row in self.steps[-steps - 1 :: 100]])
        return float(np.linalg.norm(recent_m - self.steps[-1][1], axis=1).max())

    def log(
        self,
        *,
        outcome: Outcome,
        reason: str,
        step_s: float,
        scene: Scene,
        field: DistanceField,
        replans: tuple[Replan, ...],
        dropped_triggers: int,
        contacts: tuple[Contact, ...],
        seen_share: float,
        first_plan: PlanResult | None,
        limits: Limits,
        mission: Mapping[str, Any],
        watch: Stopwatch,
    ) -> TrialLog:
        """Return the finished log; true clearances are measured here, all at once."""
        times, position, velocity, quaternion, estimated, reference, acceleration = zip(
            *self.steps, strict=True
        )
        tick_s, esdf_m, changed, score, remaining_m = zip(*self.ticks, strict=True)
        mapped = np.flatnonzero(field.state == OCCUPIED)
        fixed_m, mover_m = (
            scene.fixed_distance_m(np.stack(position)),
            _mover_distance_m(position, self.bodies),
        )
        return TrialLog(
            outcome=outcome,
            reason=reason,
            step_s=step_s,
            time_s=np.array(times),
            position_m=np.stack(position),
            velocity_mps=np.stack(velocity),
            quaternion_wxyz=np.stack(quaternion),
            estimated_position_m=np.stack(estimated),
            reference_position_m=np.stack(reference),
            reference_acceleration_mps2=np.stack(acceleration),
            clearance_m=np.minimum(fixed_m, mover_m) if mover_m.size else fixed_m,
            tick_s=np.array(tick_s),
            esdf_clearance_m=np.array(esdf_m),
            changed_voxels=np.array(changed, dtype=np.int64),
            decision_score=np.array(score),
            remaining_clearance_m=np.array(remaining_m),
            replans=replans,
            dropped_triggers=dropped_triggers,
            contacts=contacts,
            goals_m=np.array(self.goals_m).reshape(-1, 3),
            seen_share=seen_share,
            **_plan_fields(first_plan),
            **mission,
            max_speed_mps=limits.max_speed_mps,
            max_acceleration_mps2=limits.max_acceleration_mps2,
            body_radius_m=limits.body_radius_m,
            mapped_m=field.voxel_centres_m(mapped).astype(np.float32),
            mover_shape=self.bodies[0].shape,
            mover_half_size_m=self.bodies[0].half_size_m,
            mover_position_m=np.stack([bodies.position_m for bodies in self.bodies]).astype(np.float32),
            mover_clearance_m=mover_m,
            track_count=np.array([len(tracks) for tracks in self.tracks], dtype=np.int64),
            track_identity=np.concatenate([tracks.identity for tracks in self.tracks]),
            track_position_m=np.concatenate([tracks.position_m for tracks in self.tracks]),
            track_velocity_mps=np.concatenate([tracks.velocity_mps for tracks in self.tracks]),
            wall_s={name: np.array(laps) for name, laps in watch.laps_s.items()},
        )


def _plan_fields(plan: PlanResult | None) -> dict[str, Any]:
    """The log's fields on the first plan; those of a flight without one keep their defaults."""
    if plan is None or plan.trajectory is None:
        return {}
    return {
        "plan_path_m": plan.path_m,
        "plan_breaks_s": plan.trajectory.breaks_s,
        "plan_coefficients": plan.trajectory.coefficients,
        "plan_history": plan.history,
        "plan_tree_m": plan.tree_m.astype(np.float32),
        "plan_collision_checks": plan.collision_checks,
    }


def _mover_distance_m(position_m: Sequence[Float], bodies: Sequence[Bodies]) -> Float:
    """Distance (T,) of the body's centre to the nearest mover, step by step; empty without movers."""
    if not len(bodies[0]):
        return np.zeros(0)
    return np.array([distance_m(now, point[None])[0] for now, point in zip(bodies, position_m, strict=True)])


def remaining_clearance_m(observation: Observation) -> float:
    """Least mapped distance over what is left of the flown trajectory, m; NaN when nothing is."""
    trajectory, now_s = observation.trajectory, observation.time_s
    if trajectory is None or now_s >= trajectory.end_s:
        return math.nan
    return float(clearance_ahead_m(trajectory, observation.field, now_s).min())


def seen_share(
    world: World, scene: Scene, field: DistanceField, limits: Limits, cell_m: float = 0.25
) -> float:
    """Observed share of the reachable volume, 0 to 1.

    Reachable: cells of the flight bounds whose true clearance exceeds the body's radius,
    face-connected to the start.
    """
    low, high = world.flight_bounds_m
    axes = [np.arange(low[axis] + 0.5 * cell_m, high[axis], cell_m) for axis in range(3)]
    cells_m = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    clear = scene.distance_m(cells_m.reshape(-1, 3)).reshape(cells_m.shape[:3]) > limits.body_radius_m
    label, _ = ndimage.label(clear)
    start = np.unravel_index(
        np.argmin(np.where(clear, np.linalg.norm(cells_m - world.start_m, axis=-1), np.inf)), clear.shape
    )
    reachable = label == label[start]
    return float(field.observed(cells_m[reachable]).mean())
