"""A room seen by a LiDAR while boxes move through it: what a detector is given, scan by scan."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from uavexp.arrays import Float
from uavexp.check.fields import box, empty, field_from
from uavexp.field import DistanceField
from uavexp.scan import RayScan
from uavexp.types import Bodies, Shape

SIZE_M = (8.0, 6.0, 3.0)
WALLS = (
    ((-0.2, -0.2, -0.2), (0.2, 6.2, 3.2)),
    ((7.8, -0.2, -0.2), (8.2, 6.2, 3.2)),
    ((-0.2, -0.2, -0.2), (8.2, 0.2, 3.2)),
    ((-0.2, 5.8, -0.2), (8.2, 6.2, 3.2)),
    ((-0.2, -0.2, -0.2), (8.2, 6.2, 0.1)),
    ((-0.2, -0.2, 2.9), (8.2, 6.2, 3.2)),
)
HALF_M = np.array([0.3, 0.3, 0.85])
SENSOR_M = np.array([1.0, 3.0, 1.2])
Path = Callable[[float], Float]  # time s -> centre (3,)


def room_map() -> DistanceField:
    """The room as a perfect map knows it: empty."""
    grid = empty(SIZE_M)
    for low, high in WALLS:
        box(grid, low, high)
    return field_from(grid, max_distance_m=2.0)


def unknown_map() -> DistanceField:
    """A map that has seen nothing."""
    known = room_map()
    return replace(known, distance=np.full_like(known.distance, 2.0), state=np.zeros_like(known.state))


def sweep(rings: int = 16, columns: int = 360, tilt_rad: float = 0.3) -> Float:
    """Unit directions (N, 3) of a spinning LiDAR."""
    up, around = np.meshgrid(
        np.linspace(-tilt_rad, tilt_rad, rings), np.linspace(-np.pi, np.pi, columns, endpoint=False)
    )
    parts = (np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up))
    return np.stack([part.ravel() for part in parts], axis=1)


RAYS = sweep()


def ray_scan(
    boxes: list[tuple[Float, Float]],
    time_s: float = 0.0,
    origin_m: Float = SENSOR_M,
    noise: np.random.Generator | None = None,
    range_m: float = 10.0,
) -> RayScan:
    """Ranges to the room's walls and to boxes (lower, upper corner), by the slab method."""
    nearest = np.full(len(RAYS), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        for low, high in [*WALLS, *boxes]:
            first, second = (np.asarray(low) - origin_m) / RAYS, (np.asarray(high) - origin_m) / RAYS
            enter = np.minimum(first, second).max(axis=1)
            leave = np.maximum(first, second).min(axis=1)
            nearest = np.where((enter <= leave) & (enter > 0.0) & (enter < nearest), enter, nearest)
    if noise is not None:
        nearest = nearest + noise.normal(0.0, 0.02, len(nearest))
    return RayScan(
        time_s=time_s,
        origin_m=np.asarray(origin_m, dtype=np.float64),
        direction=RAYS.astype(np.float32),
        range_m=np.where(nearest > range_m, np.inf, nearest).astype(np.float32),
        max_range_m=range_m,
    )


def bodies_at(paths: list[Path], time_s: float, half_m: Float = HALF_M) -> Bodies:
    """Upright boxes on their paths, with the velocity of a central difference."""
    count = len(paths)
    return Bodies(
        time_s=time_s,
        shape=np.full(count, int(Shape.BOX), dtype=np.uint8),
        half_size_m=np.tile(half_m, (count, 1)),
        position_m=np.array([path(time_s) for path in paths]).reshape(-1, 3),
        velocity_mps=np.array([(path(time_s + 1e-4) - path(time_s - 1e-4)) / 2e-4 for path in paths]).reshape(
            -1, 3
        ),
    )


def scans(
    paths: list[Path],
    duration_s: float,
    period_s: float = 0.1,
    noise: np.random.Generator | None = None,
    half_m: Float = HALF_M,
) -> Iterator[tuple[RayScan, Bodies]]:
    """What the LiDAR sees of the movers, and the movers."""
    for time_s in np.arange(round(duration_s / period_s)) * period_s:
        bodies = bodies_at(paths, float(time_s), half_m)
        boxes = [(middle - half_m, middle + half_m) for middle in bodies.position_m]
        yield ray_scan(boxes, float(time_s), noise=noise), bodies


def straight(start_m: tuple[float, float, float], velocity_mps: tuple[float, float, float]) -> Path:
    """Constant velocity."""
    return lambda time_s: np.array(start_m) + time_s * np.array(velocity_mps)
