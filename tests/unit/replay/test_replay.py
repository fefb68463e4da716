"""Recorded depth images: the same requests whatever the form and the frame, and where the map says so."""

from __future__ import annotations

import csv
import math
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from tests import recordings
from tests.components import build
from tests.folders import SHARED
from uavexp.replay import __main__ as command
from uavexp.scene import Scene
from uavexp.types import State

REAL = SHARED / "rgbd" / "sevenscenes_a"
RATE_HZ, SPEED_MPS, SECONDS, SETTLE_S = 20.0, 1.0, 6.0, 0.5
PILLAR_M = 5.0  # along the way
BODY_FROM_CAMERA = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
Rows = list[tuple[int, np.ndarray, np.ndarray]]  # frame, position, camera rotation


def corridor() -> Scene:
    """A corridor along x, 3 m wide, with a pillar whose face is 0.3 m from its middle line."""
    trimesh = pytest.importorskip("trimesh")

    shell = trimesh.creation.box(bounds=[[-1, -1.5, 0], [12, 1.5, 3]])
    pillar = trimesh.creation.box(bounds=[[PILLAR_M, 0.3, 0], [PILLAR_M + 0.4, 0.7, 3]])
    mesh = trimesh.util.concatenate([shell, pillar])
    return Scene.from_mesh(mesh.vertices.astype(np.float32), mesh.faces.astype(np.int32))


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> tuple[Path, Rows]:
    """A camera carried along the middle of the corridor, images as PNG in mm."""
    folder = tmp_path_factory.mktemp("recorded")
    off = dict.fromkeys(("axial_noise", "quantisation", "edge_missing", "grazing_missing"), False)
    camera = build("sensor", "rgbd", max_range_m=20.0, **off)
    camera.reset(corridor(), np.random.default_rng(0))
    rows: Rows = []
    for frame in range(round(SECONDS * RATE_HZ)):
        place = np.array([SPEED_MPS * frame / RATE_HZ, 0.0, 1.2])
        state = State(
            position_m=place,
            velocity_mps=np.zeros(3),
            quaternion_wxyz=np.array([1.0, 0.0, 0.0, 0.0]),
            body_rate_radps=np.zeros(3),
        )
        depth_m = camera.capture(state, state, 0.0).depth_m
        raw = np.where(np.isfinite(depth_m), np.rint(1000.0 * depth_m), 0).astype(np.uint16)
        Image.fromarray(raw).save(folder / f"{frame:06d}.depth.png")
        rows.append((frame, place, BODY_FROM_CAMERA))
    (fx, (cx, cy)) = camera.focal_px, camera.centre_px
    (folder / "intrinsics.txt").write_text(f"# px\n{fx} 0 {cx}\n0 {fx} {cy}\n0 0 1\n")
    write_poses(folder, rows)
    return folder, rows


def write_poses(folder: Path, rows: Rows) -> None:
    lines = [[frame, *np.column_stack([rotation, place]).ravel()] for frame, place, rotation in rows]
    (folder / "poses.txt").write_text("\n".join(" ".join(map(str, line)) for line in lines))


def requests(folder: Path, out: Path, *words: object) -> dict[str, list[dict[str, str]]]:
    """Rows of the table by policy."""
    typed = ["--rate", RATE_HZ, "--stride", 1, "sensor.max_range_m=3", "mapping.voxel_size_m=0.1", *words]
    assert command.main([str(folder), *map(str, typed), "--out", str(out)]) == 0
    found: dict[str, list[dict[str, str]]] = {}
    (table,), (picture,) = out.glob("*.replay.csv"), out.glob("*.replay.png")
    for row in csv.DictReader(table.open()):
        found.setdefault(row["policy"], []).append(row)
    assert picture.stat().st_size > 5000
    return found


@pytest.fixture(scope="module")
def asked(recorded, tmp_path_factory):
    return requests(
        recorded[0], tmp_path_factory.mktemp("out"),
        "strategy=mcr,tbr,ssp", "explorer=target_only",
    )  # fmt: skip


def test_who_never_replans_asks_for_one_plan(asked):
    assert [row["cause"] for row in asked["ssp"]] == ["first"]
    assert float(asked["ssp"][0]["time_s"]) == pytest.approx(SETTLE_S)


def test_a_clock_asks_by_the_clock(recorded, tmp_path):
    rows = requests(recorded[0], tmp_path, "strategy=tbr", "trigger.interval_s=1.5")["tbr"]
    assert [row["cause"] for row in rows] == ["first", "clock", "clock", "clock"]
    assert [float(row["time_s"]) for row in rows] == pytest.approx([0.5, 1.5, 3.0, 4.5])


def test_a_pillar_beside_the_way_asks_once_it_is_seen_and_near(asked):
    """It is seen from 3 m before, after 2 s; MCR answers within a second of reaching where it is narrow."""
    times = [float(row["time_s"]) for row in asked["mcr"] if row["cause"] == "map"]
    assert times, "its clearance, 0.3 m, is below the 0.4 m that a plan of MCR keeps"
    assert PILLAR_M - 3.0 < SPEED_MPS * min(times) < PILLAR_M
    place = asked["mcr"][1]
    assert float(place["x_m"]) == pytest.approx(SPEED_MPS * float(place["time_s"]), abs=1e-3)


def test_a_recording_in_another_frame_asks_the_same(recorded, asked, tmp_path):
    folder, rows = recorded
    shutil.copytree(folder, tmp_path / "lying")
    turn = Rotation.from_euler("x", 90, degrees=True).as_matrix()  # z becomes -y
    write_poses(
        tmp_path / "lying", [(frame, turn @ place, turn @ rotation) for frame, place, rotation in rows]
    )
    up = turn @ [0.0, 0.0, 1.0]
    found = requests(tmp_path / "lying", tmp_path, "strategy=tbr,mcr", "explorer=target_only", "--up", *up)
    for policy in ("tbr", "mcr"):
        times, before = ([float(row["time_s"]) for row in rows[policy]] for rows in (found, asked))
        assert times == pytest.approx(before, abs=0.11)  # an update of the map: voxels lie otherwise


def test_tums_form_tells_the_same(recorded, asked, tmp_path):
    folder, rows = recorded
    tum = tmp_path / "tum"
    shutil.copytree(folder, tum)
    (tum / "poses.txt").unlink()
    stamps = [f"{1305031102.0 + frame / RATE_HZ:.4f}" for frame, _, _ in rows]
    names = [f"{stamp} {frame:06d}.depth.png" for stamp, (frame, _, _) in zip(stamps, rows, strict=True)]
    (tum / "depth.txt").write_text("# depth maps\n" + "\n".join(names))
    turned = Rotation.from_matrix(BODY_FROM_CAMERA).as_quat()
    poses = [
        " ".join(map(str, [f"{float(stamp) + 0.004:.4f}", *place, *turned]))
        for stamp, (_, place, _) in zip(stamps, rows, strict=True)
    ]
    (tum / "groundtruth.txt").write_text("\n".join(poses))
    found = requests(tum, tmp_path, "strategy=mcr,ssp", "explorer=target_only", "--unit", 0.001)
    times = [float(row["time_s"]) for row in found["mcr"]]
    assert times == pytest.approx([float(row["time_s"]) for row in asked["mcr"]], abs=1e-3)


@pytest.mark.parametrize(("kind", "encoding"), [("bag", "16UC1"), ("mcap", "32FC1")])
def test_a_bag_of_a_vehicle_that_carries_the_camera_tells_the_same(kind, encoding, recorded, asked, tmp_path):
    folder, rows = recorded
    mount_m = np.array([0.1, 0.0, 0.05])  # of the camera on the vehicle
    images = [np.asarray(Image.open(folder / f"{frame:06d}.depth.png")) for frame, _, _ in rows]
    camera = np.loadtxt(folder / "intrinsics.txt")
    places_m = [place - mount_m for _, place, _ in rows]
    bag = recordings.depth_bag(
        tmp_path / f"carried.{kind}", kind, encoding, images, camera, places_m, 1.0 / RATE_HZ
    )
    words = ("strategy=mcr,ssp", "explorer=target_only", "--mount", *mount_m, 0)
    found = requests(bag, tmp_path, *words)
    times = [float(row["time_s"]) for row in found["mcr"]]
    assert times == pytest.approx([float(row["time_s"]) for row in asked["mcr"]], abs=1e-3)


def test_a_bag_without_depth_is_one_line(tmp_path, capsys):
    time_s, position_m, _ = recordings.circle()
    bag = recordings.ros_bag(tmp_path / "poses.bag", "bag", time_s, position_m)
    assert command.main([str(bag)]) == 2
    assert "no topic of sensor_msgs/msg/Image" in capsys.readouterr().err
    bag.write_bytes(bag.read_bytes()[:5000])
    assert command.main([str(bag)]) == 2
    assert "damaged, or not a ROS bag" in capsys.readouterr().err


def damaged(folder: Path, what: str) -> None:
    poses = folder / "poses.txt"
    lines = poses.read_text().splitlines()
    if what == "no poses":
        poses.unlink()
    elif what == "short row":
        poses.write_text("\n".join([*lines[:3], lines[3].rsplit(" ", 1)[0]]))
    elif what == "twice":
        poses.write_text("\n".join([lines[0], lines[0], *lines[1:]]))
    elif what == "not finite":
        poses.write_text("\n".join([lines[0], lines[1].rsplit(" ", 1)[0] + " nan", *lines[2:]]))
    elif what == "no rotation":
        poses.write_text("\n".join([lines[0], " ".join(["1", *["0"] * 12]), *lines[2:]]))
    elif what == "one":
        poses.write_text(lines[0])
    elif what == "cut image":
        file = folder / "000003.depth.png"
        file.write_bytes(file.read_bytes()[:200])
    elif what == "colour image":
        Image.new("RGB", (96, 72)).save(folder / "000003.depth.png")
    elif what == "intrinsics":
        (folder / "intrinsics.txt").write_text("1 2 3\n")


@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("no poses", "holds neither poses.txt nor TUM's depth.txt and groundtruth.txt"),
        ("short row", "row 3 has 12 numbers, 13 are needed"),
        ("twice", "each frame must be later than the one before, row 1"),
        ("not finite", "row 1 is not finite"),
        ("no rotation", "a pose is no rotation"),
        ("one", "1 depth images with a pose, at least 2 are needed"),
        ("cut image", "no depth image, or damaged"),
        ("colour image", "a depth image has one channel"),
        ("intrinsics", "three rows fx 0 cx"),
    ],
)
def test_a_bad_recording_is_one_line(what, said, recorded, tmp_path, capsys):
    shutil.copytree(recorded[0], tmp_path / "bad")
    damaged(tmp_path / "bad", what)
    assert command.main([str(tmp_path / "bad"), "--out", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "a folder of depth images or a bag is needed"),
        (["nowhere"], "there is no such folder"),
        (["FOLDER", "strategy=mrc"], "did you mean"),
        (["FOLDER", "world=rooms"], "a recording has no world"),
        (["FOLDER", "--up", "0", "0", "0"], "--up must be a direction"),
        (["FOLDER", "--rate", "0"], "--rate and --unit must be > 0"),
    ],
)
def test_what_cannot_be_asked_is_one_line(words, said, recorded, capsys):
    assert command.main([word.replace("FOLDER", str(recorded[0])) for word in words]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.skipif(not REAL.is_dir(), reason=f"no recording at {REAL}")
def test_a_real_recording_tells_policies_apart(tmp_path, capsys):
    up = ["--up", "0.008875", "-0.904426", "-0.426539"]
    words = [str(REAL), "strategy=ssp,tbr,mcr_literal", *up, "--out", str(tmp_path)]
    assert command.main(words) == 0
    said = capsys.readouterr().out
    assert "83 depth images in 9.9 s" in said
    rows = list(csv.DictReader((tmp_path / f"{REAL.name}.replay.csv").open()))
    count = {name: sum(row["policy"] == name for row in rows) for name in ("ssp", "tbr", "mcr_literal")}
    assert count["ssp"] == 1
    assert count["ssp"] < count["tbr"] < count["mcr_literal"]
    assert all(math.isfinite(float(row["score"])) for row in rows)
