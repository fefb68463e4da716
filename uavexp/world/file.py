"""Somebody else's building: a mesh, a point cloud, a voxel set or a ROS map from a file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import numpy as np

from uavexp import formats
from uavexp.arrays import Bool, Float, Float32, Int32
from uavexp.errors import WorldError, require
from uavexp.parameters import Constraint, Finite, NonNegative, Positive, Vector, option
from uavexp.scene import Scene
from uavexp.types import World
from uavexp.world import task
from uavexp.world.voxel_mesh import exposed_faces

# rows of the rotation that turns each up axis to +z
UP_AXES = {
    "x": ((0, 1, 0), (0, 0, 1), (1, 0, 0)),
    "y": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    "z": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "-x": ((0, 1, 0), (0, 0, -1), (-1, 0, 0)),
    "-y": ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
    "-z": ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
}
INSET_M = (0.3, 0.3, 0.4)  # of the flight bounds from the geometry's bounding box, when not given
MAP_MARGIN_M = 0.6  # of the mapped box around the flight bounds: walls just outside are mapped
MAP_VOXEL_M = 0.1
MAP_BYTES_PER_VOXEL = 32  # distance, weight, state, nearest obstacle and a copy
FARTHEST_M = 20_000.0  # beyond it float32 cannot place a surface to a millimetre
SAMPLE_ATTEMPTS = 100


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

    path: Annotated[str, Constraint("the name of a world file", bool)]  # mesh ply obj stl glb; cloud pcd ply
    # xyz pts npz las laz; voxels npz bt ot 3dmap; plan yaml (ROS) dxf wkt; relative to the working directory
    unit_m: Positive = 1.0  # m, length of one unit of the file (0.001 for mm, 0.0254 for inches)
    up_axis: Literal["x", "y", "z", "-x", "-y", "-z"] = "z"  # the file's axis that points up:
    # x y z -x -y -z (glb: y)
    start_m: Vector | None = None  # m, [x, y, z]; null: drawn by the seed from one connected free part
    target_m: Vector | None = None  # m, [x, y, z]; null exactly when start_m is
    flight_bounds_m: Box | None = None  # m, [[x, y, z], [x, y, z]] for the body's centre; null:
    # bounding box less 0.3 and 0.4 m
    clearance_m: Positive = 0.35  # m, needed by the body's centre all along a path for it to count [ours]
    flight_height_m: Finite = 1.2  # m, z of a drawn start and target [ours]
    least_distance_m: NonNegative = 8.0  # m, between a drawn start and target [ours]
    voxel_size_m: Positive = 0.1  # m, voxels that a point cloud is turned into [ours]
    wall_height_m: Positive = 2.5  # m, to which a plan (ROS map, dxf, wkt) is extruded from z = 0 [ours]
    layers: tuple[str, ...] = ()  # names of a dxf's layers that are walls; none: all that are switched on
    unknown: Literal["wall", "free"] = "wall"  # wall or free: unknown cells of a ROS map,
    # or of voxels with measured free ones [ours]
    max_map_gib: Positive = 2.0  # GiB, memory that the map of the flight bounds may need at 0.1 m [ours]

    def __post_init__(self) -> None:
        require(
            (self.start_m is None) == (self.target_m is None),
            "start_m and target_m must be given both or not at all",
        )

    def generate(self, rng: np.random.Generator) -> World:
        """Return the world; raise `WorldError` in one line when file or task is unusable."""
        vertices, triangles = self._geometry()
        flight_bounds = self._checked_bounds(vertices)
        bounds = flight_bounds + np.array([[-MAP_MARGIN_M], [MAP_MARGIN_M]])
        self._check_memory(bounds, MAP_VOXEL_M, MAP_BYTES_PER_VOXEL)
        scene = Scene.from_mesh(vertices, triangles)
        if self.start_m is not None and self.target_m is not None:
            start = self._checked_end("start_m", self.start_m, scene, flight_bounds)
            target = self._checked_end("target_m", self.target_m, scene, flight_bounds)
        else:
            start, target = self._drawn_ends(scene, flight_bounds, rng)
        path = task.shortest_path(scene, flight_bounds, start, target, self.clearance_m)
        if path.shape[0] == 0:  # a door may fall between the nodes of the coarser lattice
            path = task.shortest_path(scene, flight_bounds, start, target, self.clearance_m, task.FINE_CELL_M)
        if path.shape[0] == 0:
            widest = task.bottleneck_m(scene, flight_bounds, start, target, self.clearance_m)
            raise WorldError(
                f"{self.path}: target {_text(target)} cannot be reached from start {_text(start)} with "
                f"clearance_m={self.clearance_m:g}; "
                + (f"they are joined at {widest:.2f} m" if widest > 0.0 else "they are not joined at all")
            )
        return task.assemble(
            name="file",
            scene=scene,
            vertices_m=vertices,
            triangles=triangles,
            bounds_m=bounds,
            flight_bounds_m=flight_bounds,
            path_m=path,
        )

    def _geometry(self) -> tuple[Float32, Int32]:
        """Triangles of the file, in m, z up."""
        # a reader's lengths are the file's own
        options = formats.Options(wall_height_m=self.wall_height_m / self.unit_m, layers=self.layers)
        content = formats.read(Path(self.path), options)
        if content.cells is not None and content.cells.is_plan:
            require(
                self.unit_m == 1.0 and self.up_axis == "z",
                "unit_m and up_axis do not apply to a ROS map, which is in m with z up",
            )
            return self._extruded(content.cells)
        if content.cells is not None:
            return self._meshed(self._upright(content.cells))
        if content.points.shape[0]:
            return self._meshed(self._voxels(self._converted(content.points)))
        return self._converted(content.vertices).astype(np.float32), content.triangles

    def _converted(self, points: Float) -> Float:
        """Turn the file's up axis to +z and its unit to m; refuse what float32 cannot hold."""
        points = self.unit_m * (points @ np.array(UP_AXES[self.up_axis], dtype=np.float64).T)
        farthest = float(np.abs(points).max())
        if farthest > FARTHEST_M:
            raise WorldError(
                f"{self.path}: coordinates reach {farthest:.3g} m, at most {FARTHEST_M:g} m are allowed; "
                f"is unit_m={self.unit_m:g} right, or has the file a far origin?"
            )
        return points

    def _upright(self, cells: formats.Cells) -> formats.Cells:
        """The same cells in m, z up."""
        turn = np.array(UP_AXES[self.up_axis], dtype=np.int64)
        source = np.abs(turn).argmax(axis=1)  # the file's axis that becomes each of ours
        state = np.transpose(cells.state, source)
        far = cells.origin + cells.size * cells.state.shape
        corners = self._converted(np.stack([cells.origin, far]))
        flipped = tuple(slice(None, None, int(sign)) for sign in turn[np.arange(3), source])
        return formats.Cells(
            state=state[flipped], origin=corners.min(axis=0), size=self.unit_m * cells.size[source]
        )

    def _voxels(self, points: Float) -> formats.Cells:
        """Cells of `voxel_size_m` that hold points (N, 3), the others free; within the bounds when given."""
        size = self.voxel_size_m
        if self.flight_bounds_m is not None:
            low, high = np.array(self.flight_bounds_m)
            points = points[((points > low - MAP_MARGIN_M) & (points < high + MAP_MARGIN_M)).all(axis=1)]
            if not points.shape[0]:
                raise WorldError(f"{self.path}: nothing lies within flight_bounds_m; is unit_m right?")
        index = np.floor(points / size).astype(np.int64)
        first, last = index.min(axis=0), index.max(axis=0)
        self._check_memory(size * np.stack([first, last + 1]), size, 2)
        state = np.full(last - first + 1, formats.FREE, dtype=np.uint8)
        state[tuple((index - first).T)] = formats.SOLID
        return formats.Cells(state=state, origin=first * size, size=np.full(3, size))

    def _meshed(self, cells: formats.Cells) -> tuple[Float32, Int32]:
        """Surface of cells."""
        return exposed_faces(self._solid(cells), cells.origin, cells.size)

    def _solid(self, cells: formats.Cells) -> Bool:
        solid: Bool = cells.state == formats.SOLID
        return solid | (cells.state == formats.UNMEASURED) if self.unknown == "wall" else solid

    def _extruded(self, plan: formats.Cells) -> tuple[Float32, Int32]:
        """Walls of a plan, with floor and ceiling over its whole extent."""
        solid = self._solid(plan)[..., 0]
        layers = np.ones((*solid.shape, 3), dtype=np.bool_)
        layers[..., 1] = solid
        vertices, triangles = exposed_faces(layers, np.zeros(3), np.array([*plan.size[:2], 1.0]))
        heights = np.array([-0.1, 0.0, self.wall_height_m, self.wall_height_m + 0.1], dtype=np.float32)
        vertices[:, 2] = heights[np.rint(vertices[:, 2]).astype(np.int64)]
        c, s = math.cos(plan.yaw_rad), math.sin(plan.yaw_rad)
        x, y = vertices[:, 0].astype(np.float64), vertices[:, 1].astype(np.float64)
        vertices[:, 0] = plan.origin[0] + c * x - s * y
        vertices[:, 1] = plan.origin[1] + s * x + c * y
        return vertices, triangles

    def _checked_bounds(self, vertices: Float32) -> Float:
        box = np.round(np.stack([vertices.min(axis=0), vertices.max(axis=0)]).astype(np.float64), 6)
        if self.flight_bounds_m is None:
            bounds = box + np.outer([1.0, -1.0], INSET_M)
            if not (bounds[0] < bounds[1]).all():
                raise WorldError(
                    f"{self.path}: the geometry is {_text(box[1] - box[0])} m, too small to fly in; "
                    f"is unit_m={self.unit_m:g} right?"
                )
            return bounds
        bounds = np.array(self.flight_bounds_m)
        if (bounds[0] > box[1]).any() or (bounds[1] < box[0]).any():
            raise WorldError(
                f"{self.path}: the geometry reaches from {_text(box[0])} to {_text(box[1])} m, apart from "
                f"flight_bounds_m {_text(bounds[0])} to {_text(bounds[1])}; are unit_m and up_axis right?"
            )
        return bounds

    def _check_memory(self, bounds_m: Float, voxel_m: float, bytes_per_voxel: int) -> None:
        size = bounds_m[1] - bounds_m[0]
        gib = float(np.prod(np.ceil(size / voxel_m))) * bytes_per_voxel / 2**30
        if gib > self.max_map_gib:
            raise WorldError(
                f"{self.path}: a map of {_text(size)} m at {voxel_m:g} m would need {gib:.1f} GiB, "
                f"max_map_gib={self.max_map_gib:g} are allowed; give smaller flight_bounds_m, or is "
                f"unit_m={self.unit_m:g} wrong?"
            )

    def _checked_end(self, name: str, given: Sequence[float], scene: Scene, flight_bounds_m: Float) -> Float:
        point = np.array(given)
        if (point < flight_bounds_m[0]).any() or (point > flight_bounds_m[1]).any():
            raise WorldError(
                f"{self.path}: {name} {_text(point)} lies outside the flight bounds "
                f"{_text(flight_bounds_m[0])} to {_text(flight_bounds_m[1])}"
            )
        clearance = float(scene.distance_m(point[None])[0])
        if clearance < self.clearance_m:
            raise WorldError(
                f"{self.path}: {name} {_text(point)} lies in or too near an obstacle: its clearance is "
                f"{clearance:.2f} m, clearance_m={self.clearance_m:g} is needed"
            )
        return point

    def _drawn_ends(
        self, scene: Scene, flight_bounds_m: Float, rng: np.random.Generator
    ) -> tuple[Float, Float]:
        """Start and target at the flight height, in the largest free part of that plane."""
        height = self.flight_height_m
        if not flight_bounds_m[0, 2] <= height <= flight_bounds_m[1, 2]:
            raise WorldError(
                f"{self.path}: flight_height_m={height:g} lies outside the flight bounds, z "
                f"{flight_bounds_m[0, 2]:g} to {flight_bounds_m[1, 2]:g} m"
            )
        points, part, sizes = task.free_layer(scene, flight_bounds_m, height, self.clearance_m)
        if sizes.size == 0:
            raise WorldError(
                f"{self.path}: nowhere at flight_height_m={height:g} has the body's centre "
                f"clearance_m={self.clearance_m:g} of room"
            )
        points = points[part == sizes.argmax()]
        for _ in range(SAMPLE_ATTEMPTS):
            start = points[rng.integers(points.shape[0])]
            far = points[np.linalg.norm(points - start, axis=1) >= self.least_distance_m]
            if far.shape[0] > 0:
                return start, far[rng.integers(far.shape[0])]
        extent = float(np.linalg.norm(np.ptp(points, axis=0)))
        raise WorldError(
            f"{self.path}: no two points at flight_height_m={height:g} in the largest free part, "
            f"{extent:.1f} m across, are least_distance_m={self.least_distance_m:g} apart"
        )


def _text(values: Float) -> str:
    return "[" + ", ".join(f"{value:g}" for value in np.round(values, 3)) + "]"
