"""Las and laz scans: what laspy wrote, and headers that promise something else."""

import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.formats import only_world_errors
from uavexp.errors import WorldError
from uavexp.formats import Options, read

laspy = pytest.importorskip("laspy")
POINTS = np.random.default_rng(0).uniform(-40.0, 40.0, (150, 3)).round(3) + np.array([4e5, 5.6e6, 100.0])


def scan(path: Path, version: str = "1.2", kind: int = 3) -> Path:
    las = laspy.create(point_format=kind, file_version=version)
    las.header.scales, las.header.offsets = [0.001] * 3, [400_000.0, 5_600_000.0, 0.0]
    las.x, las.y, las.z = POINTS.T
    las.write(path)
    return path


@pytest.mark.parametrize("name", ["a.las", "a.LAZ"])
@pytest.mark.parametrize(("version", "kind"), [("1.2", 0), ("1.2", 3), ("1.4", 6), ("1.4", 8)])
def test_points_have_scale_and_offset(tmp_path: Path, name: str, version: str, kind: int) -> None:
    content = read(scan(tmp_path / name.lower(), version, kind).rename(tmp_path / name), Options())
    np.testing.assert_allclose(content.points, POINTS, atol=1e-6, rtol=0)  # far origins stay
    assert content.kind == f"{name[2:].lower()} cloud"


@pytest.mark.parametrize("name", ["a.las", "a.laz"])
@pytest.mark.parametrize(
    ("place", "form", "value", "word"),
    [
        (0, "<4s", b"FSAL", "no las"),
        (100, "<I", 1 << 31, "records"),
        (96, "<I", 1 << 31, "records"),
        (107, "<I", 4_000_000_000, "promised"),
        (107, "<I", 300_000, "promised|truncated|damaged"),
        (131, "<d", float("nan"), "no valid points"),
    ],
)
def test_bad_headers_are_one_line(
    tmp_path: Path, name: str, place: int, form: str, value: object, word: str
) -> None:
    data = bytearray(scan(tmp_path / name).read_bytes())
    struct.pack_into(form, data, place, value)
    (tmp_path / name).write_bytes(bytes(data))
    with pytest.raises(WorldError, match=word) as error:
        read(tmp_path / name, Options())
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["a.las", "a.laz"])
def test_a_scan_cut_anywhere_is_truncated(tmp_path: Path, name: str) -> None:
    whole = scan(tmp_path / name).read_bytes()
    for length in (50, 226, 300, len(whole) // 2, len(whole) - 1):
        (tmp_path / name).write_bytes(whole[:length])
        with pytest.raises(WorldError, match="truncated"):
            read(tmp_path / name, Options())


def test_a_chunk_table_that_would_take_all_memory_ends_in_one_line(tmp_path: Path) -> None:
    """Regression: lazrs ended the interpreter, `memory allocation of 16885071008 bytes failed`."""
    data = bytearray(scan(tmp_path / "a.laz").read_bytes())
    (table,) = struct.unpack_from("<q", data, struct.unpack_from("<I", data, 96)[0])
    struct.pack_into("<I", data, table + 4, 0xFFFFFFFF)
    (tmp_path / "a.laz").write_bytes(bytes(data))
    with pytest.raises(WorldError, match="laz"):
        read(tmp_path / "a.laz", Options())


@settings(max_examples=50, deadline=None)
@given(place=st.integers(0), byte=st.integers(0, 255))
def test_damaged_bytes_end_in_one_line(
    tmp_path_factory: pytest.TempPathFactory, place: int, byte: int
) -> None:
    only_world_errors(scan(tmp_path_factory.mktemp("las") / "a.las"), place, byte)


@settings(max_examples=3, deadline=None)  # each reading is a process
@given(place=st.integers(0), byte=st.integers(0, 255))
def test_damaged_bytes_of_a_compressed_scan_end_in_one_line(
    tmp_path_factory: pytest.TempPathFactory, place: int, byte: int
) -> None:
    only_world_errors(scan(tmp_path_factory.mktemp("laz") / "a.laz"), place, byte)
