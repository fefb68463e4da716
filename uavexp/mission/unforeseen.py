"""How the truth comes to differ from the map known before the flight: blocks, moved and missing parts."""

from __future__ import annotations

import dataclasses
import hashlib
import math
from collections.abc import Sequence

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from uavexp.arrays import Bool, Float, Float32, Int, Int32
from uavexp.errors import WorldError
from uavexp.scene import Scene
from uavexp.types import ReferenceMap, World
from uavexp.world import task
from uavexp.world.boxes import Boxes
from uavexp.world.solidity import space_after

ATTEMPTS = 60  # drawings of a block before giving up
KEEP_M = 1.2  # between a block and the start
SHELL_M = 0.1  # a part of the mesh that comes so near to the map's bounds is the building itself
LIFT_M = 0.005  # of a block over what it stands on, so that the two do not touch

Mesh = tuple[Float32, Int32]


def with_blocks(
    world: World,
    count: int,
    width_m: Sequence[float],
    height_m: Sequence[float],
    clearance_m: float,
    rng: np.random.Generator,
) -> World:
    """The world with boxes that stand in its free space and cut nothing off.

    Every place at the start's height that stays free with the clearance stays joined with the start.

    Args:
        world: as known before.
        count: of the blocks.
        width_m: least and greatest length of a side.
        height_m: least and greatest height.
        clearance_m: of the vehicle's centre.
        rng: draws sizes, places and yaws.

    Raises:
        WorldError: a block finds no place.
    """
    for number in range(count):
        placed = _with_block(world, width_m, height_m, clearance_m, rng)
        if placed is None:
            message = (
                f"mission: no room for block {number + 1} of {count} after {ATTEMPTS} drawings; "
                "fewer or smaller ones"
            )
            raise WorldError(message)
        world = placed
    return world


def _with_block(
    world: World,
    width_m: Sequence[float],
    height_m: Sequence[float],
    clearance_m: float,
    rng: np.random.Generator,
) -> World | None:
    scene = Scene(world)
    points, joined = _joined_layer(scene, world, clearance_m)
    points = points[joined]
    for _ in range(ATTEMPTS):
        size = [*rng.uniform(width_m[0], width_m[1], 2), rng.uniform(height_m[0], height_m[1])]
        yaw, pick = rng.uniform(0.0, math.pi), rng.random()
        if len(points) == 0:
            return None
        place = points[int(pick * len(points))]
        down = np.concatenate([place, [0.0, 0.0, -1.0]]).astype(np.float32)
        drop = float(scene.fixed_cast(down[None])[0][0])
        away = math.dist(place[:2], world.start_m[:2]) - 0.5 * math.hypot(size[0], size[1])
        if not math.isfinite(drop) or away < KEEP_M:
            continue
        boxes = Boxes()
        boxes.stand(place[0], place[1], size, yaw, place[2] - drop + LIFT_M)
        if scene.touches_fixed(np.array(boxes.rows[0][:3]), _about_z(yaw), np.array(size)):
            continue
        more = with_mesh(world, _merged((world.vertices_m, world.triangles), boxes.mesh()))
        if _still_joined(points, Scene(more), more, clearance_m):
            return more
    return None


def _joined_layer(scene: Scene, world: World, clearance_m: float) -> tuple[Float, Bool]:
    """Free places (N, 3) at the start's height, and which are joined with the one nearest to it."""
    points, part, _ = task.free_layer(scene, world.flight_bounds_m, float(world.start_m[2]), clearance_m)
    if len(points) == 0:
        return points, np.zeros(0, dtype=np.bool_)
    nearest = int(np.argmin(np.linalg.norm(points - world.start_m, axis=1)))
    return points, (part == part[nearest]) & world.space.is_free(points)


def _still_joined(before_m: Float, scene: Scene, world: World, clearance_m: float) -> bool:
    """Whether the places joined before that are still free are still joined."""
    points, joined = _joined_layer(scene, world, clearance_m)
    known = {tuple(point) for point in np.round(before_m, 6)}
    lost = [tuple(point) in known for point in np.round(points[~joined], 6)]
    return bool(joined.any()) and not any(lost)


def dropped(mesh: Mesh, bounds_m: Float, share: float, rng: np.random.Generator) -> tuple[Mesh, Bool]:
    """The mesh less a share of its connected parts, and which triangles (F,) are left.

    Parts that reach the bounds, the building's shell, stay.
    """
    vertices, triangles = mesh
    part = parts_of(triangles, len(vertices))
    count = int(part.max(initial=-1)) + 1
    go = rng.random(count) < share
    for number in range(count):
        corners = vertices[triangles[part == number]].reshape(-1, 3)
        inner = (corners > bounds_m[0] + SHELL_M).all() and (corners < bounds_m[1] - SHELL_M).all()
        go[number] &= bool(inner)
    keep = ~go[part]
    return (vertices, np.ascontiguousarray(triangles[keep])), keep


def parts_of(triangles: Int32, vertices: int) -> Int:
    """Number (F,) of the connected part that each triangle belongs to; joined means sharing a vertex."""
    ends = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]]])
    graph = coo_matrix((np.ones(len(ends), np.int8), (ends[:, 0], ends[:, 1])), shape=(vertices, vertices))
    label = connected_components(graph, directed=False)[1]
    return np.asarray(np.unique(label[triangles[:, 0]], return_inverse=True)[1], dtype=np.int64)


def moved(reference: ReferenceMap, shift_m: float, turn_rad: float, rng: np.random.Generator) -> ReferenceMap:
    """The reference map turned about its middle and shifted level; direction and sense are drawn."""
    bearing, sense = 2.0 * math.pi * rng.random(), 1.0 if rng.random() < 0.5 else -1.0
    if shift_m == 0.0 and turn_rad == 0.0:
        return reference
    vertices = reference.vertices_m.astype(np.float64)
    middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    shift = shift_m * np.array([math.cos(bearing), math.sin(bearing), 0.0])
    vertices = middle + (vertices - middle) @ _about_z(sense * turn_rad).T + shift
    return dataclasses.replace(reference, vertices_m=vertices.astype(np.float32))


def with_reference(world: World, reference: ReferenceMap) -> World:
    """The world with this map known before the flight; both are in its digest."""
    digest = hashlib.sha256(world.digest.encode())
    for array in (reference.vertices_m, reference.triangles, reference.inspected):
        digest.update(str(array.shape).encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return dataclasses.replace(world, reference=reference, digest=digest.hexdigest())


def with_mesh(world: World, mesh: Mesh) -> World:
    """The world with another geometry; the task's figures stay those of the building as it was known."""
    digest = hashlib.sha256(world.digest.encode())
    for array in mesh:
        digest.update(str(array.shape).encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return dataclasses.replace(world, vertices_m=mesh[0], triangles=mesh[1], digest=digest.hexdigest())


def with_space(world: World) -> World:
    """The world with the space of its geometry as it is by now; what was never measured stays so."""
    space = space_after(world.space, world.vertices_m, world.triangles, world.start_m)
    return dataclasses.replace(world, space=space)


def _merged(first: Mesh, second: Mesh) -> Mesh:
    return (
        np.concatenate([first[0], second[0]]).astype(np.float32),
        np.concatenate([first[1], second[1] + len(first[0])]).astype(np.int32),
    )


def _about_z(angle_rad: float) -> Float:
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
