"""The geometries of a COLLADA file: their sources and their polygons, strips and fans."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from uavexp.arrays import Float, Int
from uavexp.errors import WorldError
from uavexp.formats.number_text import integers, numbers
from uavexp.formats.polygons import check_indices, fan, strip, triangulate

SURFACES = ("triangles", "polylist", "polygons", "tristrips", "trifans")
PASSED_OVER = {
    "lines": "lines were not read",
    "linestrips": "lines were not read",
    "spline": "splines were not read",
    "brep": "boundary representations were not read",
}


class Library:
    """The elements of a file by their names."""

    def __init__(self, path: Path, root: Element) -> None:
        self.path = path
        self._named = {(item.tag, item.get("id")): item for item in root.iter() if item.get("id")}

    def target(self, reference: Element, attribute: str, *tags: str) -> Element:
        """Return the element of one of these tags that an attribute names; raise `WorldError` without one."""
        name = reference.get(attribute, "")
        for tag in tags if name.startswith("#") else ():
            if (tag, name[1:]) in self._named:
                return self._named[tag, name[1:]]
        raise WorldError(
            f"world file {self.path} is damaged: its {reference.tag} names {name!r}, which is no "
            f"{' or '.join(tags)} of it"
        )

    def numbers(self, text: str, count: int | None = None) -> Float:
        """Return the numbers (N,) of a text; raise `WorldError` unless there are so many."""
        return numbers(self.path, text, count)

    def integer(self, item: Element, attribute: str, default: int) -> int:
        """Return the whole number of an attribute; raise `WorldError` when it is none."""
        return int(integers(self.path, self.numbers(item.get(attribute, str(default)), 1))[0])

    def indices(self, text: str | None) -> Int:
        """Return the whole numbers (N,) of a text."""
        return integers(self.path, self.numbers(text or ""))


def surfaces(library: Library, geometry: Element, warnings: dict[str, None]) -> Iterator[tuple[Float, Int]]:
    """Yield vertices (V, 3) and triangles (F, 3) of each set of faces; what is no face adds a warning."""
    for shape in geometry:
        if shape.tag in PASSED_OVER:
            warnings[PASSED_OVER[shape.tag]] = None
        for item in shape if shape.tag in ("mesh", "convex_mesh") else ():
            if item.tag in PASSED_OVER:
                warnings[PASSED_OVER[item.tag]] = None
            elif item.tag in SURFACES:
                yield _surface(library, item, warnings)


def _surface(library: Library, item: Element, warnings: dict[str, None]) -> tuple[Float, Int]:
    inputs = item.findall("input")
    vertex = next((entry for entry in inputs if entry.get("semantic") == "VERTEX"), None)
    if vertex is None:
        raise WorldError(f"world file {library.path} is damaged: a {item.tag} has no VERTEX input")
    offsets = [library.integer(entry, "offset", 0) for entry in inputs]
    step, offset = max(offsets) + 1, offsets[inputs.index(vertex)]
    if min(offsets) < 0:
        raise WorldError(f"world file {library.path} is damaged: an input has the offset {min(offsets)}")
    vertices = _positions(library, library.target(vertex, "source", "vertices", "source"))
    if item.find("ph") is not None:
        warnings["holes of polygons were not read"] = None
    runs = [_every(library, text, step, offset) for text in item.iterfind("p")]
    runs += [_every(library, text, step, offset) for text in item.iterfind("ph/p")]
    corners = np.concatenate([np.empty(0, dtype=np.int64), *runs])
    check_indices(library.path, corners, vertices.shape[0])
    if item.tag in ("tristrips", "trifans"):
        build = strip if item.tag == "tristrips" else fan
        return vertices, np.concatenate([np.empty((0, 3), dtype=np.int64), *map(build, runs)])
    if item.tag == "triangles":
        counts = np.full(corners.size // 3, 3)
    elif item.tag == "polylist":
        counts = library.indices(item.findtext("vcount"))
    else:
        counts = np.array([run.size for run in runs], dtype=np.int64)
    promised = library.integer(item, "count", counts.size)
    if counts.size < promised or (counts < 0).any() or counts.sum() != corners.size:
        raise WorldError(
            f"world file {library.path} is damaged or truncated: a {item.tag} promises {promised} faces, "
            f"{counts.size} with {corners.size} corners found"
        )
    return vertices, triangulate(library.path, vertices, corners, counts)


def _every(library: Library, text: Element, step: int, offset: int) -> Int:
    """Indices of one input of those that alternate in a text."""
    values = library.indices(text.text)
    if values.size % step:
        raise WorldError(
            f"world file {library.path} is damaged or truncated: {values.size} indices are not by {step}"
        )
    return values[offset::step]


def _positions(library: Library, source: Element) -> Float:
    """Positions (V, 3) of a source, or of the vertices that name it."""
    if source.tag == "vertices":
        position = next((item for item in source if item.get("semantic") == "POSITION"), None)
        if position is None:
            raise WorldError(f"world file {library.path} is damaged: its vertices have no POSITION input")
        source = library.target(position, "source", "source")
    accessor = source.find("technique_common/accessor")
    array = (
        source.find("float_array") if accessor is None else library.target(accessor, "source", "float_array")
    )
    if array is None:
        raise WorldError(f"world file {library.path} is damaged: a source holds no float_array")
    values = library.numbers(array.text or "")
    promised = library.integer(array, "count", 0)
    if values.size < promised:
        raise WorldError(
            f"world file {library.path} is truncated: an array promises {promised} numbers, has {values.size}"
        )
    if accessor is None:
        return values[: values.size // 3 * 3].reshape(-1, 3)
    count, offset = library.integer(accessor, "count", 0), library.integer(accessor, "offset", 0)
    stride = library.integer(accessor, "stride", 3)
    if min(count, offset) < 0 or stride < 3 or offset + count * stride > values.size:
        raise WorldError(
            f"world file {library.path} is damaged or truncated: an accessor of {count} positions finds "
            f"{values.size} numbers"
        )
    return values[offset : offset + count * stride].reshape(count, stride)[:, :3]
