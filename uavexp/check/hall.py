"""A straight flight along a hall, and what a replanning policy sees on it."""

from __future__ import annotations

import numpy as np

from uavexp.arrays import Bool
from uavexp.check.fields import box, empty, field_from
from uavexp.field import DistanceField
from uavexp.trajectory import Trajectory
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
        state=State(
            position_m=zero, velocity_mps=zero, quaternion_wxyz=np.array([1.0, 0, 0, 0]), body_rate_radps=zero
        ),
        reference=Reference(position_m=zero, velocity_mps=zero, acceleration_mps2=zero, yaw_rad=0.0),
        trajectory=trajectory,
        field=field,
        update=change(field, field) if update is None else update,
        goal=goal,
        best_goal=best,
        target_m=None,
        flight_bounds_m=np.zeros((2, 3)),
    )
