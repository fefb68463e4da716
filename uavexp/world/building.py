"""The true geometry of a building from what its file holds: triangles, and which space is solid."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from uavexp.arrays import Bool, Float, Float32, Int32
from uavexp.errors import WorldError, require
from uavexp.formats import FREE, SOLID, UNMEASURED, Cells, Content
from uavexp.space import Space
from uavexp.world.frame import Frame, corners_of
from uavexp.world.solidity import space_of_cells, space_of_mesh, space_of_points
from uavexp.world.voxel_mesh import exposed_faces

MAX_CELLS = 200_000_000  # that points are gathered in
LARGEST_M3 = 100_000.0  # of a building, or of the part of it that is flown in
SLAB_M = 0.1  # thickness of the floor and ceiling of a plan
_TELL_UNMEASURED = 0.05  # share of the map from which on it is told


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Building:
    """Surfaces and space of a building, in m, z up."""

    vertices_m: Float32  # (V, 3)
    triangles: Int32  # (F, 3)
    space: Space
    origin_m: Float  # (3,) taken off all coordinates of the file
    unit_m: float  # of the file
    notes: tuple[str, ...]


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """How what a file holds is read."""

    frame: Frame
    voxel_size_m: float  # of the cells that points are gathered in
    wall_height_m: float  # to which plans are extruded from z = 0
    unmeasured_is_solid: bool
    bounds_m: Float | None  # (2, 3) in the file's coordinates: nothing beyond it is asked for


def building_of(content: Content, reading: Reading) -> Building:
    """Return the building; raise `WorldError` when it is too large."""
    frame, cells = reading.frame, content.cells
    if cells is not None and cells.is_plan:
        require(
            frame.unit_m == 1.0 and frame.up_axis == "z",
            "unit_m and up_axis do not apply to a plan, which is in m with z up",
        )
    if cells is not None:
        cells = frame.upright(cells)
        points = corners_of(cells)
    elif len(content.points):
        points = frame.turned(content.points)
    else:
        surface, triangles = _surface(content)
        points = frame.turned(surface)
    origin_m = frame.origin_m(points)
    bounds_m = None if reading.bounds_m is None else reading.bounds_m - origin_m
    _check_size(points - origin_m, bounds_m, frame)
    if cells is not None:
        cells = dataclasses.replace(cells, origin=cells.origin - origin_m)
        vertices, triangles, space = _of_cells(cells, reading)
    elif len(content.points):
        vertices, triangles, space = _of_points(points - origin_m, reading, bounds_m)
    else:
        vertices = (points - origin_m).astype(np.float32)
        space = space_of_mesh(vertices, triangles, bounds_m)
    return Building(
        vertices_m=vertices,
        triangles=triangles,
        space=space,
        origin_m=origin_m,
        unit_m=frame.unit_m,
        notes=(*content.warnings, *frame.notes(content), *_notes(cells, reading, origin_m)),
    )


def _surface(content: Content) -> tuple[Float, Int32]:
    """The mesh without vertices of no triangle, which may lie anywhere."""
    is_used = np.zeros(content.vertices.shape[0], dtype=np.bool_)
    is_used[content.triangles] = True
    place = (np.cumsum(is_used) - 1).astype(np.int32)
    return content.vertices[is_used], place[content.triangles]


def _check_size(points_m: Float, bounds_m: Float | None, frame: Frame) -> None:
    """Refuse what is too large to fly in: the box of points (N, 3), or its part within the bounds."""
    box = np.stack([points_m.min(axis=0), points_m.max(axis=0)])
    size_m = np.diff(box if bounds_m is None else np.clip(box, *bounds_m), axis=0)[0]
    if np.prod(size_m) > LARGEST_M3:
        extent = " x ".join(f"{edge:.6g}" for edge in size_m)
        raise WorldError(
            f"{frame.path}: {extent} m are too large to fly in, at most {LARGEST_M3:,.0f} m³ are allowed; "
            f"give smaller world.flight_bounds_m, or is world.unit_m={frame.unit_m:g} wrong?"
        )


def _notes(cells: Cells | None, reading: Reading, origin_m: Float) -> list[str]:
    notes = []
    if origin_m.any():
        taken = ",".join(f"{value:.12g}" for value in origin_m)
        notes.append(f"its far origin [{taken}] m was taken off all coordinates, those you give included")
    share = 0.0 if cells is None else float(np.mean(cells.state == UNMEASURED))
    if share >= _TELL_UNMEASURED:
        how = "counts as wall" if reading.unmeasured_is_solid else "is flown through (world.unknown=free)"
        notes.append(f"{100.0 * share:.0f} % of the map was never measured and {how}")
    return notes


def _of_cells(cells: Cells, reading: Reading) -> tuple[Float32, Int32, Space]:
    solid: Bool = cells.state == SOLID
    if reading.unmeasured_is_solid:
        solid |= cells.state == UNMEASURED
    if cells.is_plan:
        mesh = _extruded(solid[..., 0], cells, reading.wall_height_m)
        cells = dataclasses.replace(cells, size=np.array([*cells.size[:2], reading.wall_height_m]))
    else:
        mesh = exposed_faces(solid, cells.origin, cells.size)
    if cells.is_plan or (cells.state == UNMEASURED).any():
        space = space_of_cells(cells.state, cells.origin, cells.size, cells.yaw_rad, is_plan=cells.is_plan)
    else:  # nothing tells measured air from what was not looked at
        space = space_of_points(solid, cells.origin, float(cells.size.min()))
    return *mesh, dataclasses.replace(space, unmeasured_is_solid=reading.unmeasured_is_solid)


def _of_points(points_m: Float, reading: Reading, bounds_m: Float | None) -> tuple[Float32, Int32, Space]:
    """Cells that hold points (N, 3), as solids; within the bounds when given."""
    size = reading.voxel_size_m
    if bounds_m is not None:
        points_m = points_m[((points_m > bounds_m[0]) & (points_m < bounds_m[1])).all(axis=1)]
        if not points_m.shape[0]:
            raise WorldError(
                f"{reading.frame.path}: nothing lies within world.flight_bounds_m; is world.unit_m right?"
            )
    index = np.floor(points_m / size).astype(np.int64)
    first = index.min(axis=0)
    shape = index.max(axis=0) - first + 1
    if np.prod(shape, dtype=np.float64) > MAX_CELLS:
        extent = " x ".join(f"{edge:g}" for edge in np.round(shape * size, 1))
        fits = size * (float(np.prod(shape, dtype=np.float64)) / MAX_CELLS) ** (1.0 / 3.0)
        raise WorldError(
            f"{reading.frame.path}: {extent} m are too many voxels of {size:g} m; "
            f"world.voxel_size_m={math.ceil(100.0 * fits) / 100.0:g} fits, or give smaller "
            f"world.flight_bounds_m; is world.unit_m={reading.frame.unit_m:g} right?"
        )
    state = np.full(shape, FREE, dtype=np.uint8)
    state[tuple((index - first).T)] = SOLID
    return _of_cells(Cells(state=state, origin=first * size, size=np.full(3, size)), reading)


def _extruded(solid: Bool, plan: Cells, wall_height_m: float) -> tuple[Float32, Int32]:
    """Walls (X, Y) of a plan, with floor and ceiling over its whole extent."""
    layers = np.ones((*solid.shape, 3), dtype=np.bool_)
    layers[..., 1] = solid
    vertices, triangles = exposed_faces(layers, np.zeros(3), np.array([*plan.size[:2], 1.0]))
    heights = np.array([-SLAB_M, 0.0, wall_height_m, wall_height_m + SLAB_M], dtype=np.float32)
    vertices[:, 2] = heights[np.rint(vertices[:, 2]).astype(np.int64)]
    c, s = math.cos(plan.yaw_rad), math.sin(plan.yaw_rad)
    x, y = vertices[:, 0].astype(np.float64), vertices[:, 1].astype(np.float64)
    vertices[:, 0] = plan.origin[0] + c * x - s * y
    vertices[:, 1] = plan.origin[1] + s * x + c * y
    return vertices, triangles
