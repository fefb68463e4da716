"""Polygon files (.ply), text or binary: a mesh of polygons or triangle strips, or a cloud (Turk 1994)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from uavexp.arrays import Int
from uavexp.errors import WorldError
from uavexp.formats.base import Content, Options, cloud, mesh
from uavexp.formats.number_text import integers, numbers, quoted
from uavexp.formats.ply_elements import Body, Column, Element, Property, columns
from uavexp.formats.polygons import check_indices, strip, triangulate

TYPES = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "float": "f4",
    "double": "f8",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "int64": "i8",
    "uint64": "u8",
    "float32": "f4",
    "float64": "f8",
}
ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
CORNERS = ("vertex_indices", "vertex_index")  # names of the list of a face's corners
WANTED = {"vertex": ("x", "y", "z"), "face": CORNERS, "tristrips": CORNERS}  # properties of elements


def read(path: Path, options: Options) -> Content:
    """Return the mesh of a file with faces or strips, the cloud of one without.

    Elements and properties of other names are passed over.

    Raises:
        WorldError: the file is damaged, or shorter than its header promises.
    """
    data = path.read_bytes()
    order, elements, begin = _header(path, data)
    if order:
        body = Body(np.frombuffer(data, dtype=np.uint8, offset=begin), order)
    else:
        body = Body(numbers(path, data[begin:]), order)
    tables, place = dict[str, dict[str, Column]](), 0
    for element in elements:
        wanted = WANTED.get(element.name, ())
        tables[element.name], place = columns(path, body, element, place, wanted)
    vertex = tables.get("vertex", {})
    if not {"x", "y", "z"} <= vertex.keys():
        raise WorldError(f"world file {path} holds no vertices with x, y and z")
    vertices = np.stack([vertex[axis].values for axis in "xyz"], axis=1)
    if not any(element.rows and element.name in ("face", "tristrips") for element in elements):
        return cloud(path, "ply cloud", vertices)
    faces, counts = _corners(path, "face", tables)
    strips = strip(_strips(path, tables, vertices.shape[0]))
    flat = int(np.count_nonzero(counts < 3))
    warnings = (f"{flat} of {counts.size} faces have fewer than 3 corners",) if flat else ()
    triangles = np.concatenate([triangulate(path, vertices, faces, counts), strips])
    return mesh(path, "ply mesh", vertices, triangles, warnings)


def _header(path: Path, data: bytes) -> tuple[str, list[Element], int]:
    """Byte order, elements, and where the body begins."""
    end_of_line = b"\r" if data[3:4] == b"\r" and data[4:5] != b"\n" else b"\n"
    begin, order, elements = data.find(end_of_line) + 1, None, dict[str, Element]()
    if data[:begin].strip() != b"ply":
        raise WorldError(f"world file {path} is no ply file: it does not begin with 'ply'")
    while True:
        end = data.find(end_of_line, begin)
        if end < 0:
            raise WorldError(f"world file {path} is damaged or truncated: its ply header has no end")
        line, begin = data[begin:end], end + 1
        match line.decode("latin-1").split():
            case [] | ["comment" | "obj_info", *_]:
                pass
            case ["format", name, _] if name in ORDERS:
                order = ORDERS[name]
            case ["element", name, rows] if rows.isdecimal() and len(rows) < 19 and name not in elements:
                elements[name] = Element(name, int(rows))
            case ["property", *words] if elements and (item := _property(words)):
                elements[next(reversed(elements))].properties.append(item)
            case ["end_header"] if order is not None:
                return order, list(elements.values()), begin
            case _:
                raise WorldError(f"world file {path} is damaged: its ply header holds {quoted(line)}")


def _property(words: list[str]) -> Property | None:
    match words:
        case ["list", count_type, type_, name] if {count_type, type_} <= TYPES.keys():
            return Property(name, TYPES[type_], TYPES[count_type])
        case [type_, name] if type_ in TYPES:
            return Property(name, TYPES[type_])
        case _:
            return None


def _corners(path: Path, name: str, tables: dict[str, dict[str, Column]]) -> tuple[Int, Int]:
    """Indices of vertices of an element's lists, one list after the other, and how many in each."""
    if name not in tables:
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    for column in tables[name].values():
        if column.counts is not None:
            return integers(path, column.values), column.counts
    raise WorldError(f"world file {path} has the element {name} without a list {' or '.join(CORNERS)}")


def _strips(path: Path, tables: dict[str, dict[str, Column]], vertices: int) -> Int:
    """Strips of a file, -1 between them."""
    corners, counts = _corners(path, "tristrips", tables)
    check_indices(path, corners[corners != -1], vertices)
    return np.insert(corners, np.cumsum(counts)[:-1], -1)
