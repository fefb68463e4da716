"""PLY files: every form of one cube is the same cube, and damage is one line."""

import itertools
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings

from tests.damage import DAMAGES, check_ends_well, damaged
from tests.folders import DATA, SHARED
from tests.shaped_meshes import CUBE, QUADS, TRIANGLES, check_is_cube
from uavexp import formats
from uavexp.errors import WorldError
from uavexp.formats import Content

CODES = {
    "char": "b",
    "uchar": "B",
    "int16": "h",
    "ushort": "H",
    "int": "i",
    "uint32": "I",
    "float": "f",
    "double": "d",
}
Row = list[tuple[str, float | list[float], str | None]]  # type, number or list, type of a list's length


def row(order: str, numbers: Row) -> bytes:
    """A row as the format stores it; order: < > or none for text."""
    if not order:
        words = ([len(n), *n] if isinstance(n, list) else [n] for _, n, _ in numbers)
        return " ".join(f"{word:g}" for word in itertools.chain(*words)).encode() + b"\n"
    parts = []
    for type_, number, count_type in numbers:
        values = number if isinstance(number, list) else [number]
        if count_type:
            parts.append(struct.pack(order + CODES[count_type], len(values)))
        cast = float if type_ in ("float", "double") else int
        parts.append(struct.pack(f"{order}{len(values)}{CODES[type_]}", *map(cast, values)))
    return b"".join(parts)


FORMATS = {"": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}


def ply(
    order: str,
    faces: list[list[int]],
    *,
    element: str = "face",
    number: str = "float",
    index: str = "int",
    count: str = "uchar",
    name: str = "vertex_indices",
    extra: bool = False,
    vertices: np.ndarray = CUBE,
) -> bytes:
    """A file of vertices and faces; extra: elements and properties that say nothing of the shape."""
    lists = "property list ushort double weights\nproperty uchar red\n" if extra else ""
    lines = [
        "ply",
        f"format {FORMATS[order]} 1.0",
        "comment " + ("x" * 5000 if extra else "made here"),
        *(["element camera 2", "property double view"] if extra else []),
        f"element vertex {len(vertices)}",
        lists + "\n".join(f"property {number} {axis}" for axis in "xyz"),
        f"element {element} {len(faces)}",
        f"{lists}property list {count} {index} {name}",
        *(["element edge 1", "property int vertex1"] if extra else []),
        "end_header",
    ]
    body = [row(order, [("double", 7.5, None)])] * 2 if extra else []
    for place, vertex in enumerate(vertices):
        odd: Row = [("double", [1.0] * (place % 3), "ushort"), ("uchar", 3, None)] if extra else []
        body.append(row(order, [*odd, *((number, float(x), None) for x in vertex)]))
    for place, corners in enumerate(faces):
        odd = [("double", [2.0] * (place % 2), "ushort"), ("uchar", 4, None)] if extra else []
        body.append(row(order, [*odd, (index, [float(corner) for corner in corners], count)]))
    if extra:
        body.append(row(order, [("int", 5, None)]))
    return "\n".join(lines).encode() + b"\n" + b"".join(body)


def read(folder: Path, data: bytes) -> Content:
    path = folder / "cube.ply"
    path.write_bytes(data)
    return formats.read(path, formats.Options())


MIXED = [*QUADS[:3].tolist(), *TRIANGLES[6:].tolist()]


@pytest.mark.parametrize("order", FORMATS)
@pytest.mark.parametrize("extra", [False, True])
@pytest.mark.parametrize("faces", [TRIANGLES.tolist(), QUADS.tolist(), MIXED], ids=["tri", "quad", "mixed"])
def test_faces_of_any_corners_in_any_order_of_bytes(
    tmp_path: Path, order: str, extra: bool, faces: list[list[int]]
) -> None:
    content = read(tmp_path, ply(order, faces, extra=extra))
    check_is_cube(content)
    assert content.kind == "ply mesh"
    assert content.vertices.shape == (8, 3)


@pytest.mark.parametrize("order", FORMATS)
@pytest.mark.parametrize(
    "types",
    [
        {"number": "double", "index": "uint32", "count": "int", "name": "vertex_index"},
        {"number": "int16", "index": "uchar", "count": "ushort"},
        {"number": "char", "index": "ushort", "count": "uint32"},
    ],
)
def test_numbers_of_any_type(tmp_path: Path, order: str, types: dict[str, str]) -> None:
    check_is_cube(read(tmp_path, ply(order, QUADS.tolist(), **types)))


@pytest.mark.parametrize("order", FORMATS)
@pytest.mark.parametrize("rows", [1, 2])
def test_triangle_strips(tmp_path: Path, order: str, rows: int) -> None:
    strips = [[0, 1, 2, 3, -1, 4, 6, 5, 7, -1, 0, 4, 1, 5, -1, 2, 3, 6, 7], [0, 2, 4, 6, -1, 1, 5, 3, 7]]
    faces = strips if rows == 2 else [[*strips[0], -1, *strips[1]]]
    check_is_cube(read(tmp_path, ply(order, faces, element="tristrips", count="int")))


@pytest.mark.parametrize("end", [b"\r\n", b"\r"])
@pytest.mark.parametrize("order", FORMATS)
def test_lines_of_the_header_may_end_as_elsewhere(tmp_path: Path, order: str, end: bytes) -> None:
    data = ply(order, TRIANGLES.tolist())
    begin = data.index(b"end_header") + 11
    check_is_cube(read(tmp_path, data[:begin].replace(b"\n", end) + data[begin:]))
    check_is_cube(read(tmp_path, data[: begin - 1] + b"\r\n" + data[begin:]))


@pytest.mark.parametrize("order", FORMATS)
def test_vertices_without_faces_are_points(tmp_path: Path, order: str) -> None:
    content = read(tmp_path, ply(order, [], extra=True))
    np.testing.assert_array_equal(content.points, CUBE)
    assert (content.kind, content.triangles.size, content.warnings) == ("ply cloud", 0, ())


def test_points_that_are_not_finite_are_dropped_with_a_word(tmp_path: Path) -> None:
    vertices = CUBE.copy()
    vertices[3, 1] = np.nan
    content = read(tmp_path, ply("<", [], vertices=vertices))
    np.testing.assert_array_equal(content.points, np.delete(CUBE, 3, axis=0))
    assert "1 of 8 points" in content.warnings[0]
    with pytest.raises(WorldError, match="1 vertices that are NaN"):
        read(tmp_path, ply("<", TRIANGLES.tolist(), vertices=vertices))


@pytest.mark.parametrize("order", FORMATS)
def test_a_face_of_two_corners_is_named(tmp_path: Path, order: str) -> None:
    content = read(tmp_path, ply(order, [*QUADS.tolist(), [0, 1]]))
    check_is_cube(content)
    assert content.warnings == ("1 of 7 faces have fewer than 3 corners",)


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ("element vertex 8", "element vertex 80000000000000", "truncated"),
        ("element face 12", "element face 4000000000", "truncated"),
        ("element face 12", "element face 13", "truncated"),
        ("element face 12", f"element face {'9' * 5000}", "header holds"),
        ("element vertex 8", "element vertex -8", "header holds"),
        ("property float z", "property float w", "x, y and z"),
        ("property float z", "property quad z", "header holds 'property quad z'"),
        ("vertex_indices", "corners", "without a list vertex_indices"),
        ("list uchar", "list float", "truncated"),
        ("element face", "element vertex", "header holds"),
        ("end_header", "end_headed", "header"),
        ("ply", "play", "no ply"),
    ],
)
def test_a_header_that_promises_something_else(tmp_path: Path, old: str, new: str, word: str) -> None:
    data = ply("<", TRIANGLES.tolist())
    assert data.count(old.encode()) == 1
    with pytest.raises(WorldError, match=word):
        read(tmp_path, data.replace(old.encode(), new.encode()))


@pytest.mark.parametrize("order", FORMATS)
@pytest.mark.parametrize("wrong", [-1, 8, 100_000])
@pytest.mark.parametrize("faces", [TRIANGLES.tolist(), QUADS.tolist()], ids=["tri", "quad"])
def test_an_index_beyond_the_vertices(tmp_path: Path, order: str, wrong: int, faces: list[list[int]]) -> None:
    faces[-1][1] = wrong  # a native reader looked there, and died of it
    with pytest.raises(WorldError, match=f"names vertex {wrong} of 8"):
        read(tmp_path, ply(order, faces))


@pytest.mark.parametrize("order", FORMATS)
@pytest.mark.parametrize("faces", [[], MIXED], ids=["cloud", "mesh"])
def test_a_file_cut_short_is_truncated(tmp_path: Path, order: str, faces: list[list[int]]) -> None:
    data = ply(order, faces, vertices=CUBE + 0.125)
    for cut in range(data.index(b"end_header") + 12, len(data) - 1, 7):
        with pytest.raises(WorldError, match="truncated"):
            read(tmp_path, data[: cut if order else data.rindex(b" ", 0, cut)])


@settings(max_examples=60, deadline=None)
@given(damage=DAMAGES)
@pytest.mark.parametrize("order", FORMATS)
def test_damage_ends_in_content_or_one_line(
    order: str, damage: tuple[float, list[tuple[float, bytes]]]
) -> None:
    check_ends_well("m.ply", damaged(ply(order, MIXED, extra=True, index="int"), damage))


@pytest.mark.skipif(not SHARED.is_dir(), reason=f"no third-party worlds in {SHARED}")
def test_open3d_reads_the_same_of_buildings() -> None:
    from uavexp.o3d import open3d

    files = [DATA / "flat.ply", *SHARED.glob("worlds/*/mesh.ply")]
    assert len(files) > 10
    for file in files:
        content = formats.read(file, formats.Options())
        other = open3d.io.read_triangle_mesh(str(file))
        np.testing.assert_array_equal(content.vertices, np.asarray(other.vertices))
        np.testing.assert_array_equal(content.triangles, np.asarray(other.triangles))
