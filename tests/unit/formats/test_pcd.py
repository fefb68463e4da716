"""Pcd clouds: every form against what was written, good files against Open3D."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.folders import SHARED
from tests.formats import only_world_errors
from uavexp.errors import WorldError
from uavexp.formats import Options, lzf, read
from uavexp.o3d import open3d

POINTS = np.random.default_rng(0).integers(-50, 50, (60, 3)).astype(np.float64)
TYPES = {"F": "f", "I": "i", "U": "u"}


def pcd(points: np.ndarray, data: str, fields: str, types: str, sizes: str, counts: str = "") -> bytes:
    """A file whose other fields hold ones; binary_compressed as runs of literals."""
    names, counts = fields.split(), counts or " ".join("1" for _ in fields.split())
    columns, stored = [], []
    for name, kind, size, count in zip(names, types.split(), sizes.split(), counts.split(), strict=True):
        dtype = np.dtype(f"<{TYPES[kind]}{size}")
        values = points[:, "xyz".index(name)] if name in "xyz" else np.ones(len(points))
        columns.append(np.repeat(values[:, None], int(count), axis=1))
        stored.append(columns[-1].astype(dtype))
    head = f"# made\nVERSION 0.7\nFIELDS {fields}\nSIZE {sizes}\nTYPE {types}\nCOUNT {counts}\n"
    head += f"WIDTH {len(points)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(points)}\nDATA {data}\n"
    if data == "ascii":
        body = "\n".join(" ".join(f"{v:g}" for v in row) for row in np.hstack(columns)).encode()
    elif data == "binary":
        body = b"".join(b"".join(part[i].tobytes() for part in stored) for i in range(len(points)))
    else:
        block = b"".join(part.tobytes() for part in stored)
        runs = [block[i : i + 32] for i in range(0, len(block), 32)]
        packed = b"".join(bytes([len(run) - 1]) + run for run in runs)
        body = np.array([len(packed), len(block)], "<u4").tobytes() + packed
    return head.encode() + body


@pytest.mark.parametrize("data", ["ascii", "binary", "binary_compressed"])
@pytest.mark.parametrize(
    ("fields", "types", "sizes", "counts"),
    [
        ("x y z", "F F F", "4 4 4", ""),
        ("x y z", "F F F", "8 8 8", ""),
        ("x y z", "I I I", "2 4 8", ""),
        ("label z rgb y x _", "U F F F F U", "4 4 4 8 4 1", "1 1 1 1 1 3"),
        ("x y z normal _ hist", "F F F F U F", "4 4 4 4 1 4", "1 1 1 3 4 33"),
    ],
)
def test_every_form_holds_the_same_points(
    tmp_path: Path, data: str, fields: str, types: str, sizes: str, counts: str
) -> None:
    (tmp_path / "a.PCD").write_bytes(pcd(POINTS, data, fields, types, sizes, counts))
    content = read(tmp_path / "a.PCD", Options())
    np.testing.assert_array_equal(content.points, POINTS)
    assert content.warnings == ()


@pytest.mark.parametrize("data", ["ascii", "binary", "binary_compressed"])
def test_points_that_are_not_finite_are_dropped_with_a_word(tmp_path: Path, data: str) -> None:
    points = POINTS.copy()
    points[5] = np.nan
    points[7, 1] = np.inf
    (tmp_path / "a.pcd").write_bytes(pcd(points, data, "x y z", "F F F", "4 4 4"))
    content = read(tmp_path / "a.pcd", Options())
    np.testing.assert_array_equal(content.points, np.delete(POINTS, [5, 7], axis=0))
    assert "2 of 60" in content.warnings[0]


def test_copies_of_the_compression_may_run_into_themselves() -> None:
    out = np.zeros(12, dtype=np.uint8)
    packed = np.frombuffer(b"\x01ab" + bytes([7 << 5, 1, 1]), dtype=np.uint8)  # "ab", then 7 + 1 + 2 letters
    assert lzf.decompress(packed, out)
    assert out.tobytes() == b"abababababab"
    assert not lzf.decompress(packed, np.zeros(11, dtype=np.uint8))  # no room
    assert not lzf.decompress(packed, np.zeros(13, dtype=np.uint8))  # not filled
    assert not lzf.decompress(packed[:5], out)
    assert not lzf.decompress(np.frombuffer(b"\x20\x00", dtype=np.uint8), out)  # from before the beginning


@pytest.mark.parametrize("data", ["ascii", "binary", "binary_compressed"])
def test_a_file_cut_anywhere_is_truncated(tmp_path: Path, data: str) -> None:
    whole = pcd(POINTS, data, "x y z label", "F F F U", "4 4 4 4")
    for length in np.linspace(10, len(whole) - 2, 40).astype(int):
        (tmp_path / "a.pcd").write_bytes(whole[:length])
        with pytest.raises(WorldError, match=r"truncated|damaged"):
            read(tmp_path / "a.pcd", Options())


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        (b"POINTS 60", b"POINTS 999999999", "WIDTH times HEIGHT"),
        (
            b"WIDTH 60\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 60",
            b"POINTS 999999999",
            "promised|cannot be",
        ),
        (b"FIELDS x y z", b"FIELDS x y w", "no field z"),
        (b"SIZE 4 4 4", b"SIZE 4 3 4", "field y"),
        (b"COUNT 1 1 1", b"COUNT 1 1 999999999", "field z"),
        (b"TYPE F F F", b"TYPE F F", "TYPE"),
        (b"DATA", b"DATUM", "no pcd"),
        (b"DATA binary", b"DATA packed", "DATA"),
    ],
)
@pytest.mark.parametrize("data", ["ascii", "binary", "binary_compressed"])
def test_a_header_that_promises_something_else(
    tmp_path: Path, data: str, old: bytes, new: bytes, word: str
) -> None:
    whole = pcd(POINTS, data, "x y z", "F F F", "4 4 4")
    if old not in whole:
        pytest.skip("of another form")
    (tmp_path / "a.pcd").write_bytes(whole.replace(old, new))
    with pytest.raises(WorldError, match=word):
        read(tmp_path / "a.pcd", Options())


@pytest.mark.skipif(not SHARED.is_dir(), reason=f"no {SHARED}")
@pytest.mark.parametrize("path", sorted(SHARED.glob("**/*.pcd")), ids=lambda path: path.name)
def test_published_clouds_are_those_that_open3d_reads(path: Path) -> None:
    cloud = open3d.io.read_point_cloud(str(path), remove_nan_points=True, remove_infinite_points=True)
    points = read(path, Options()).points
    np.testing.assert_allclose(points, np.asarray(cloud.points), rtol=1e-6, atol=1e-6)


@settings(max_examples=50, deadline=None)
@given(
    place=st.integers(0),
    byte=st.integers(0, 255),
    data=st.sampled_from(["ascii", "binary", "binary_compressed"]),
)
def test_damaged_bytes_end_in_one_line(
    tmp_path_factory: pytest.TempPathFactory, place: int, byte: int, data: str
) -> None:
    path = tmp_path_factory.mktemp("pcd") / "a.pcd"
    path.write_bytes(pcd(POINTS[:9], data, "x y z i", "F F F U", "4 4 4 1"))
    only_world_errors(path, place, byte)
