"""A small closed building, in which sensors, movers and missions are checked."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np

from uavexp.check.scans import Box
from uavexp.scene import Scene
from uavexp.types import Difficulty, World
from uavexp.world.boxes import Boxes

SIZE_M = (14.0, 10.0, 3.0)


@functools.cache
def building() -> World:
    """A hall with a wall across, a doorway in it and a pillar before the start."""
    boxes = Boxes()
    boxes.shell(SIZE_M)
    boxes.span((8.0, 0.0, 0.0), (8.15, 6.0, 3.0))
    boxes.span((3.0, 5.3, 0.0), (3.3, 5.9, 2.0))
    vertices, triangles = boxes.mesh()
    start, door, target = np.array([1.0, 5.0, 1.2]), np.array([8.1, 8.0, 1.2]), np.array([13.0, 5.0, 1.2])
    straight_m = float(np.linalg.norm(target - start))
    detour_m = float(np.linalg.norm(door - start) + np.linalg.norm(target - door))
    return World(
        name="building",
        vertices_m=vertices,
        triangles=triangles,
        bounds_m=np.array([[-0.3, -0.3, -0.3], [SIZE_M[0] + 0.3, SIZE_M[1] + 0.3, SIZE_M[2] + 0.3]]),
        flight_bounds_m=np.array([[0.3, 0.3, 0.4], [SIZE_M[0] - 0.3, SIZE_M[1] - 0.3, SIZE_M[2] - 0.4]]),
        start_m=start,
        start_yaw_rad=0.0,
        target_m=target,
        shortest_path=np.array([start, door, target]),
        difficulty=Difficulty(
            clutter_density=0.05, narrowest_gap_m=4.0, straight_line_m=straight_m, shortest_path_m=detour_m
        ),
        digest="0" * 64,
    )


@functools.cache
def scene() -> Scene:
    """The building's geometry."""
    return Scene(building())


def scene_of(parts: Sequence[Box]) -> Scene:
    """The geometry of boxes (lower and upper corner); of none: empty space."""
    boxes = Boxes()
    for low, high in parts:
        boxes.span(low, high)
    vertices, triangles = (
        boxes.mesh() if parts else (np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32))
    )
    return Scene.from_mesh(vertices, triangles)
