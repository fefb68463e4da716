"""Npz, octomap and 3dmap files: cells against what was written, octomaps against pyoctomap."""

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.folders import SHARED
from tests.formats import only_world_errors
from uavexp.errors import WorldError
from uavexp.formats import FREE, SOLID, UNMEASURED, Cells, Options, read

OCTOMAP = SHARED / "clouds" / "octomap" / "octomap" / "share" / "data" / "geb079.bt"


def cells_of(path: Path) -> Cells:
    cells = read(path, Options()).cells
    assert cells is not None
    return cells


def state_at(cells: Cells, point: np.ndarray) -> int:
    index = np.floor((point - cells.origin) / cells.size).astype(int)
    inside = ((index >= 0) & (index < cells.state.shape)).all()
    return int(cells.state[tuple(index)]) if inside else UNMEASURED


SOLIDS, FREES = np.array([[0.5, 0.5, 0.5], [3.5, 1.5, 0.5]]), np.array([[1.5, 0.5, 0.5], [2.5, 1.5, 2.5]])


@pytest.mark.parametrize(
    "arrays",
    [
        {"occupied": SOLIDS, "free": FREES, "resolution": 1.0},
        {"occupied": SOLIDS.astype(np.float32), "free": FREES, "resolution": np.array([1], np.int32)},
        {
            "occupied_index": (SOLIDS - 0.5).astype(np.int16),
            "free_index": (FREES - 0.5).astype(np.uint8),
            "origin": np.zeros(3),
            "resolution": 1.0,
        },
    ],
)
def test_voxels_of_every_spelling_are_the_same_cells(tmp_path: Path, arrays: dict[str, np.ndarray]) -> None:
    np.savez_compressed(tmp_path / "v.npz", **arrays)
    cells = cells_of(tmp_path / "v.npz")
    assert [state_at(cells, point) for point in SOLIDS] == [SOLID, SOLID]
    assert [state_at(cells, point) for point in FREES] == [FREE, FREE]
    assert np.bincount(cells.state.ravel()).tolist() == [4 * 2 * 3 - 4, 2, 2]
    np.testing.assert_allclose(cells.origin, 0.0, atol=1e-12)


def test_without_measured_free_ones_all_others_are_free(tmp_path: Path) -> None:
    np.savez(tmp_path / "v.npz", centres=SOLIDS, resolution=1.0)
    assert np.bincount(cells_of(tmp_path / "v.npz").state.ravel()).tolist() == [0, 6, 2]


@pytest.mark.parametrize("name", ["points", "points_m", "occupied"])
def test_points_are_a_cloud(tmp_path: Path, name: str) -> None:
    points = SOLIDS + np.array([4e5, 5.6e6, 0.001])  # far origins stay
    np.savez(tmp_path / "p.npz", **{name: np.asfortranarray(points), "more": np.array(["text"])})
    np.testing.assert_array_equal(read(tmp_path / "p.npz", Options()).points, points)


def test_what_would_not_fit_is_refused_before_it_is_unpacked(tmp_path: Path) -> None:
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        header, {"descr": "<f8", "fortran_order": False, "shape": (10**9, 3)}
    )
    for names in (["points"], ["points", "occupied"]):
        with zipfile.ZipFile(tmp_path / f"{len(names)}.npz", "w", zipfile.ZIP_DEFLATED) as archive:
            for name in names:
                archive.writestr(f"{name}.npy", header.getvalue() + bytes(800))
    with pytest.raises(WorldError, match="does not fit"):
        read(tmp_path / "1.npz", Options())
    size = (0xF0000000).to_bytes(4, "little")  # 3.75 GiB, in the zip's directory
    head, *members = (tmp_path / "2.npz").read_bytes().split(b"PK\x01\x02")
    forged = [member[:20] + size + member[24:] for member in members]
    (tmp_path / "2.npz").write_bytes(b"PK\x01\x02".join([head, *forged]))
    with pytest.raises(WorldError, match=r"7\.5 GiB"):
        read(tmp_path / "2.npz", Options())


@pytest.mark.parametrize(
    ("arrays", "word"),
    [
        ({"points": np.array([{}])}, "numbers"),
        ({"points": np.zeros((4, 2))}, r"\(N, 3\)"),
        ({"other": np.zeros(3)}, "other"),
        ({"occupied": SOLIDS * 1e12, "resolution": 1e-9}, "cells"),
        ({"occupied": SOLIDS, "resolution": np.nan}, "resolution"),
        ({"occupied_index": np.zeros((1, 3)), "resolution": 1.0}, "origin"),
        ({"size": [2, 2, 2], "blocked": [[0, 0, 2]]}, "outside"),
        ({"size": [2, 0, 2], "blocked": [[0, 0, 1]]}, "size"),
        ({"size": [1 << 20] * 3, "blocked": [[0, 0, 1]]}, "cells"),
    ],
)
def test_other_arrays_are_one_line(tmp_path: Path, arrays: dict[str, np.ndarray], word: str) -> None:
    np.savez(tmp_path / "v.npz", **arrays)
    with pytest.raises(WorldError, match=word) as error:
        read(tmp_path / "v.npz", Options())
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["m.3dmap", "m.npz"])
def test_blocked_cells_of_a_benchmark(tmp_path: Path, name: str) -> None:
    (tmp_path / "m.3dmap").write_text("voxel 3 4 5\n2 3 4\n0 0 0\n")
    np.savez(tmp_path / "m.npz", size=[3, 4, 5], blocked=[[2, 3, 4], [0, 0, 0]])
    cells = cells_of(tmp_path / name)
    assert cells.state.shape == (3, 4, 5)
    assert np.argwhere(cells.state == SOLID).tolist() == [[0, 0, 0], [2, 3, 4]]
    assert np.count_nonzero(cells.state == FREE) == 58
    np.testing.assert_array_equal([cells.origin, cells.size], [[0, 0, 0], [1, 1, 1]])


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("pixel 3 4 5\n", "voxel X Y Z"),
        ("voxel 3 4\n", "voxel X Y Z"),
        ("voxel 3 4 99999999999999999999\n", "voxel X Y Z"),
        ("voxel 999999999 999999999 9\n1 1 1", "cells"),
        ("voxel 3 4 5\n3 0 0\n", "outside"),
        ("voxel 3 4 5\n0.5 0 0\n", "outside"),
        ("voxel 3 4 5\n1 1\n", "damaged"),
    ],
)
def test_bad_benchmark_maps_are_one_line(tmp_path: Path, text: str, word: str) -> None:
    (tmp_path / "m.3dmap").write_text(text)
    with pytest.raises(WorldError, match=word):
        read(tmp_path / "m.3dmap", Options())


def octree(folder: Path, seed: int = 0, points: int = 80) -> tuple[object, list[Path]]:
    """A tree with solid, free and never measured space, some of it pruned to large leaves."""
    pyoctomap = pytest.importorskip("pyoctomap")
    rng = np.random.default_rng(seed)
    tree = pyoctomap.OcTree(0.1)
    for number, point in enumerate(rng.uniform(-2.0, 2.0, (points, 3))):
        tree.updateNode(point, number % 3 == 0)
    for corner in np.ndindex(4, 4, 4):  # a block of 4 cells an edge that is pruned to one leaf
        tree.updateNode(0.8 + 0.05 + 0.1 * np.array(corner), False)
    tree.writeBinary(str(folder / "t.bt"))
    tree.write(str(folder / "t.ot"))
    return tree, [folder / "t.bt", folder / "t.ot"]


def test_octomaps_have_the_leaves_that_octomap_itself_reads(tmp_path: Path) -> None:
    tree, paths = octree(tmp_path)
    rng = np.random.default_rng(1)
    for path in paths:
        cells = cells_of(path)
        centres = cells.origin + (rng.integers(-3, np.array(cells.state.shape) + 3, (4000, 3)) + 0.5) * 0.1
        inner = cells.origin + (np.argwhere(cells.state != UNMEASURED) + 0.5) * 0.1
        for point in np.concatenate([centres, inner]):
            node = tree.search(point)  # type: ignore[attr-defined]
            expected = UNMEASURED if node is None else SOLID if tree.isNodeOccupied(node) else FREE  # type: ignore[attr-defined]
            assert state_at(cells, point) == expected
        assert (cells.state == FREE).sum() >= 64


@pytest.mark.skipif(not OCTOMAP.is_file(), reason=f"no {OCTOMAP}")
def test_a_building_has_the_cells_that_octomap_itself_reads() -> None:
    pyoctomap = pytest.importorskip("pyoctomap")
    tree = pyoctomap.OcTree(0.1)
    assert tree.readBinary(str(OCTOMAP))
    count = {SOLID: 0, FREE: 0}
    for leaf in tree.begin_leafs():
        cells = round(leaf.getSize() / tree.getResolution()) ** 3
        count[SOLID if tree.isNodeOccupied(leaf) else FREE] += cells
    state = cells_of(OCTOMAP).state
    assert {kind: int(np.count_nonzero(state == kind)) for kind in count} == count


@pytest.mark.parametrize("form", [0, 1])
@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        (b"id OcTree", b"id OakTree", "OakTree"),
        (b"res 0.1", b"res -1", "res"),
        (b"res 0.1", b"res many", "res"),
        (b"size ", b"size 9", "promised"),
        (b"\ndata\n", b"\nbytes\n", "data"),
        (b"# Octomap", b"# Octopus", "octomap"),
    ],
)
def test_bad_octomaps_are_one_line(tmp_path: Path, form: int, old: bytes, new: bytes, word: str) -> None:
    path = octree(tmp_path)[1][form]
    path.write_bytes(path.read_bytes().replace(old, new, 1))
    with pytest.raises(WorldError, match=word):
        read(path, Options())


def test_an_octomap_cut_anywhere_is_truncated(tmp_path: Path) -> None:
    for path in octree(tmp_path)[1]:
        whole = path.read_bytes()
        for length in np.linspace(30, len(whole) - 1, 30).astype(int):
            path.write_bytes(whole[:length])
            with pytest.raises(WorldError, match=r"truncated|damaged"):
                read(path, Options())


def test_a_tree_deeper_than_its_keys_is_refused(tmp_path: Path) -> None:
    head = b"# Octomap OcTree binary file\nid OcTree\nsize 99\nres 0.1\ndata\n"
    (tmp_path / "deep.bt").write_bytes(head + b"\x03\x00" * 99)
    with pytest.raises(WorldError, match="damaged"):
        read(tmp_path / "deep.bt", Options())
    whole = head.replace(b" binary", b"").replace(b"99", b"1") + b"\0\0\x80\x3f\0"  # the whole space is solid
    (tmp_path / "huge.ot").write_bytes(whole)
    with pytest.raises(WorldError, match="cells"):
        read(tmp_path / "huge.ot", Options())


@settings(max_examples=50, deadline=None)
@given(
    place=st.integers(0), byte=st.integers(0, 255), name=st.sampled_from(["t.bt", "t.ot", "m.3dmap", "v.npz"])
)
def test_damaged_bytes_end_in_one_line(
    tmp_path_factory: pytest.TempPathFactory, place: int, byte: int, name: str
) -> None:
    folder = tmp_path_factory.mktemp("voxels")
    if name in ("t.bt", "t.ot"):
        octree(folder, points=6)
    (folder / "m.3dmap").write_text("voxel 3 4 5\n2 3 4\n0 0 0\n")
    np.savez_compressed(folder / "v.npz", occupied=SOLIDS, resolution=1.0)
    only_world_errors(folder / name, place, byte)
