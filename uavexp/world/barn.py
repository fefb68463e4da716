"""The worlds of the BARN benchmark, on which ground robots are scored, made high enough for a UAV.

Geometry, start and target are the published ones; the cylinders, 1 m high there, reach the ceiling, so that
the task is the same one: a way between them, none over them. A cylinder is an octagonal prism around it, by
6 mm larger at most.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated

import numpy as np

from uavexp.arrays import Float, Float32, Int32
from uavexp.errors import WorldError, require
from uavexp.parameters import Positive, between, option
from uavexp.scene import Scene
from uavexp.space import FREE, OUTSIDE, Space
from uavexp.types import World
from uavexp.world import barn_layouts as published
from uavexp.world import task
from uavexp.world.boxes import WALL_M, Boxes
from uavexp.world.solidity import space_of_mesh

INSET_M = np.array([0.3, 0.3, 0.4])  # of the flight bounds from the field's edges, floor and ceiling
MAP_MARGIN_M = 0.6  # of the mapped box around the flight bounds
_SIDES = 8


@option
class Barn:
    """One of the 300 worlds of BARN (Perille, Truong, Xiao and Stone 2020)."""

    number: Annotated[int, between(0, published.COUNT - 1)] | None = None  # 0 to 299, as published;
    # null: drawn by the seed
    height_m: Annotated[float, between(1.0, 10.0)] = 2.5  # m, of the room, and of the cylinders [ours]
    flight_height_m: Positive = 1.2  # m, z of start and target [ours]
    clearance_m: Positive = 0.3  # m, of the body's centre on the shortest path; the narrowest world
    # has 0.35 m [ours]

    def __post_init__(self) -> None:
        low, high = INSET_M[2], self.height_m - INSET_M[2]
        require(
            low < self.flight_height_m < high,
            f"flight_height_m must lie between {low:g} and {high:g} m, got {self.flight_height_m}",
        )

    def generate(self, rng: np.random.Generator) -> World:
        """Return the world; raise `WorldError` when its target cannot be reached with the clearance."""
        drawn = int(rng.integers(published.COUNT))
        number = drawn if self.number is None else self.number
        vertices, triangles = self._geometry(published.layout(number).centres_m)
        scene = Scene.from_mesh(vertices, triangles)
        low = np.array([*published.CORNER_M, 0.0])
        high = low + np.array([*published.FIELD_M, self.height_m])
        flight_bounds = np.stack([low + INSET_M, high - INSET_M])
        start, target = (
            np.array([*place, self.flight_height_m]) for place in (published.START_M, published.TARGET_M)
        )
        path = task.shortest_path(scene, flight_bounds, start, target, self.clearance_m, task.FINE_CELL_M)
        if path.shape[0] == 0:
            raise WorldError(
                f"world {number} of BARN cannot be crossed with clearance_m={self.clearance_m:g}; lower it"
            )
        return task.assemble(
            name=published.name_of(number),
            scene=scene,
            vertices_m=vertices,
            triangles=triangles,
            bounds_m=flight_bounds + np.array([[-MAP_MARGIN_M], [MAP_MARGIN_M]]),
            flight_bounds_m=flight_bounds,
            path_m=path,
            space=_all_inside(space_of_mesh(vertices, triangles)),
        )

    def _geometry(self, centres_m: Float) -> tuple[Float32, Int32]:
        """Floor, ceiling, and the cylinders between them."""
        x, y = published.CORNER_M
        length, width = published.FIELD_M
        plates = Boxes()
        for base in (-WALL_M, self.height_m):
            plates.span(
                (x - MAP_MARGIN_M, y - MAP_MARGIN_M, base),
                (x + length + MAP_MARGIN_M, y + width + MAP_MARGIN_M, base + WALL_M),
            )
        vertices, triangles = plates.mesh()
        more, faces = _prisms(centres_m, 0.5 * published.DIAMETER_M, self.height_m)
        return np.concatenate([vertices, more]), np.concatenate([triangles, faces + len(vertices)])


def _all_inside(space: Space) -> Space:
    """The same space, with no outside: the field is open, the ground behind it as good as that in it."""
    return replace(space, state=np.where(space.state == OUTSIDE, FREE, space.state))


def _prisms(centres_m: Float, radius_m: float, height_m: float) -> tuple[Float32, Int32]:
    """Vertices and triangles of upright octagonal prisms around cylinders with centres (N, 2)."""
    angle = (np.arange(_SIDES) + 0.5) * 2.0 * math.pi / _SIDES
    ring = np.column_stack([np.cos(angle), np.sin(angle)]) * radius_m / math.cos(math.pi / _SIDES)
    outline = np.tile(centres_m[:, None] + ring, (1, 2, 1))  # below, then above
    heights = np.broadcast_to(np.repeat([0.0, height_m], _SIDES)[:, None], (len(centres_m), 2 * _SIDES, 1))
    vertices = np.concatenate([outline, heights], axis=2).reshape(-1, 3).astype(np.float32)
    here = np.arange(_SIDES)
    after = (here + 1) % _SIDES
    fan = np.column_stack([np.zeros(_SIDES - 2, np.int64), here[1:-1], here[2:]])
    faces = np.concatenate(
        [
            np.column_stack([here, after, after + _SIDES]),
            np.column_stack([here, after + _SIDES, here + _SIDES]),
            fan[:, ::-1],
            fan + _SIDES,
        ]
    )
    each = faces[None] + 2 * _SIDES * np.arange(len(centres_m))[:, None, None]
    return vertices, each.reshape(-1, 3).astype(np.int32)
