"""OBJ files: faces of every form are the same cube, and damage is one line."""

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings

from tests.damage import DAMAGES, check_ends_well, damaged
from tests.folders import DATA
from tests.shaped_meshes import CUBE, QUADS, TRIANGLES, check_is_cube
from uavexp import formats
from uavexp.errors import WorldError
from uavexp.formats import Content, obj

VERTICES = "".join(f"v {x:g} {y:g} {z:g}\n" for x, y, z in CUBE)
NORMALS = "vn 0 0 1\nvt 0.5 0.5\n"


def faces(corners: np.ndarray, form: str = "{0}") -> str:
    """Lines of faces; form: how a corner is written, 0 its number from 1, 1 from the last."""
    words = (" ".join(form.format(c + 1, c - 8) for c in face) for face in corners)
    return "".join(f"f {face}\n" for face in words)


def read(folder: Path, text: str | bytes) -> Content:
    path = folder / "cube.obj"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return formats.read(path, formats.Options())


@pytest.mark.parametrize("corners", [QUADS, TRIANGLES], ids=["quads", "triangles"])
@pytest.mark.parametrize("form", ["{0}", "{0}/1", "{0}//1", "{0}/1/1", "{1}", "{1}/-1/-1", "+{0}"])
def test_corners_of_every_form(tmp_path: Path, corners: np.ndarray, form: str) -> None:
    content = read(tmp_path, VERTICES + NORMALS + faces(corners, form))
    check_is_cube(content)
    assert (content.kind, content.vertices.shape) == ("obj mesh", (8, 3))


def test_negative_indices_count_from_their_own_line(tmp_path: Path) -> None:
    one = VERTICES + faces(QUADS, "{1}")
    two = read(tmp_path, one + one)
    np.testing.assert_array_equal(two.triangles[12:] - two.triangles[:12], np.full((12, 3), 8))


@pytest.mark.parametrize(
    "text",
    [
        faces(QUADS) + VERTICES,
        (VERTICES + faces(QUADS)).replace(" ", "\t "),
        (VERTICES + faces(QUADS)).replace("\n", "\r\n"),
        (VERTICES + faces(QUADS)).replace("\n", "\r"),
        (VERTICES + faces(QUADS)).replace(" ", " \\\n"),
        (VERTICES + faces(QUADS)).replace(" ", "\\\r\n "),
        (VERTICES + faces(QUADS)).replace("\n", " # v 1 2\n\n"),
        VERTICES.replace("\n", " 1.0\n") + faces(QUADS),
        VERTICES.replace("\n", " 0.5 0.5 0.5\n") + faces(QUADS),
        (VERTICES + faces(QUADS)).rstrip("\n"),
        "\ufeff" + VERTICES + faces(QUADS),
        "mtllib none.mtl\no a b\ng c\nusemtl d\ns off\n" + VERTICES + "vp 0.1\nl 1 2\np 3\n" + faces(QUADS),
        VERTICES.replace("v 1", "   v 1.000e+00") + faces(QUADS),
    ],
    ids=range(13),
)
def test_lines_of_every_form(tmp_path: Path, text: str) -> None:
    check_is_cube(read(tmp_path, text))


def test_lines_across_the_pieces_of_a_large_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = VERTICES + faces(QUADS[:3]).replace(" ", "\\\n ") + faces(QUADS[3:], "{1}/7")
    for piece in (1, 2, 3, 7, 64):
        monkeypatch.setattr(obj, "PIECE", piece)
        check_is_cube(read(tmp_path, text))


def test_textures_are_not_opened(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.png")  # opening it would wait for ever
    os.mkfifo(tmp_path / "pipe.mtl")
    (tmp_path / "m.mtl").write_text("newmtl a\nmap_Kd pipe.png\n")
    for library in ("m.mtl", "pipe.mtl"):
        check_is_cube(read(tmp_path, f"mtllib {library}\n{VERTICES}usemtl a\n{faces(QUADS)}"))


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ("f 1 2 4 3", "f 1 2 4 9", "names vertex 8 of 8"),
        ("f 1 2 4 3", "f 1 2 4 0", "names vertex -1 of 8"),
        ("f 1 2 4 3", "f 1 2 4 -9", "names vertex -1 of 8"),
        ("f 1 2 4 3", "f 1 2 4 99999999999999999999", "index"),
        ("f 1 2 4 3", "f 1 2 4 1.5", "index"),
        ("f 1 2 4 3", "f 1 2 4 x", "holds 'x'"),
        ("f 1 2 4 3", "f 1 2 4 /1/1", "corner of a face names no vertex"),
        ("f 1 2 4 3", "f 1 2", "three corners, got 'f 1 2'"),
        ("f 1 2 4 3", "f", "three corners, got 'f'"),
        ("v 0 0 1", "v 0 0", "three numbers, got 'v 0 0'"),
        ("v 0 0 1", "v 0 0 nan", "NaN"),
        ("v 0 0 1", "v 0 0 1-2", "holds '1-2'"),
        ("v 0 0 1", "v 0 0 \x00", "holds"),
    ],
)
def test_a_damaged_line(tmp_path: Path, old: str, new: str, word: str) -> None:
    text = VERTICES + faces(QUADS)
    assert text.count(old + "\n") == 1
    with pytest.raises(WorldError, match=word):
        read(tmp_path, text.replace(old + "\n", new + "\n"))


def test_a_file_without_faces(tmp_path: Path) -> None:
    with pytest.raises(WorldError, match="no triangles"):
        read(tmp_path, VERTICES)


@settings(max_examples=100, deadline=None)
@given(damage=DAMAGES)
def test_damage_ends_in_content_or_one_line(damage: tuple[float, list[tuple[float, bytes]]]) -> None:
    whole = VERTICES + NORMALS + faces(QUADS[:3], "{0}/1") + faces(QUADS[3:], "{1}")
    check_ends_well("m.obj", damaged(whole.encode(), damage))


def test_trimesh_reads_the_same(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")

    other = trimesh.load(DATA / "flat.obj", process=False, force="mesh")
    content = formats.read(DATA / "flat.obj", formats.Options())
    np.testing.assert_array_equal(content.vertices[content.triangles], other.triangles)
