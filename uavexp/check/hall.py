"""A straight flight along a hall, and what a replanning policy sees on it."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from uavexp.arrays import Bool, Float
from uavexp.braking import with_stop
from uavexp.check.fields import box, empty, field_from
from uavexp.field import DistanceField
from uavexp.geometry import quaternion_from_yaw
from uavexp.trajectory import Trajectory, evaluate
from uavexp.types import Goal, Limits, MapUpdate, Observation, Reference, State

LIMITS = Limits(
    max_speed_mps=2.5, max_acceleration_mps2=2.5, max_body_rate_radps=2.0, body_size_m=(0.32, 0.32, 0.12)
)
# Straight along x at 1 m/s, y = 2.05, z = 1.05, from t = 1 s to 6 s.
STRAIGHT = Trajectory(
    breaks_s=np.array([1.0, 6.0]),
    coefficients=np.array([[[0.5, 2.05, 1.05], [1.0, 0.0, 0.0]]]),
    at_rest=False,
)
FLOWN = with_stop(STRAIGHT, LIMITS)  # what is flown when no further plan arrives
SHIFT_M = np.array([3.7, -2.2, 0.5])  # (3,) to a hall that stands elsewhere
PILLAR = ((4.0, 2.0, 0.0), (4.2, 2.2, 2.0))


def hovering(position_m: Float | tuple[float, float, float], yaw_rad: float = 0.0) -> State:
    """A vehicle that stands still, level."""
    return State(
        position_m=np.array(position_m, dtype=np.float64),
        velocity_mps=np.zeros(3),
        quaternion_wxyz=quaternion_from_yaw(yaw_rad),
        body_rate_radps=np.zeros(3),
    )


def room(*boxes: tuple[tuple[float, ...], tuple[float, ...]], unknown: Bool | None = None) -> DistanceField:
    """A map of 7 x 4 x 2 m, free but for boxes (lower and upper corner) and unknown voxels."""
    grid = empty((7.0, 4.0, 2.0))
    for low, high in boxes:
        box(grid, low, high)
    return field_from(grid, max_distance_m=2.0, unknown=unknown)


def change(before: DistanceField, after: DistanceField, first_seen: bool = False) -> MapUpdate:
    """The change log between two maps."""
    voxel = np.flatnonzero(before.distance != after.distance).astype(np.int32)
    return MapUpdate(
        time_s=0.0,
        voxel=voxel,
        old_distance_m=before.distance.ravel()[voxel],
        new_distance_m=after.distance.ravel()[voxel],
        first_seen=np.full(len(voxel), first_seen),
        occupied=after.state.ravel()[voxel] == 2,
    )


def goal_at(x: float, is_target: bool = False) -> Goal:
    """A goal on the line of the straight flight."""
    return Goal(position_m=np.array([x, 2.05, 1.05]), is_target=is_target, score=0.0)


def observe(
    field: DistanceField,
    update: MapUpdate | None = None,
    time_s: float = 1.5,
    goal: Goal | None = None,
    best: Goal | None = None,
    trajectory: Trajectory = STRAIGHT,
) -> Observation:
    """What is seen at one check; without an update, that nothing changed."""
    zero = np.zeros(3)
    return Observation(
        time_s=time_s,
        state=hovering(zero),
        reference=Reference(position_m=zero, velocity_mps=zero, acceleration_mps2=zero, yaw_rad=0.0),
        trajectory=trajectory,
        field=field,
        update=change(field, field) if update is None else update,
        goal=goal,
        best_goal=best,
        target_m=None,
        flight_bounds_m=np.zeros((2, 3)),
    )


def _maps() -> Iterator[DistanceField]:
    """The hall at 10 Hz: unknown recedes, at t = 2.5 s a pillar shows on the line, at 4 s it is gone."""
    for tick in range(60):
        unknown = empty((7.0, 4.0, 2.0))
        unknown[30 + tick :] = True
        yield room(*([PILLAR] if 15 <= tick < 30 else []), unknown=unknown)


@functools.cache
def flight() -> tuple[Observation, ...]:
    """What a flight along the line sees from t = 1 s on; the best goal drifts away at t = 5 s."""
    maps = list(_maps())
    return tuple(
        _on_the_line(
            observe(
                now,
                change(before, now),
                time_s=1.0 + 0.1 * tick,
                goal=goal_at(5.5),
                best=goal_at(5.5 if tick < 40 else 4.9),
                trajectory=FLOWN,
            )
        )
        for tick, (before, now) in enumerate(pairwise([maps[0], *maps]))
    )


def _on_the_line(seen: Observation) -> Observation:
    """The same with the vehicle where its trajectory has it."""
    position, velocity, acceleration = (values[0] for values in evaluate(FLOWN, np.array([seen.time_s])))
    return replace(
        seen,
        state=replace(hovering(position), velocity_mps=velocity),
        reference=replace(
            seen.reference, position_m=position, velocity_mps=velocity, acceleration_mps2=acceleration
        ),
    )


def elsewhere(seen: Observation) -> Observation:
    """What the same flight sees in the same hall, `SHIFT_M` away."""
    coefficients = FLOWN.coefficients.copy()
    coefficients[:, 0] += SHIFT_M
    return replace(
        seen,
        state=replace(seen.state, position_m=seen.state.position_m + SHIFT_M),
        reference=replace(seen.reference, position_m=seen.reference.position_m + SHIFT_M),
        field=replace(seen.field, origin_m=seen.field.origin_m + SHIFT_M),
        trajectory=replace(FLOWN, coefficients=coefficients),
        goal=_goal_elsewhere(seen.goal),
        best_goal=_goal_elsewhere(seen.best_goal),
        flight_bounds_m=seen.flight_bounds_m + SHIFT_M,
    )


def _goal_elsewhere(goal: Goal | None) -> Goal | None:
    return None if goal is None else replace(goal, position_m=goal.position_m + SHIFT_M)
