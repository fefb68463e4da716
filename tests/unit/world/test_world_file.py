"""File worlds: every format reads the same flat, and every bad input is one clear line."""

import struct
from pathlib import Path

import numpy as np
import pytest

from tests.collada_files import dae
from tests.folders import DATA
from uavexp.errors import ConfigError, UavexpError, WorldError
from uavexp.geometry import polyline_length_m
from uavexp.scene import Scene
from uavexp.types import World
from uavexp.world.file import File
from uavexp.world.frame import UP_AXES
from uavexp.world.voxel_mesh import exposed_faces

BOUNDS = [[0.3, 0.3, 0.4], [7.7, 5.7, 2.1]]
START, TARGET = [1.0, 1.0, 1.2], [7.0, 1.0, 1.2]
TAUT_M = 9.770  # closed form of test_world_paths with the clearance of 0.35 m


def read(path: Path | str, seed: int = 0, **parameters: object) -> World:
    options: dict[str, object] = {"start_m": START, "target_m": TARGET, "flight_bounds_m": BOUNDS}
    return File(path=str(path), **(options | parameters)).generate(np.random.default_rng(seed))


@pytest.mark.parametrize(
    ("name", "parameters", "tolerance_m"),
    [
        ("flat.ply", {}, 1e-5),
        ("flat.obj", {}, 1e-5),
        ("flat.stl", {}, 1e-5),
        ("flat.glb", {}, 1e-5),
        ("flat_map.yaml", {}, 1e-5),
        ("flat.pcd", {"voxel_size_m": 0.2}, 0.1 + 1e-5),  # half a voxel
        ("flat_voxels.npz", {}, 0.1 + 1e-5),
    ],
)
def test_every_format_holds_the_same_flat(
    name: str, parameters: dict[str, object], tolerance_m: float
) -> None:
    world = read(DATA / name, **parameters)
    assert polyline_length_m(world.shortest_path) == pytest.approx(TAUT_M, rel=0.01)
    assert world.difficulty.shortest_path_m >= TAUT_M
    assert world.difficulty.narrowest_gap_m == pytest.approx(1.2, abs=0.01)  # the door
    points = np.random.default_rng(0).uniform([0.3, 0.3, 0.3], [3.6, 3.9, 2.2], (300, 3))
    expected = np.minimum(points, [3.9, 6.0, 2.5] - points).min(axis=1)  # first room, door aside
    np.testing.assert_allclose(Scene(world).distance_m(points), expected, atol=tolerance_m)


def test_start_and_target_are_drawn_by_the_seed_and_joined() -> None:
    options = {"start_m": None, "target_m": None, "flight_bounds_m": None, "least_distance_m": 4.0}
    worlds = [read(DATA / "flat.ply", seed, **options) for seed in range(8)]
    again = read(DATA / "flat.ply", 3, **options)
    assert again.digest == worlds[3].digest
    assert len({world.digest for world in worlds}) == 8
    for world in worlds:
        assert np.linalg.norm(world.target_m - world.start_m) >= 4.0
        assert world.start_m[2] == world.target_m[2] == 1.2
        along = np.linspace(0.0, 1.0, 100)[:, None, None]
        path = world.shortest_path
        points = (path[:-1] + along * np.diff(path, axis=0)).reshape(-1, 3)
        assert Scene(world).distance_m(points).min() >= 0.35 - 1e-5


def test_the_digest_is_of_the_contents_not_of_the_path(tmp_path: Path) -> None:
    copy = tmp_path / "elsewhere.ply"
    copy.write_bytes((DATA / "flat.ply").read_bytes())
    assert read(copy).digest == read(DATA / "flat.ply").digest
    assert read(copy, start_m=[1.0, 1.0, 1.3]).digest != read(copy).digest


def test_relative_paths_start_at_the_working_directory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(DATA)
    assert read("flat.ply").name == "file"


@pytest.mark.parametrize("axis", UP_AXES)
def test_up_axes_are_rotations_that_raise_the_named_axis(axis: str) -> None:
    rotation = np.array(UP_AXES[axis], dtype=float)
    np.testing.assert_array_equal(rotation @ rotation.T, np.eye(3))
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    named = (-1.0 if axis[0] == "-" else 1.0) * np.eye(3)["xyz".index(axis[-1])]
    np.testing.assert_array_equal(rotation @ named, [0.0, 0.0, 1.0])


@pytest.mark.parametrize("axis", UP_AXES)
def test_a_turned_file_in_millimetres_is_the_same_world(tmp_path: Path, axis: str) -> None:
    turned = tmp_path / "turned.obj"
    lines = []
    for line in (DATA / "flat.obj").read_text().splitlines():
        if line.startswith("v "):
            point = 1000.0 * np.array(UP_AXES[axis], dtype=float).T @ [float(x) for x in line.split()[1:]]
            line = "v {:.6g} {:.6g} {:.6g}".format(*point)
        lines.append(line)
    turned.write_text("\n".join(lines))
    world = read(turned, unit_m=0.001, up_axis=axis)
    np.testing.assert_allclose(world.vertices_m, read(DATA / "flat.obj").vertices_m, atol=1e-5)


def test_unit_and_axis_are_those_that_the_file_names_unless_given(tmp_path: Path) -> None:
    flat = read(DATA / "flat.obj")
    corners = 100.0 * flat.vertices_m[flat.triangles] @ np.array(UP_AXES["y"], dtype=float)  # cm, y up
    text = dae(asset='<unit meter="0.01"/><up_axis>Y_UP</up_axis>', vertices=corners.reshape(-1, 3))
    (tmp_path / "flat.dae").write_text(text)
    world = read(tmp_path / "flat.dae")
    np.testing.assert_allclose(world.vertices_m, flat.vertices_m[flat.triangles].reshape(-1, 3), atol=1e-4)
    for said in ("unit_m=0.01", "up_axis=y"):
        assert any(note.startswith(f"read with world.{said}, as the file says") for note in world.notes)
    (tmp_path / "flat.dae").write_text(text.replace('"0.01"', '"1.0"').replace("Y_UP", "Z_UP"))
    world = read(tmp_path / "flat.dae", unit_m=0.01, up_axis="y")
    np.testing.assert_allclose(world.vertices_m, flat.vertices_m[flat.triangles].reshape(-1, 3), atol=1e-4)
    assert "read with world.unit_m=0.01, though the file says 1.0" in world.notes
    assert not [note for note in flat.notes if "read with" in note]


def test_vertices_of_no_triangle_are_no_part_of_the_world(tmp_path: Path) -> None:
    text = (DATA / "flat.obj").read_text()
    (tmp_path / "m.obj").write_text(f"v 5000 0 0\n{shifted(text)}v 0 -5000 0\n")
    options = {"flight_bounds_m": None}
    assert read(tmp_path / "m.obj", **options).digest == read(DATA / "flat.obj", **options).digest


def shifted(text: str) -> str:
    """An obj file's faces, each index one higher."""
    lines = [line.split() for line in text.splitlines()]
    return "".join(
        f"f {' '.join(str(int(word) + 1) for word in words[1:])}\n"
        if words[:1] == ["f"]
        else " ".join(words) + "\n"
        for words in lines
    )


def test_voxel_faces_enclose_exactly_the_voxels() -> None:
    rng = np.random.default_rng(0)
    occupied = rng.random((9, 7, 6)) < 0.4
    size = np.array([0.2, 0.3, 0.5])
    vertices, triangles = exposed_faces(occupied, np.array([1.0, -2.0, 0.5]), size)
    corners = vertices[triangles].astype(float)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    volume = np.einsum("ij,ij->", corners[:, 0], normal) / 6.0  # divergence theorem
    assert volume == pytest.approx(occupied.sum() * size.prod(), rel=1e-5)
    padded = np.pad(occupied, 1).astype(int)
    faces = [np.abs(np.diff(padded, axis=axis)).sum() for axis in range(3)]
    area = faces @ np.array([size[1] * size[2], size[0] * size[2], size[0] * size[1]])
    assert 0.5 * np.linalg.norm(normal, axis=1).sum() == pytest.approx(area, rel=1e-5)
    assert triangles.shape[0] < 2 * sum(faces)  # some faces were merged


def test_voxel_files_may_hold_centres_and_free_cells(tmp_path: Path) -> None:
    index = np.load(DATA / "flat_voxels.npz")["occupied_index"]
    centres = (index - 0.5) * 0.2
    np.savez(tmp_path / "centres.npz", centres=centres, resolution=0.2)
    grid = np.ones(index.max(axis=0) + 1, dtype=bool)
    grid[tuple(index.T)] = False
    free = (np.argwhere(grid) - 0.5) * 0.2
    np.savez(tmp_path / "free.npz", occupied=centres, free=free, resolution=0.2)
    np.savez(tmp_path / "only_free.npz", occupied=centres[:1], free=free, resolution=0.2)
    length = read(DATA / "flat_voxels.npz").difficulty.shortest_path_m
    for name in ("centres.npz", "free.npz", "only_free.npz"):  # what is not free is wall
        assert read(tmp_path / name).difficulty.shortest_path_m == pytest.approx(length)
    with pytest.raises(WorldError, match="apart from flight_bounds_m"):
        read(tmp_path / "only_free.npz", unknown="free")


def ros(folder: Path, pixels: list[list[int]], extra: str = "", origin: str = "[1.0, 2.0, 0.0]") -> Path:
    body = "\n".join(" ".join(map(str, row)) for row in pixels)
    (folder / "m.pgm").write_text(f"P2\n# plain\n{len(pixels[0])} {len(pixels)}\n255\n{body}\n")
    path = folder / "m.yaml"
    path.write_text(f"image: m.pgm\nresolution: 0.5\norigin: {origin}\n{extra}")
    return path


@pytest.mark.parametrize(("unknown", "left"), [("wall", 1.5), ("free", 2.0)])
def test_ros_map_is_extruded_where_its_origin_and_yaw_say(tmp_path: Path, unknown: str, left: float) -> None:
    pixels = [[254] * 20 for _ in range(20)]
    pixels[-1] = [0] * 20  # the lowest row: y from 0 to 0.5 m in the map's frame
    pixels[10][3] = 205
    turned = ros(tmp_path, pixels, "free_thresh: 0.196", origin="[5.0, 1.0, 1.5707963267948966]")
    world = File(
        path=str(turned),
        unknown=unknown,
        wall_height_m=2.0,
        start_m=[3.0, 3.0, 1.0],
        target_m=[3.0, 8.0, 1.0],
        flight_bounds_m=[[-4.0, 1.5, 0.4], [4.2, 10.5, 1.6]],
    ).generate(np.random.default_rng(0))
    scene = Scene(world)
    # map (x, y) lies at (5 - y, 1 + x): the lowest row becomes a wall at x = 4.5
    t, normal = scene.cast(np.array([[3.0, 5.0, 1.0, 1, 0, 0], [3.0, 5.0, 1.0, 0, 0, 1]], np.float32))
    np.testing.assert_allclose(t, [1.5, 1.0], atol=1e-5)
    np.testing.assert_allclose(np.abs(normal[0]), [1.0, 0.0, 0.0], atol=1e-5)
    # the unknown pixel covers x 0.0 to 0.5, y 2.5 to 3.0
    ray = np.array([[2.5, 2.75, 1.0, -1.0, 0.0, 0.0]], np.float32)
    hit = scene.cast(ray)[0][0]
    assert (hit == pytest.approx(2.0, abs=1e-5)) == (unknown == "wall")


def test_a_drawing_in_millimetres_is_the_same_world(tmp_path: Path) -> None:
    ezdxf = pytest.importorskip("ezdxf")
    worlds = []
    for unit, code, given in ((1.0, 6, None), (0.001, 4, None), (0.001, 0, 0.001)):
        drawing = ezdxf.new()
        drawing.header["$INSUNITS"] = code
        corners = np.array([[0.0, 0.0], [8.0, 0.0], [8.0, 6.0], [0.0, 6.0]]) / unit
        drawing.modelspace().add_lwpolyline(corners.tolist(), close=True)
        drawing.saveas(tmp_path / f"{code}.dxf")
        worlds.append(read(tmp_path / f"{code}.dxf", unit_m=given))
    for world in worlds[1:]:
        np.testing.assert_allclose(world.vertices_m, worlds[0].vertices_m, atol=1e-6)
    assert worlds[0].vertices_m[:, 2].max() == 2.5
    assert any("0.001" in note for note in worlds[1].notes)


def bad_files() -> dict[str, tuple[bytes, str]]:
    """Damaged versions of each format, and the word its error must hold."""
    names = ("flat.ply", "flat.stl", "flat.glb", "flat.obj", "flat.pcd", "flat_voxels.npz")
    ply, stl, glb, obj, pcd, npz = ((DATA / name).read_bytes() for name in names)
    nan = bytearray(ply)
    head = ply.index(b"end_header") + 11
    nan[head : head + 4] = struct.pack("<f", float("nan"))
    beyond = bytearray(ply)
    beyond[-4:] = struct.pack("<i", 4096)
    no_faces = b"ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nend_header\n"
    ascii_pcd = pcd[: pcd.index(b"DATA")] + b"DATA ascii\n1 2 3\n"
    return {
        "empty.ply": (b"", "empty"),
        "text.ply": (b"this is no mesh\n" * 30, "no ply"),
        "headless.ply": (ply[:100], "truncated"),
        "cut.ply": (ply[: len(ply) * 2 // 3], "truncated"),
        "nan.ply": (bytes(nan), "NaN"),
        "beyond.ply": (bytes(beyond), "damaged"),
        "none.ply": (no_faces, "no vertices"),
        "text.stl": (b"this is no mesh\n" * 30, "no stl"),
        "cut.stl": (stl[:-60], "truncated"),
        "cut.glb": (glb[:-60], "truncated"),
        "text.glb": (b"this is no mesh\n" * 30, "no glb"),
        "cut.obj": (obj[:-3], "damaged|truncated|no obj"),
        "nan.obj": (obj.replace(b"-0.15", b"nan", 1), "NaN"),
        "none.obj": (b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "no triangles"),
        "text.obj": (b"this is no mesh\n" * 30, "no triangles"),
        "cut.pcd": (pcd[:-60], "truncated"),
        "rows.pcd": (ascii_pcd, "truncated"),
        "text.pcd": (b"this is no cloud\n" * 30, "no pcd"),
        "cut.npz": (npz[:-60], "damaged"),
        "text.npz": (b"this is no archive\n" * 30, "damaged"),
        "text.yaml": (b"just a text\n", "no ROS map"),
        "broken.yaml": (b"image: [\n", "no yaml"),
        "mesh.fbx": (b"Kaydara", "extension"),
        "map.pgm": (b"P5\n1 1\n255\n0", "yaml"),
    }


@pytest.mark.parametrize("name", sorted(bad_files()))
def test_bad_files_are_one_clear_line(tmp_path: Path, name: str, capfd: pytest.CaptureFixture[str]) -> None:
    content, word = bad_files()[name]
    (tmp_path / name).write_bytes(content)
    with pytest.raises(WorldError, match=word) as error:
        read(tmp_path / name)
    assert "\n" not in str(error.value)
    assert name in str(error.value)
    assert capfd.readouterr() == ("", "")  # Open3D's own warnings stay off the terminal


def test_missing_files_and_folders_are_named(tmp_path: Path) -> None:
    with pytest.raises(WorldError, match="does not exist"):
        read(tmp_path / "nowhere.ply")
    with pytest.raises(WorldError, match="not a file"):
        read(tmp_path)


@pytest.mark.parametrize(
    ("arrays", "word"),
    [
        ({"centres": np.zeros((3, 3))}, "resolution"),
        ({"centres": np.zeros((3, 3)), "resolution": 0.0}, "resolution"),
        ({"cells": np.zeros((3, 3)), "resolution": 0.1}, "occupied"),
        ({"centres": np.zeros((3, 2)), "resolution": 0.1}, r"\(N, 3\)"),
        ({"centres": np.full((3, 3), np.nan), "resolution": 0.1}, "NaN"),
        ({"centres": np.zeros((0, 3)), "resolution": 0.1}, "no occupied"),
    ],
)
def test_bad_voxel_files_name_the_key(tmp_path: Path, arrays: dict[str, object], word: str) -> None:
    np.savez(tmp_path / "v.npz", **arrays)
    with pytest.raises(WorldError, match=word):
        read(tmp_path / "v.npz")


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("resolution: 0.05\norigin: [0, 0, 0]\n", "image missing"),
        ("image: m.pgm\nresolution: -1\norigin: [0, 0, 0]\n", "resolution"),
        ("image: m.pgm\nresolution: .nan\norigin: [0, 0, 0]\n", "resolution"),
        ("image: m.pgm\nresolution: 0.05\norigin: [0, 0]\n", "origin"),
        ("image: other.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n", "does not exist"),
        ("image: m.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n", "truncated"),
        ("image: m.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nmode: grey\n", "mode"),
    ],
)
def test_bad_ros_maps_name_the_key(tmp_path: Path, text: str, word: str) -> None:
    (tmp_path / "m.pgm").write_bytes(b"P5\n9 9\n255\n" + b"\0" * 80)
    (tmp_path / "m.yaml").write_text(text)
    with pytest.raises(WorldError, match=word):
        read(tmp_path / "m.yaml")


@pytest.mark.parametrize(
    ("parameters", "word"),
    [
        ({"start_m": [1.0, 1.0, 5.0]}, r"start_m .* outside the flight bounds"),
        ({"target_m": [100.0, 1.0, 1.2]}, r"target_m .* outside the flight bounds"),
        ({"start_m": [3.8, 2.0, 1.2]}, r"0\.10 m, clearance_m=0\.35.*free place is world.start_m=\["),
        ({"clearance_m": 0.7, "flight_bounds_m": None}, r"joined at 0\.599 m: world.clearance_m=0\.59"),
        ({"unit_m": 1000.0, "flight_bounds_m": None}, "too large"),
        ({"unit_m": 1e6}, "unit_m"),
        ({"unit_m": 0.001, "flight_bounds_m": None}, "too small"),
        ({"flight_bounds_m": [[50, 50, 0.5], [60, 60, 2]]}, "apart from"),
        ({"start_m": None, "target_m": None, "flight_height_m": 7.0}, "flight_height_m"),
        ({"start_m": None, "target_m": None, "least_distance_m": 30.0}, "least_distance_m"),
        ({"start_m": None, "target_m": None, "clearance_m": 1.3}, "room"),
    ],
    ids=str,
)
def test_impossible_tasks_say_what_is_needed(parameters: dict[str, object], word: str) -> None:
    with pytest.raises(WorldError, match=word) as error:
        read(DATA / "flat.ply", **parameters)
    assert "\n" not in str(error.value)


def test_a_target_behind_a_closed_wall_is_not_joined_at_all(tmp_path: Path) -> None:
    pixels = [[254] * 30 for _ in range(30)]
    pixels[15] = [0] * 30
    pixels[0] = pixels[-1] = [0] * 30
    path = ros(tmp_path, pixels, origin="[0, 0, 0]")
    with pytest.raises(WorldError, match="not joined at all"):
        File(
            path=str(path),
            start_m=[5.0, 3.0, 1.2],
            target_m=[5.0, 12.0, 1.2],
            flight_bounds_m=[[0.5, 1.0, 0.4], [14.5, 14.0, 2.1]],
        ).generate(np.random.default_rng(0))


@pytest.mark.parametrize(
    ("parameters", "word"),
    [
        ({"path": ""}, "path"),
        ({"unit_m": 0.0}, "unit_m"),
        ({"up_axis": "up"}, "up_axis"),
        ({"unknown": "maybe"}, "unknown"),
        ({"start_m": None}, "both"),
        ({"start_m": [1.0, 2.0]}, "start_m"),
        ({"target_m": [1.0, 2.0, float("nan")]}, "target_m"),
        ({"target_m": ["a", 2.0, 3.0]}, "target_m"),
        ({"flight_bounds_m": [[7.7, 0.3, 0.4], [0.3, 5.7, 2.1]]}, "flight_bounds_m"),
        ({"flight_bounds_m": [[0.0, 0.3], [0.3, 5.7]]}, "flight_bounds_m"),
        ({"flight_bounds_m": 3.0}, "flight_bounds_m"),
        ({"clearance_m": float("nan")}, "clearance_m"),
        ({"flight_height_m": float("inf")}, "flight_height_m"),
    ],
    ids=str,
)
def test_bad_parameters_are_refused_before_the_file_is_opened(
    parameters: dict[str, object], word: str
) -> None:
    options = {"path": "x.ply", "start_m": START, "target_m": TARGET, "flight_bounds_m": BOUNDS}
    with pytest.raises(ConfigError, match=word):
        File(**(options | parameters))


def test_unit_and_axis_do_not_apply_to_ros_maps() -> None:
    with pytest.raises(UavexpError, match="apply to a plan"):
        read(DATA / "flat_map.yaml", unit_m=0.01)


def test_a_file_is_looked_for_in_the_folder_and_a_missing_folder_is_told() -> None:
    start_to_target = read("flat.ply", folder=str(DATA)).shortest_path
    np.testing.assert_array_equal(start_to_target, read(DATA / "flat.ply").shortest_path)
    with pytest.raises(WorldError, match=r"^folder=/no/where does not exist; type world\.folder=FOLDER"):
        read("flat.ply", folder="/no/where")
