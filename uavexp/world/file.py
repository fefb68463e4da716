"""Somebody else's building: a mesh, a point cloud, a voxel set or a ROS map from a file."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np

from uavexp import formats
from uavexp.arrays import Float, Int32
from uavexp.errors import WorldError, require
from uavexp.parameters import Constraint, Finite, NonNegative, Positive, Vector, option
from uavexp.scene import Scene
from uavexp.space import SOLID, UNMEASURED, Space
from uavexp.types import World
from uavexp.world import task
from uavexp.world.building import Building, Reading, building_of
from uavexp.world.frame import frame_of
from uavexp.world.free_parts import FreeParts, floor_m, free_parts, notes_of, text

INSET_M = (0.3, 0.3, 0.4)  # of the flight bounds from the geometry's bounding box, when not given
MAP_MARGIN_M = 0.6  # of the mapped box around the flight bounds: walls just outside are mapped
ABOVE_FLOOR_M = 1.2  # of a drawn start and target, when no height is given
SAMPLE_ATTEMPTS = 100


Box = Annotated[
    tuple[Vector, Vector],
    Constraint(
        "[[lower x, y, z], [upper x, y, z]]",
        lambda box: all(low < high for low, high in zip(*box, strict=True)),
    ),
]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Survey:
    """A building as read, and where in it a body can be: all that is known before there is a task."""

    content: formats.Content
    building: Building
    flight_bounds_m: Float  # (2, 3)
    scene: Scene
    parts: FreeParts

    @property
    def notes(self) -> tuple[str, ...]:
        """What a person should know of it, a sentence each."""
        return (*self.building.notes, *notes_of(self.parts))


@option
class File:
    """A world read from a file; lengths below are in m in the converted frame, z up."""

    path: Annotated[str, Constraint("the name of a world file", bool)]  # mesh ply obj stl glb gltf dae,
    # Gazebo's world sdf; cloud pcd ply xyz pts npz las laz; voxels npz bt ot 3dmap; plan yaml (ROS) dxf wkt;
    # relative to the working directory
    unit_m: Positive | None = None  # m, length of one unit of the file (0.001 for mm, 0.0254 for inches);
    # null: as it says, or 1 m
    up_axis: Literal["x", "y", "z", "-x", "-y", "-z"] | None = None  # the file's axis that points up:
    # x y z -x -y -z; null: as it says (glb: y), or z
    start_m: Vector | None = None  # m, [x, y, z]; null: drawn by the seed from the largest free part inside
    # the building
    target_m: Vector | None = None  # m, [x, y, z]; null exactly when start_m is
    flight_bounds_m: Box | None = None  # m, [[x, y, z], [x, y, z]] for the body's centre; null:
    # bounding box less 0.3 and 0.4 m
    clearance_m: Positive = 0.35  # m, needed by the body's centre all along a path for it to count [ours]
    flight_height_m: Finite | None = None  # m, z of a drawn start and target; null: 1.2 m above the floor of
    # the largest free part [ours]
    least_distance_m: NonNegative = 8.0  # m, between a drawn start and target [ours]
    voxel_size_m: Positive = 0.1  # m, voxels that a point cloud is turned into [ours]
    wall_height_m: Positive = 2.5  # m, to which a plan (ROS map, dxf, wkt) is extruded from z = 0 [ours]
    layers: tuple[str, ...] = ()  # names of a dxf's layers that are walls; none: all that are switched on
    unknown: Literal["wall", "free"] = "wall"  # wall or free: cells of a ROS map, or of voxels with measured
    # free ones, that were never measured; nothing starts or ends there [ours]

    def __post_init__(self) -> None:
        require(
            (self.start_m is None) == (self.target_m is None),
            "start_m and target_m must be given both or not at all",
        )

    def generate(self, rng: np.random.Generator) -> World:
        """Return the world; raise `WorldError` in one line when file or task is unusable."""
        return self.world_of(self.survey(), rng)

    def survey(self) -> Survey:
        """Return the building; raise `WorldError` in one line when the file is unusable."""
        # a reader's lengths are the file's own
        options = formats.Options(wall_height_m=self.wall_height_m / (self.unit_m or 1.0), layers=self.layers)
        content = formats.read(Path(self.path), options)
        building = building_of(content, self._reading(content))
        bounds_m = self._checked_bounds(building)
        scene = Scene.from_mesh(building.vertices_m, building.triangles)
        return Survey(
            content=content,
            building=building,
            flight_bounds_m=bounds_m,
            scene=scene,
            parts=free_parts(scene, bounds_m, self.clearance_m, building.space),
        )

    def _reading(self, content: formats.Content) -> Reading:
        bounds_m = None
        if self.flight_bounds_m is not None:
            bounds_m = np.array(self.flight_bounds_m) + np.array([[-MAP_MARGIN_M], [MAP_MARGIN_M]])
        return Reading(
            frame=frame_of(content, self.path, self.unit_m, self.up_axis),
            voxel_size_m=self.voxel_size_m,
            wall_height_m=self.wall_height_m,
            unmeasured_is_solid=self.unknown == "wall",
            bounds_m=bounds_m,
        )

    def world_of(self, survey: Survey, rng: np.random.Generator) -> World:
        """Return the world with its task, given or drawn; raise `WorldError` when there is none."""
        building, scene, parts = survey.building, survey.scene, survey.parts
        flight_bounds = survey.flight_bounds_m
        if self.start_m is not None and self.target_m is not None:
            start, target = (
                self._checked_end(
                    name, np.array(given) - building.origin_m, scene, building, parts, flight_bounds
                )
                for name, given in (("start_m", self.start_m), ("target_m", self.target_m))
            )
        else:
            start, target = self._drawn_ends(scene, building.space, parts, flight_bounds, rng)
        return task.assemble(
            name="file",
            scene=scene,
            vertices_m=building.vertices_m,
            triangles=building.triangles,
            bounds_m=flight_bounds + np.array([[-MAP_MARGIN_M], [MAP_MARGIN_M]]),
            flight_bounds_m=flight_bounds,
            path_m=self._path(scene, flight_bounds, start, target),
            space=building.space,
            notes=survey.notes,
        )

    def _checked_bounds(self, building: Building) -> Float:
        """Flight bounds in the building's coordinates."""
        vertices = building.vertices_m
        box = np.round(np.stack([vertices.min(axis=0), vertices.max(axis=0)]).astype(np.float64), 6)
        if self.flight_bounds_m is None:
            bounds = box + np.outer([1.0, -1.0], INSET_M)
            if not (bounds[0] < bounds[1]).all():
                raise WorldError(
                    f"{self.path}: the geometry is {text(box[1] - box[0])} m, too small to fly in; "
                    f"is world.unit_m={building.unit_m:g} right?"
                )
        else:
            bounds = np.array(self.flight_bounds_m) - building.origin_m
            if (bounds[0] > box[1]).any() or (bounds[1] < box[0]).any():
                box += building.origin_m
                raise WorldError(
                    f"{self.path}: the geometry reaches from {text(box[0])} to {text(box[1])} m, apart from "
                    f"flight_bounds_m {text(bounds[0])} to {text(bounds[1])}; are unit_m and up_axis right?"
                )
        return bounds

    def _checked_end(
        self, name: str, point: Float, scene: Scene, building: Building, parts: FreeParts, bounds_m: Float
    ) -> Float:
        """A given end in the building's coordinates; refused where the body cannot be."""
        given = text(point + building.origin_m)
        if (point < bounds_m[0]).any() or (point > bounds_m[1]).any():
            raise WorldError(
                f"{self.path}: {name} {given} lies outside the flight bounds "
                f"{text(bounds_m[0] + building.origin_m)} to {text(bounds_m[1] + building.origin_m)}"
            )
        state = int(building.space.state_at(point[None])[0])
        clearance = float(scene.distance_m(point[None])[0])
        if state == SOLID:
            why = "lies inside a solid"
        elif state == UNMEASURED:
            why = "lies where the map was never measured"
        elif clearance < self.clearance_m:
            why = (
                f"lies too near an obstacle: its clearance is {clearance:.2f} m, "
                f"clearance_m={self.clearance_m:g} is needed"
            )
        else:
            return point
        near = parts.nearest_m(point)
        advice = (
            f"nowhere has the body's centre clearance_m={self.clearance_m:g} of room"
            if near is None
            else f"the nearest free place is world.{name}={text(near + building.origin_m)}"
        )
        raise WorldError(f"{self.path}: {name} {given} {why}; {advice}")

    def _path(self, scene: Scene, flight_bounds_m: Float, start: Float, target: Float) -> Float:
        """Shortest path between the ends."""
        for cell_m in (task.CELL_M, task.FINE_CELL_M):  # a door may fall between the coarser lattice's nodes
            path = task.shortest_path(scene, flight_bounds_m, start, target, self.clearance_m, cell_m)
            if path.shape[0] > 0:
                return path
        widest = task.bottleneck_m(scene, flight_bounds_m, start, target, self.clearance_m)
        raise WorldError(
            f"{self.path}: target {text(target)} cannot be reached from start {text(start)} with "
            f"clearance_m={self.clearance_m:g}; "
            + (f"they are joined at {widest:.2f} m" if widest > 0.0 else "they are not joined at all")
        )

    def _drawn_ends(
        self, scene: Scene, space: Space, parts: FreeParts, flight_bounds_m: Float, rng: np.random.Generator
    ) -> tuple[Float, Float]:
        """Start and target at the flight height, in the largest free part inside the building."""
        height = self._height_m(scene, parts)
        points, number = self._layer(scene, space, parts, flight_bounds_m, height)
        if points.shape[0] == 0 and self.flight_height_m is None:  # 1.2 m is under its ceiling
            height = parts.fullest_height_m()
            points, number = self._layer(scene, space, parts, flight_bounds_m, height)
        if points.shape[0] == 0:
            fullest = parts.fullest_height_m()
            raise WorldError(
                f"{self.path}: nowhere inside the building at flight_height_m={height:g} has the body's "
                f"centre clearance_m={self.clearance_m:g} of room; most room is at "
                f"world.flight_height_m={fullest:.2f}"
            )
        own = number == parts.largest
        points = points[own] if own.any() else points[number == np.bincount(number).argmax()]
        for _ in range(SAMPLE_ATTEMPTS):
            start = points[rng.integers(points.shape[0])]
            far = points[np.linalg.norm(points - start, axis=1) >= self.least_distance_m]
            if far.shape[0] > 0:
                return start, far[rng.integers(far.shape[0])]
        extent = float(np.linalg.norm(np.ptp(points, axis=0)))
        raise WorldError(
            f"{self.path}: no two points at flight_height_m={height:g} in the largest free part, "
            f"{extent:.1f} m across, are least_distance_m={self.least_distance_m:g} apart; "
            f"world.least_distance_m={0.5 * extent:.1f} would do"
        )

    def _height_m(self, scene: Scene, parts: FreeParts) -> float:
        if parts.largest == 0:
            raise WorldError(
                f"{self.path}: nowhere within the flight bounds has the body's centre "
                f"clearance_m={self.clearance_m:g} of room"
            )
        if self.flight_height_m is not None:
            return self.flight_height_m
        floor = floor_m(scene, parts)
        return parts.fullest_height_m() if math.isnan(floor) else round(floor + ABOVE_FLOOR_M, 2)

    def _layer(
        self, scene: Scene, space: Space, parts: FreeParts, flight_bounds_m: Float, height: float
    ) -> tuple[Float, Int32]:
        """Points (N, 3) at one height that keep the clearance inside the building, and the part of each."""
        if not flight_bounds_m[0, 2] <= height <= flight_bounds_m[1, 2]:
            return np.empty((0, 3)), np.empty(0, dtype=np.int32)
        points, _, _ = task.free_layer(scene, flight_bounds_m, height, self.clearance_m)
        number = parts.number_at(points)
        kept = (number > 0) & (space.is_inside(points) if parts.enclosed else space.is_free(points))
        return points[kept], number[kept]
