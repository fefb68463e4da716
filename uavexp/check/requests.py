"""Requests that a planner is asked: empty space, shelves at speed, replans in flight, hopeless ones."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np

from uavexp.arrays import Bool, Float
from uavexp.check.fields import bounds, box, empty, field_from, warehouse
from uavexp.check.hall import LIMITS
from uavexp.field import DistanceField
from uavexp.trajectory import Trajectory, evaluate
from uavexp.types import Goal, PlanRequest

TIME_S = 12.34  # of every first request: a plan begins at its request's time, not at 0


def ask(
    field: DistanceField,
    start_m: Float,
    goal_m: Float,
    *,
    velocity_mps: Float | None = None,
    target: bool = True,
) -> PlanRequest:
    """A request inside the whole of a map."""
    return PlanRequest(
        time_s=TIME_S,
        position_m=start_m,
        velocity_mps=np.zeros(3) if velocity_mps is None else velocity_mps,
        acceleration_mps2=np.zeros(3),
        goal=Goal(position_m=goal_m, is_target=target, score=0.0),
        field=field,
        flight_bounds_m=bounds(field.state, field.voxel_size_m, field.origin_m),
    )


@functools.cache
def _hall() -> DistanceField:
    return field_from(empty((12.0, 9.0, 6.0)))


@functools.cache
def _shelves(seed: int) -> DistanceField:
    return field_from(warehouse(seed))


def in_empty_space() -> list[PlanRequest]:
    """From rest and from flight through a hall in which nothing is mapped, to the target and past a goal."""
    field = _hall()
    start, goal = np.array([3.03, 4.41, 3.02]), np.array([8.87, 5.12, 3.13])
    slow = np.array([0.5, -0.3, 0.1])
    return [
        ask(field, start, goal),
        ask(field, start, goal, target=False),
        ask(field, start, goal, velocity_mps=slow),
    ]


def among_shelves(seed: int, count: int) -> list[PlanRequest]:
    """Requests of 4 to 12 m in a warehouse, half of them at speed with room to stop."""
    field, rng = _shelves(seed), np.random.default_rng(seed)
    requests: list[PlanRequest] = []
    while len(requests) < count:
        ends = rng.uniform([1.0, 1.0, 1.1], [25.0, 15.0, 1.6], (2, 3))
        if not 4.0 < np.linalg.norm(ends[1] - ends[0]) < 12.0 or field.distance_m(ends).min() < 0.4:
            continue
        angle, speed = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.0, 2.3)
        along = np.array([np.cos(angle), np.sin(angle), 0.0])
        ahead = field.distance_m(ends[0] + np.arange(0.0, 3.0, 0.1)[:, None] * along)
        room_m = 0.1 * int(np.argmin(ahead > 0.3)) if (ahead <= 0.3).any() else 3.0
        speed = min(speed, 0.8 * np.sqrt(2.0 * LIMITS.max_acceleration_mps2 * max(room_m - 0.3, 0.0)))
        velocity = speed * along if len(requests) % 2 else None
        requests.append(ask(field, ends[0], ends[1], velocity_mps=velocity, target=bool(rng.integers(2))))
    return requests


def follow_on(request: PlanRequest, trajectory: Trajectory, share: float = 0.13) -> PlanRequest:
    """The same goal again, asked in flight after a share of the trajectory."""
    moment_s = trajectory.start_s + share * trajectory.duration_s
    position, velocity, acceleration = evaluate(trajectory, np.array([moment_s]))
    return replace(
        request,
        time_s=moment_s,
        position_m=position[0],
        velocity_mps=velocity[0],
        acceleration_mps2=acceleration[0],
    )


def hopeless() -> dict[str, PlanRequest]:
    """What no plan can do, in words: a wall across the hall has start, goal or way in it."""
    grid = empty((6.0, 4.0, 2.0))
    box(grid, (2.9, 0.0, 0.0), (3.1, 4.0, 2.0))
    field = field_from(grid)
    here, wall, beyond = np.array([1.0, 2.0, 1.0]), np.array([3.0, 2.0, 1.0]), np.array([5.0, 2.0, 1.0])
    return {
        "a start inside a wall": ask(field, wall, here),
        "a goal inside a wall": ask(field, here, wall),
        "a goal behind a closed wall": ask(field, here, beyond),
        "2.4 m/s towards a wall 0.7 m ahead": ask(
            field, np.array([2.2, 2.0, 1.0]), here, velocity_mps=np.array([2.4, 0.0, 0.0])
        ),
    }


def obstacle_course() -> tuple[Bool, Float, Float]:
    """A hall with two pillars that leave one best way; start and goal."""
    grid = empty((9.0, 6.0, 2.4))
    box(grid, (2.5, 0.0, 0.0), (3.1, 3.7, 2.4))
    box(grid, (5.5, 2.2, 0.0), (6.1, 6.0, 2.4))
    return grid, np.array([1.05, 2.05, 1.25]), np.array([7.75, 3.85, 1.25])


def quintic(request: PlanRequest, duration_s: float) -> Trajectory:
    """The one polynomial of degree 5 from a request's state to rest at its goal: a plan for empty space."""
    start = np.stack([request.position_m, request.velocity_mps, 0.5 * request.acceleration_mps2])
    power = np.arange(6)
    slope, curvature = power, power * (power - 1)
    ends = np.stack(
        [
            duration_s**power,
            slope * duration_s ** np.maximum(power - 1.0, 0.0),
            curvature * duration_s ** np.maximum(power - 2.0, 0.0),
        ]
    )
    wanted = np.stack([request.goal.position_m, np.zeros(3), np.zeros(3)])
    upper = np.linalg.solve(ends[:, 3:], wanted - ends[:, :3] @ start)
    return Trajectory(
        breaks_s=request.time_s + np.array([0.0, duration_s]),
        coefficients=np.concatenate([start, upper])[None],
        at_rest=True,
    )
