"""Somebody else's building: a mesh, a point cloud, a voxel set or a ROS map from a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np

from uavexp import formats
from uavexp.arrays import Float
from uavexp.errors import WorldError, require
from uavexp.parameters import Constraint, Finite, NonNegative, Positive, Vector, option
from uavexp.scene import Scene
from uavexp.types import World
from uavexp.world import task
from uavexp.world.building import Building, Reading, building_of
from uavexp.world.frame import frame_of
from uavexp.world.free_parts import free_parts, text
from uavexp.world.survey import Survey, drawn_ends, given_end, joining_path

INSET_M = (0.3, 0.3, 0.4)  # of the flight bounds from the geometry's bounding box, when not given
MAP_MARGIN_M = 0.6  # of the mapped box around the flight bounds: walls just outside are mapped


Box = Annotated[
    tuple[Vector, Vector],
    Constraint(
        "[[lower x, y, z], [upper x, y, z]]",
        lambda box: all(low < high for low, high in zip(*box, strict=True)),
    ),
]


@option
class File:
    """A world read from a file; lengths below are in m in the converted frame, z up."""

    path: Annotated[str, Constraint("the name of a world file", bool)]  # mesh ply obj stl glb gltf dae,
    # Gazebo's world sdf; cloud pcd ply xyz pts npz las laz; voxels npz bt ot 3dmap; plan yaml (ROS) dxf wkt;
    # relative to the folder
    folder: str = ""  # where the file lies; empty: the working directory
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
        options = formats.Options(wall_height_m=self.wall_height_m, unit_m=self.unit_m, layers=self.layers)
        content = formats.read(formats.located(self.folder, self.path), options)
        building = building_of(content, self._reading(content))
        bounds_m = self._checked_bounds(building)
        scene = Scene.from_mesh(building.vertices_m, building.triangles)
        return Survey(
            path=self._file,
            content=content,
            building=building,
            flight_bounds_m=bounds_m,
            clearance_m=self.clearance_m,
            scene=scene,
            parts=free_parts(scene, bounds_m, self.clearance_m, building.space),
        )

    @property
    def _file(self) -> str:
        """The file as messages name it."""
        return str(Path(self.folder) / self.path)

    def _reading(self, content: formats.Content) -> Reading:
        bounds_m = None
        if self.flight_bounds_m is not None:
            bounds_m = np.array(self.flight_bounds_m) + np.array([[-MAP_MARGIN_M], [MAP_MARGIN_M]])
        return Reading(
            frame=frame_of(content, self._file, self.unit_m, self.up_axis),
            voxel_size_m=self.voxel_size_m,
            wall_height_m=self.wall_height_m,
            unmeasured_is_solid=self.unknown == "wall",
            bounds_m=bounds_m,
        )

    def world_of(self, survey: Survey, rng: np.random.Generator) -> World:
        """Return the world with its task, given or drawn; raise `WorldError` when there is none."""
        if self.start_m is not None and self.target_m is not None:
            start, target = (
                given_end(survey, name, given)
                for name, given in (("start_m", self.start_m), ("target_m", self.target_m))
            )
        else:
            start, target = drawn_ends(survey, self.flight_height_m, self.least_distance_m, rng)
        return task.assemble(
            name="file",
            scene=survey.scene,
            vertices_m=survey.building.vertices_m,
            triangles=survey.building.triangles,
            bounds_m=survey.flight_bounds_m + np.array([[-MAP_MARGIN_M], [MAP_MARGIN_M]]),
            flight_bounds_m=survey.flight_bounds_m,
            path_m=joining_path(survey, start, target),
            space=survey.building.space,
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
                    f"{self._file}: the geometry is {text(box[1] - box[0])} m, too small to fly in; "
                    f"is world.unit_m={building.unit_m:g} right?"
                )
        else:
            bounds = np.array(self.flight_bounds_m) - building.origin_m
            if (bounds[0] > box[1]).any() or (bounds[1] < box[0]).any():
                box += building.origin_m
                raise WorldError(
                    f"{self._file}: the geometry reaches from {text(box[0])} to {text(box[1])} m, apart from "
                    f"flight_bounds_m {text(bounds[0])} to {text(bounds[1])}; are unit_m and up_axis right?"
                )
        return bounds
