"""glTF 2.0 files (.glb, .gltf): the triangles of the default scene, each node where it stands."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from uavexp.arrays import Float, Int
from uavexp.errors import WorldError, one_line
from uavexp.formats.base import Content, Options
from uavexp.formats.gltf_buffers import Document, buffer_files, check_uncompressed, load, normalised
from uavexp.formats.parts import Parts
from uavexp.formats.polygons import check_indices, fan, strip

INSTANCING = "EXT_mesh_gpu_instancing"
# extensions that a reader of shapes may not know: looks and lights; beginnings of their names
HARMLESS = (
    "KHR_mesh_quantization",
    "KHR_materials_",
    "KHR_texture_",
    "KHR_lights_",
    "KHR_xmp",
    "KHR_animation",
    "EXT_texture_",
    "EXT_lights_",
    "EXT_mesh_features",
    "EXT_structural_metadata",
    "MSFT_texture_",
)
TRIANGLES, STRIP, FAN = 4, 5, 6  # modes of a primitive; lesser ones are points and lines


def read(path: Path, options: Options) -> Content:
    """Return the triangles of a file's default scene; quantised positions are read.

    Raises:
        WorldError: the file is damaged, a buffer is missing, its geometry is compressed.
    """
    document = load(path)
    try:
        _check_extensions(document)
        return _scene(document)
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, OverflowError) as error:
        raise WorldError(f"world file {path} is damaged: {type(error).__name__} {one_line(error)}") from error


def files(path: Path) -> tuple[Path, ...]:
    """Return the files of the buffers."""
    return buffer_files(path)


def _check_extensions(document: Document) -> None:
    required = document.json.get("extensionsRequired", [])
    check_uncompressed(document.path, required)
    for name in required:
        if not name.startswith(HARMLESS):
            raise WorldError(
                f"world file {document.path} needs the extension {name}, which is not supported; "
                "export it without"
            )


def _scene(document: Document) -> Content:
    parts, skipped, skins = Parts(document.path), 0, 0
    seen = set[int]()
    nodes = [(index, np.eye(4)) for index in _roots(document)]
    while nodes:
        index, matrix = nodes.pop()
        node = document.entry("nodes", index)
        if index in seen:
            raise WorldError(f"world file {document.path} is damaged: its node {index} stands in two places")
        seen.add(index)
        matrix = matrix @ _matrix(node)
        nodes += [(child, matrix) for child in node.get("children", [])]
        if "mesh" not in node:
            continue
        if INSTANCING in node.get("extensions", {}):
            raise WorldError(f"world file {document.path} uses {INSTANCING}; export it without instancing")
        for primitive in document.entry("meshes", node["mesh"])["primitives"]:
            if primitive.get("mode", TRIANGLES) < TRIANGLES:
                skipped += 1
            else:
                parts.add(*_surface(document, primitive), matrix)
        skins += "skin" in node
    warnings = (
        (skipped, f"{skipped} sets of points or lines were not read"),
        (skins, f"{skins} skinned meshes stand as they were modelled, not posed"),
        (len(document.json.get("scenes", [])) > 1, "of several scenes the default one was read"),
    )
    kind = f"{document.path.suffix[1:].lower()} mesh"
    return parts.content(kind, tuple(text for holds, text in warnings if holds), unit_m=1.0, up_axis="y")


def _roots(document: Document) -> list[int]:
    """Nodes of the default scene; without scenes, those that are nobody's child."""
    if document.json.get("scenes"):
        roots: list[int] = document.entry("scenes", document.json.get("scene", 0)).get("nodes", [])
        return roots
    nodes = document.json.get("nodes", [])
    children = {child for node in nodes for child in node.get("children", [])}
    return [index for index in range(len(nodes)) if index not in children]


def _matrix(node: dict[str, Any]) -> Float:
    """Matrix (4, 4) of a node in its parent's frame."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    turn = Rotation.from_quat(node.get("rotation", (0.0, 0.0, 0.0, 1.0))).as_matrix()
    matrix = np.eye(4)
    matrix[:3, :3] = turn * np.array(node.get("scale", (1.0, 1.0, 1.0)), dtype=np.float64).reshape(3)
    matrix[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return matrix


def _surface(document: Document, primitive: dict[str, Any]) -> tuple[Float, Int]:
    """Vertices (V, 3) and triangles (F, 3) of a primitive."""
    check_uncompressed(document.path, primitive.get("extensions", {}))
    index = primitive["attributes"]["POSITION"]
    positions = document.accessor(index)
    if positions.shape[1] != 3:
        raise ValueError(f"a position must have 3 numbers, got {positions.shape[1]}")
    if document.entry("accessors", index).get("normalized", False):
        positions = normalised(positions)
    vertices = positions.astype(np.float64)
    if "indices" in primitive:
        corners = document.accessor(primitive["indices"])[:, 0].astype(np.int64)
    else:
        corners = np.arange(vertices.shape[0])
    check_indices(document.path, corners, vertices.shape[0])
    mode = primitive.get("mode", TRIANGLES)
    if mode == TRIANGLES:
        return vertices, corners.reshape(-1, 3)
    return vertices, (strip if mode == STRIP else fan)(corners)
