"""What the generated families share: checks, the task in opposite corners, redrawing."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from uavexp.arrays import Float
from uavexp.errors import WorldError, require
from uavexp.parameters import Positive
from uavexp.scene import Scene
from uavexp.types import World
from uavexp.world import task
from uavexp.world.boxes import WALL_M, Boxes

ATTEMPTS = 30  # drawings before giving up
CORNER_SHARE = 0.22  # start and target lie in corners this share of the length and width
MIN_STRAIGHT_SHARE = 0.7  # of the flight bounds' horizontal diagonal
WALL_INSET_M = 0.3  # of the flight bounds from the outer walls
FLOOR_INSET_M = 0.4  # and from floor and ceiling


Size = tuple[Positive, Positive, Positive]


@dataclass(slots=True, kw_only=True)
class Indoor(ABC):
    """A family of worlds: geometry and a task, drawn until start and target are joined with the clearance.

    They are joined in the plane of the flight height, which is more than the guarantee asks:
    a vehicle that keeps its height can fly every generated world. The shortest path may
    still leave the plane.
    """

    advice: ClassVar[str]  # which parameter to change when no drawing will do

    size_m: Size  # m, inner length, width, height
    flight_height_m: Positive = 1.2  # m, z of start and target [ours]
    clearance_m: Positive = 0.45  # m, guaranteed distance of the body's centre from everything on
    # the shortest path

    def __post_init__(self) -> None:
        size, low = self.size_m, max(FLOOR_INSET_M, self.clearance_m)
        least = 4.0 * self.clearance_m + 2.0 * WALL_INSET_M
        require(
            min(size[:2]) >= least, f"size_m must be at least {least:g} m long and wide, got {list(size)}"
        )
        require(max(size) <= 200.0, f"size_m must be at most 200 m long, wide and high, got {list(size)}")
        require(
            low < self.flight_height_m < size[2] - low,
            f"flight_height_m must lie between {low:g} m and {low:g} m under the ceiling at {size[2]:g} m, "
            f"got {self.flight_height_m}",
        )

    @abstractmethod
    def furnish(self, boxes: Boxes, rng: np.random.Generator) -> None:
        """Add the family's boxes to the empty shell."""

    def generate(self, rng: np.random.Generator) -> World:
        """Return the world; raise `WorldError` when no drawing joins start and target."""
        name = type(self).__module__.rpartition(".")[2]
        inset = np.array([WALL_INSET_M, WALL_INSET_M, FLOOR_INSET_M])
        flight_bounds = np.stack([inset, np.array(self.size_m) - inset])
        margin = WALL_M + 0.05
        bounds = np.stack([np.full(3, -margin), np.array(self.size_m) + margin])
        for _ in range(ATTEMPTS):
            boxes = Boxes()
            boxes.shell(self.size_m)
            self.furnish(boxes, rng)
            vertices, triangles = boxes.mesh()
            scene = Scene.from_mesh(vertices, triangles)
            ends = self.ends(scene, flight_bounds, rng)
            if ends is None:
                continue
            path = task.shortest_path(scene, flight_bounds, ends[0], ends[1], self.clearance_m)
            if path.shape[0] > 0:
                return task.assemble(
                    name=name,
                    scene=scene,
                    vertices_m=vertices,
                    triangles=triangles,
                    bounds_m=bounds,
                    flight_bounds_m=flight_bounds,
                    path_m=path,
                )
        message = (
            f"{name}: none of {ATTEMPTS} drawings joins start and target with {self.clearance_m:g} m of "
            f"clearance; {self.advice}"
        )
        raise WorldError(message)

    def ends(
        self, scene: Scene, flight_bounds_m: Float, rng: np.random.Generator
    ) -> tuple[Float, Float] | None:
        """Draw start and target from opposite corners of the largest joined part of the layer."""
        flip_x, flip_y = rng.random(2) < 0.5
        picks = rng.random(2)
        points, part, sizes = task.free_layer(scene, flight_bounds_m, self.flight_height_m, self.clearance_m)
        if sizes.size == 0:
            return None
        points = points[part == sizes.argmax()]
        extent = flight_bounds_m[1, :2] - flight_bounds_m[0, :2]
        share = (points[:, :2] - flight_bounds_m[0, :2]) / extent
        if flip_x:
            share[:, 0] = 1.0 - share[:, 0]
        if flip_y:
            share[:, 1] = 1.0 - share[:, 1]
        near = points[(share < CORNER_SHARE).all(axis=1)]
        far = points[(share > 1.0 - CORNER_SHARE).all(axis=1)]
        if near.shape[0] == 0 or far.shape[0] == 0:
            return None
        start = near[int(picks[0] * near.shape[0])]
        reach = np.linalg.norm(far - start, axis=1) >= MIN_STRAIGHT_SHARE * math.hypot(*extent)
        far = far[reach]
        if far.shape[0] == 0:
            return None
        return start, far[int(picks[1] * far.shape[0])]


def apart(x_m: float, y_m: float, others: Sequence[tuple[float, float, float]], radius_m: float) -> bool:
    """Whether a disc keeps clear of discs (x, y, radius)."""
    return all(math.hypot(x_m - x, y_m - y) > radius_m + r for x, y, r in others)
