"""Gazebo worlds and models (.world, .sdf): what collides in them, each part where it stands (SDFormat)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from uavexp.arrays import Float
from uavexp.errors import WorldError
from uavexp.formats import collada, gltf, obj, ply, solids, stl
from uavexp.formats.base import Content, Options
from uavexp.formats.number_text import numbers
from uavexp.formats.parts import Parts
from uavexp.formats.sdf_scene import Scene, Shape, scene

MESHES = {
    ".dae": collada,
    ".obj": obj,
    ".stl": stl,
    ".ply": ply,
    ".glb": gltf,
    ".gltf": gltf,
}


def read(path: Path, options: Options) -> Content:
    """Return the collision shapes of a world as one mesh, in m, z up.

    Planes, which have no end in Gazebo, are cut to the extent of the rest. Models stand
    where the world's state, else their pose puts them. What is not read is a warning.

    Raises:
        WorldError: a file of the world is damaged, or nothing of it is solid.
    """
    found = scene(path)
    parts, meshes = Parts(path), dict[Path, Content]()
    for shape in found.shapes:
        if shape.geometry.tag == "mesh":
            _add_mesh(parts, meshes, found, shape)
        elif shape.geometry.tag != "plane":
            vertices, triangles = _solid(shape)
            parts.add(vertices, triangles, shape.matrix)
    rest, warnings = parts.vertices, found.warnings()
    if not rest.size:
        words = "; ".join(warnings) or "it has no collision shapes but planes"
        raise WorldError(f"world file {path} holds nothing solid: {words}")
    for shape in found.shapes:
        if shape.geometry.tag == "plane":
            _add_plane(parts, shape, rest)
    return parts.content("Gazebo world", warnings, unit_m=1.0, up_axis="z")


def files(path: Path) -> tuple[Path, ...]:
    """Return the files of the models and meshes that stand in a world, and of the meshes' buffers."""
    found = scene(path)
    meshes = dict.fromkeys(shape.mesh for shape in found.shapes if shape.mesh is not None)
    scenes = [mesh for mesh in meshes if mesh.suffix.lower() in (".glb", ".gltf")]
    buffers = [file for mesh in scenes for file in gltf.files(mesh)]
    return (*found.files, *meshes, *buffers)


def _add_mesh(parts: Parts, meshes: dict[Path, Content], found: Scene, shape: Shape) -> None:
    file = shape.mesh
    if file is None:
        return
    if file.suffix.lower() not in MESHES:
        found.note(f"meshes of the kind {file.suffix} were not read", file.name)
        return
    if file not in meshes:
        meshes[file] = MESHES[file.suffix.lower()].read(file, Options())
    content = meshes[file]
    scale = _vector(shape, "scale", "1 1 1") * (content.unit_m or 1.0)
    if shape.geometry.find("submesh") is not None:
        found.note("submeshes were read as whole meshes", file.name)
    parts.add(content.vertices, content.triangles.astype(np.int64), shape.matrix @ np.diag([*scale, 1.0]))


def _solid(shape: Shape) -> solids.Mesh:
    match shape.geometry.tag:
        case "box":
            return solids.box(_vector(shape, "size", "1 1 1"))
        case "sphere":
            return solids.ellipsoid(np.full(3, _number(shape, "radius", "1")))
        case "ellipsoid":
            return solids.ellipsoid(_vector(shape, "radii", "1 1 1"))
        case "cylinder":
            return solids.cylinder(_number(shape, "radius", "1"), _number(shape, "length", "1"))
        case "capsule":
            return solids.capsule(_number(shape, "radius", "0.5"), _number(shape, "length", "1"))
        case "cone":
            return solids.cone(_number(shape, "radius", "0.5"), _number(shape, "length", "1"))
        case "polyline":
            points = [numbers(shape.file, point.text or "", 2) for point in shape.geometry.iterfind("point")]
            if len(points) < 3:
                raise WorldError(f"world file {shape.file} is damaged: a polyline has {len(points)} points")
            return solids.prism(shape.file, np.array(points), _number(shape, "height", "1"))
        case other:
            raise WorldError(f"world file {shape.file} has the shape {other}, which is not supported")


def _add_plane(parts: Parts, shape: Shape, rest: Float) -> None:
    """Add a plane as far as the rest (V, 3) of the world reaches."""
    normal = _vector(shape, "normal", "0 0 1")
    if not normal.any():
        raise WorldError(f"world file {shape.file} is damaged: a plane has the normal 0 0 0")
    matrix = shape.matrix.copy()
    matrix[:3, :3] = shape.matrix[:3, :3] @ _upright(normal)
    box = np.stack([rest.min(axis=0), rest.max(axis=0)])
    corners = box[np.indices((2, 2, 2)).reshape(3, -1).T, np.arange(3)]
    inside = ((corners - matrix[:3, 3]) @ matrix[:3, :3])[:, :2]
    low, high = inside.min(axis=0), inside.max(axis=0)
    parts.add(*solids.rectangle(low, high), matrix)


def _upright(normal: Float) -> Float:
    """Rotation (3, 3) that turns z to a normal; none where it is z already."""
    z = normal / np.linalg.norm(normal)
    x = np.array([1.0, 0.0, 0.0]) if abs(z[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def _vector(shape: Shape, name: str, default: str) -> Float:
    return numbers(shape.file, shape.geometry.findtext(name, default), len(default.split()))


def _number(shape: Shape, name: str, default: str) -> float:
    return float(_vector(shape, name, default)[0])
