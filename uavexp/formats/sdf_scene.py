"""The collision shapes of a Gazebo world and where they stand, before any mesh is read."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from uavexp.arrays import Float
from uavexp.errors import WorldError
from uavexp.formats.number_text import numbers
from uavexp.formats.sdf_files import find, model_file
from uavexp.formats.sdf_poses import placed, pose_matrix
from uavexp.formats.xml_file import parse

MAX_MODELS = 100_000
MAX_DEPTH = 20  # of models in models
SHOWN = 5  # names that a warning lists
SHAPES = ("box", "sphere", "ellipsoid", "cylinder", "capsule", "cone", "polyline", "plane", "mesh")
BY_ORIGIN = "models placed by a frame of their own stand by their origin"
UNREAD = ("actor", "population", "road")  # elements of a world
FAR_M = 10_000.0  # from the middle of the others: what fell out of a world that was saved while it ran


@dataclass(frozen=True, slots=True)
class Shape:
    """A collision shape: its model's name, its element, its place (4, 4) in the world, the file of both."""

    model: str
    geometry: Element
    matrix: Float
    file: Path
    mesh: Path | None = None  # the file of a mesh


@dataclass(frozen=True, slots=True)
class Model:
    """A model to be placed: its element, its matrix (4, 4) in the world, and what is said of it elsewhere."""

    element: Element
    matrix: Float
    file: Path
    depth: int = 0  # of models around it
    is_static: bool = False  # because of what holds it
    state: Element | None = None  # where the world's state puts its links


class Scene:
    """What stands in a world so far."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.shapes: list[Shape] = []
        self._roots: dict[Path, Element] = {}  # of the files of models
        self._notes: dict[str, dict[str, None]] = {}  # names by what holds of them
        self._models = 0

    @property
    def files(self) -> tuple[Path, ...]:
        """Files of the models."""
        return tuple(self._roots)

    def note(self, sentence: str, name: str) -> None:
        """Remember what a person should know of something by its name."""
        self._notes.setdefault(sentence, {})[name] = None

    def warnings(self) -> tuple[str, ...]:
        """Return what was noted, a sentence each."""
        return tuple(f"{sentence}: {_some(list(names))}" for sentence, names in self._notes.items())

    def add_model(self, model: Model) -> None:
        """Add the shapes of a model's links, and of the models in it."""
        element, name = model.element, model.element.get("name", "")
        self._models += 1
        if model.depth > MAX_DEPTH or self._models > MAX_MODELS:
            raise WorldError(
                f"world file {self.path} places more than {MAX_MODELS} models, or one in {MAX_DEPTH} others"
            )
        is_static = model.is_static or _is_true(element, "static")
        if element.find("link") is not None and not is_static:
            self.note("models that are not static stand where the file puts them", name)
        if element.find("plugin") is not None:
            self.note("models with plugins, which may move them, stand still", name)
        if element.get("placement_frame"):
            self.note(BY_ORIGIN, name)
        if model.state is not None and (numbers(self.path, model.state.findtext("scale", "1")) != 1.0).any():
            self.note("models that the saved state scales stand unscaled", name)
        if element.find("link/visual") is not None and element.find("link/collision") is None:
            self.note("models that are seen but collide with nothing were not read", name)
        for item in element:
            if item.tag == "link":
                self._add_link(model, item)
            elif item.tag == "model":
                matrix = model.matrix @ placed(model.file, element, item)
                self.add_model(Model(item, matrix, model.file, model.depth + 1, is_static))
            elif item.tag == "include":
                self.add_include(element, item, model.matrix, model.file, model.depth + 1, is_static)

    def _add_link(self, model: Model, link: Element) -> None:
        matrix = model.matrix @ placed(model.file, model.element, link)
        for state in () if model.state is None else model.state.findall("link"):
            if state.get("name") == link.get("name") and state.find("pose") is not None:
                matrix = pose_matrix(self.path, state.find("pose"))  # in the world
        for collision in link.iterfind("collision"):
            place = matrix @ placed(model.file, link, collision)
            for geometry in collision.iterfind("geometry/*"):
                shape = Shape(model.element.get("name", ""), geometry, place, model.file)
                if geometry.tag == "mesh":
                    self._add_mesh(shape)
                elif geometry.tag in SHAPES:
                    self.shapes.append(shape)
                elif geometry.tag != "empty":
                    self.note(f"shapes of the kind {geometry.tag} were not read", shape.model)

    def _add_mesh(self, shape: Shape) -> None:
        uri = shape.geometry.findtext("uri", "").strip()
        mesh = find(uri, shape.file, self.path)
        if mesh is None or not mesh.is_file():
            self.note("meshes were not found beside the world or above it, and are missing", uri)
        else:
            self.shapes.append(replace(shape, mesh=mesh))

    def add_include(
        self,
        scope: Element,
        include: Element,
        matrix: Float,
        file: Path,
        depth: int,
        is_static: bool,
        states: dict[str, Element] | None = None,
    ) -> None:
        """Add the model that an include names; the matrix is of the frame of what holds it."""
        uri = include.findtext("uri", "").strip()
        found = find(uri, file, self.path)
        source = None if found is None else model_file(found)
        pose = include.find("pose")
        if source is None:
            place = matrix @ placed(file, scope, include)
            self._add_built_in(uri, place)
            return
        root = self._root(source)
        element = root.find("model")
        if element is None:
            if root.find("light") is None:
                self.note("files hold no model", source.name)
            return
        if include.find("placement_frame") is not None:
            self.note(BY_ORIGIN, source.parent.name)
        inner = placed(source, root, element) if pose is None else placed(file, scope, include)
        state = (states or {}).get(include.findtext("name", element.get("name", "")).strip())
        place = matrix @ inner if state is None else pose_matrix(self.path, state.find("pose"))
        is_static = is_static or _is_true(include, "static")
        self.add_model(Model(element, place, source, depth + 1, is_static, state))

    def _add_built_in(self, uri: str, matrix: Float) -> None:
        """A model that comes with Gazebo, or a word on one that was not found."""
        name = uri.rstrip("/").rpartition("/")[2]
        kind = name.lower().replace(" ", "_")
        if kind == "ground_plane":
            self.shapes.append(Shape(name, Element("plane"), matrix, self.path))
        elif kind != "sun":
            self.note("models were not found beside the world or above it, and are missing", name)

    def drop_far(self) -> None:
        """Leave out shapes that stand far from the others."""
        if not self.shapes:
            return
        place = np.array([shape.matrix[:3, 3] for shape in self.shapes])
        is_far = np.abs(place - np.median(place, axis=0)).max(axis=1) > FAR_M
        for shape in (shape for shape, far in zip(self.shapes, is_far, strict=True) if far):
            self.note(f"models farther than {FAR_M:g} m from the others were not read", shape.model)
        self.shapes = [shape for shape, far in zip(self.shapes, is_far, strict=True) if not far]

    def _root(self, file: Path) -> Element:
        if file not in self._roots:
            self._roots[file] = parse(file)
        return self._roots[file]


def scene(path: Path) -> Scene:
    """Return what stands in a file's first world, or its models when it has no world.

    Raises:
        WorldError: the file or one that it names is damaged.
    """
    root, found = parse(path), Scene(path)
    if root.tag != "sdf":
        raise WorldError(f"world file {path} is no Gazebo world: its root is {root.tag}, sdf is needed")
    worlds = root.findall("world")
    for name in (world.get("name", "") for world in worlds[1:]):
        found.note("worlds after the first were not read", name)
    world = worlds[0] if worlds else root
    states = {item.get("name", ""): item for item in world.iterfind("state/model[pose]")}
    for item in [*world, *world.iterfind("state/insertions/model")]:
        if item.tag == "model":
            state = states.get(item.get("name", ""))
            matrix = placed(path, world, item) if state is None else pose_matrix(path, state.find("pose"))
            found.add_model(Model(item, matrix, path, state=state))
        elif item.tag == "include":
            found.add_include(world, item, np.eye(4), path, 0, False, states)
        elif item.tag in UNREAD:
            found.note(f"elements of the kind {item.tag} were not read", item.get("name", ""))
    found.drop_far()
    return found


def _is_true(element: Element, name: str) -> bool:
    return element.findtext(name, "").strip().lower() in ("1", "true")


def _some(names: list[str]) -> str:
    shown = ", ".join(names[:SHOWN])
    return shown if len(names) <= SHOWN else f"{shown} and {len(names) - SHOWN} more"
