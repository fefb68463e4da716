"""STL files: binary and text are the same cube, and damage is one line."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.damage import DAMAGES, check_ends_well, damaged
from tests.folders import DATA, SHARED
from tests.shaped_meshes import CUBE, TRIANGLES, check_is_cube
from uavexp import formats
from uavexp.errors import WorldError
from uavexp.formats import Content, stl


def binary(head: bytes = b"made here", corners: np.ndarray = CUBE[TRIANGLES]) -> bytes:
    facets = np.zeros(len(corners), stl.FACETS)
    facets["corners"] = corners
    return head.ljust(80, b" ") + len(corners).to_bytes(4, "little") + facets.tobytes()


def text(corners: np.ndarray = CUBE[TRIANGLES], name: str = "cube") -> str:
    facets = "".join(
        "facet normal 0 0 0\n  outer loop\n"
        + "".join(f"    vertex {x:.6e} {y:.6e} {z:.6e}\n" for x, y, z in corner)
        + "  endloop\nendfacet\n"
        for corner in corners
    )
    return f"solid {name}\n{facets}endsolid {name}\n"


def read(folder: Path, data: bytes | str) -> Content:
    path = folder / "cube.stl"
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return formats.read(path, formats.Options())


@pytest.mark.parametrize(
    "data",
    [
        binary(),
        binary(b"solid, though binary"),
        binary(b"solid facet"),
        text(),
        text().upper(),
        text().replace("\n", "\r\n"),
        text(name=""),
        text(name="vertex facet endfacet"),
        text(CUBE[TRIANGLES[:5]]) + text(CUBE[TRIANGLES[5:]]),
        text().rstrip("\n"),
        text(CUBE[TRIANGLES] - 0.0 * CUBE[TRIANGLES[::-1]]),
    ],
    ids=[
        "binary",
        "solid",
        "solid-facet",
        "text",
        "upper",
        "crlf",
        "nameless",
        "named",
        "two-solids",
        "open-end",
        "zeros",
    ],
)
def test_every_form(tmp_path: Path, data: bytes | str) -> None:
    content = read(tmp_path, data)
    check_is_cube(content)
    assert (content.kind, content.vertices.shape, content.warnings) == ("stl mesh", (8, 3), ())


@pytest.mark.parametrize("head", [b"", b"solid facet"])
def test_bytes_after_the_last_facet_are_named(tmp_path: Path, head: bytes) -> None:
    content = read(tmp_path, binary() + b"\0\1")
    check_is_cube(content)
    assert content.warnings == ("2 bytes after its last facet were not read",)


def test_zeros_of_either_sign_are_one_place(tmp_path: Path) -> None:
    corners = CUBE[TRIANGLES]
    corners[::2] = np.where(corners[::2] == 0.0, -0.0, corners[::2])
    assert read(tmp_path, binary(corners=corners)).vertices.shape == (8, 3)


@given(places=st.lists(st.integers(0, 9), min_size=9, max_size=60))
def test_welded_points_are_the_points(places: list[int]) -> None:
    points = np.random.default_rng(0).normal(size=(10, 3)).astype(np.float32)[places]
    vertices, place = stl._welded(points)
    np.testing.assert_array_equal(vertices[place], points)
    assert vertices.shape[0] == len(set(places))


@pytest.mark.parametrize(
    ("data", "word"),
    [
        (binary()[:-1], "684 bytes expected, 683 found"),
        (binary()[:83], "no stl"),
        (binary()[:80] + b"\xff\xff\xff\xff" + binary()[84:], "truncated"),
        (binary(corners=CUBE[TRIANGLES[:0]]), "no triangles"),
        (binary(corners=CUBE[TRIANGLES] + np.nan), "NaN"),
        (text()[:-60], "without its endsolid"),
        (text().replace("1.000000e+00", "nan"), "NaN"),
        (text().replace("1.000000e+00", "1.0.0", 1), "holds '1.0.0'"),
        (text().replace("    vertex", "    vertix", 1), "12 facets need 3 vertices"),
        (text().replace("1.000000e+00\n", "\n", 1), "12 facets need 3 vertices"),
    ],
)
def test_a_damaged_file(tmp_path: Path, data: bytes | str, word: str) -> None:
    with pytest.raises(WorldError, match=word):
        read(tmp_path, data)


@settings(max_examples=60, deadline=None)
@given(damage=DAMAGES)
@pytest.mark.parametrize("whole", [binary(), text().encode()], ids=["binary", "text"])
def test_damage_ends_in_content_or_one_line(
    whole: bytes, damage: tuple[float, list[tuple[float, bytes]]]
) -> None:
    check_ends_well("m.stl", damaged(whole, damage))


def test_trimesh_reads_the_same() -> None:
    trimesh = pytest.importorskip("trimesh")

    files = [DATA / "flat.stl", *SHARED.glob("worlds/*/orig/*.stl")]
    for file in files:
        content = formats.read(file, formats.Options())
        other = trimesh.load(file, force="mesh")  # which welds as well
        np.testing.assert_array_equal(content.vertices[content.triangles], other.triangles)
        assert content.vertices.shape == other.vertices.shape
