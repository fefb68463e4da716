"""COLLADA files (.dae): the triangles of the scene, each node where it stands (Khronos 1.4.1, 1.5)."""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
from scipy.spatial.transform import Rotation

from uavexp.arrays import Float, Int
from uavexp.errors import WorldError
from uavexp.formats.base import Content, Options
from uavexp.formats.collada_mesh import Library, surfaces
from uavexp.formats.parts import Parts
from uavexp.formats.xml_file import parse

MAX_NODES = 100_000  # that a scene may place: nodes can name each other
UP_AXES = {"X_UP": "x", "Y_UP": "y", "Z_UP": "z"}
TRANSFORMS = {"matrix": 16, "translate": 3, "rotate": 4, "scale": 3}  # numbers of each
UNSUPPORTED = ("lookat", "skew")


def read(path: Path, options: Options) -> Content:
    """Return the mesh of a file's scene, in the file's own unit and axes, which are named with it.

    Raises:
        WorldError: the file is damaged, or holds less than it promises.
    """
    root = parse(path)
    if root.tag != "COLLADA":
        raise WorldError(f"world file {path} is no COLLADA file: its root is {root.tag}")
    library = Library(path, root)
    parts, warnings = Parts(path), dict[str, None]()
    shapes: dict[Element, list[tuple[Float, Int]]] = {}
    for geometry, matrix in _placed(library, root, warnings):
        if geometry not in shapes:
            shapes[geometry] = list(surfaces(library, geometry, warnings))
        for vertices, triangles in shapes[geometry]:
            parts.add(vertices, triangles, matrix)
    return parts.content(
        "dae mesh",
        tuple(warnings),
        unit_m=_unit_m(library, root),
        up_axis=UP_AXES.get(root.findtext("asset/up_axis", "").strip(), "y"),
    )


def _unit_m(library: Library, root: Element) -> float:
    unit = root.find("asset/unit")
    unit_m = 1.0 if unit is None else float(library.numbers(unit.get("meter", "1"), 1)[0])
    if not 0.0 < unit_m < np.inf:
        raise WorldError(f"world file {library.path} is damaged: its unit is {unit_m} m")
    return unit_m


def _placed(library: Library, root: Element, warnings: dict[str, None]) -> list[tuple[Element, Float]]:
    """Geometries of the scene with the matrices (4, 4) of their places; without a scene all as they are."""
    scene = root.find("scene/instance_visual_scene")
    if scene is None:
        return [(geometry, np.eye(4)) for geometry in root.iterfind("library_geometries/geometry")]
    placed, nodes = list[tuple[Element, Float]](), 0
    todo = [(library.target(scene, "url", "visual_scene"), np.eye(4))]
    while todo:
        node, matrix = todo.pop()
        nodes += 1
        if nodes > MAX_NODES:
            raise WorldError(f"world file {library.path} places more than {MAX_NODES} nodes; give less")
        matrix = matrix @ _matrix(library, node)
        for child in node:
            if child.tag == "node":
                todo.append((child, matrix))
            elif child.tag == "instance_node":
                todo.append((library.target(child, "url", "node"), matrix))
            elif child.tag == "instance_geometry":
                placed.append((library.target(child, "url", "geometry"), matrix))
            elif child.tag == "instance_controller":
                warnings["skins and morphs stand as they were modelled, not posed"] = None
                placed.append((_controlled(library, child), matrix))
    return placed


def _matrix(library: Library, node: Element) -> Float:
    """Product (4, 4) of a node's transforms, in their order."""
    product = np.eye(4)
    for child in node:
        if child.tag in UNSUPPORTED:
            raise WorldError(f"world file {library.path} uses {child.tag}, which is not supported; bake it")
        if child.tag not in TRANSFORMS:
            continue
        values = library.numbers(child.text or "", TRANSFORMS[child.tag])
        matrix = np.eye(4)
        if child.tag == "matrix":
            matrix = values.reshape(4, 4)
        elif child.tag == "translate":
            matrix[:3, 3] = values
        elif child.tag == "scale":
            matrix[:3, :3] = np.diag(values)
        else:
            axis = values[:3] / max(float(np.linalg.norm(values[:3])), np.finfo(float).tiny)
            matrix[:3, :3] = Rotation.from_rotvec(values[3] * axis, degrees=True).as_matrix()
        product = product @ matrix
    return product


def _controlled(library: Library, instance: Element) -> Element:
    """The geometry that a controller, or a chain of them, moves."""
    target = library.target(instance, "url", "controller")
    for _ in range(MAX_NODES):
        if target.tag != "controller":
            return target
        inner = target.find("skin")
        inner = target.find("morph") if inner is None else inner
        if inner is None:
            break
        target = library.target(inner, "source", "geometry", "controller")
    raise WorldError(f"world file {library.path} is damaged: a controller moves nothing")
