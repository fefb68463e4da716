"""Somebody else's flight: every format tells the same circle, what cannot be judged is one line."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

import uavexp
from tests import recordings
from tests.folders import SHARED
from tests.recordings import HEIGHT_M, RADIUS_M, SAMPLES, SPEED_MPS, STEP_S, circle
from uavexp.export.formats import export
from uavexp.judge import __main__ as command
from uavexp.judge.recording import Plan, departure_m, from_ned_frd, new_paths
from uavexp.store.stored_trial import StoredTrial

PX4 = SHARED / "flights" / "px4"
DURATION_S = STEP_S * (SAMPLES - 1)
FORMATS = (
    "flight.csv",
    "flight.tum",
    "flight.ulg",
    "flight.bag",
    "folder",
    "folder/folder.mcap",
    "folder.db3",
)


READERS = {".ulg": "pyulog", ".bag": "rosbags", ".db3": "rosbags", ".mcap": "mcap_protobuf"}  # of an extra


def write(folder: Path, name: str) -> Path:
    time_s, position_m, velocity_mps = circle()
    file = folder / name
    if name == "flight.csv":
        file.write_text(recordings.csv_text(time_s, position_m))
    elif name == "flight.tum":
        rows = np.column_stack([time_s, position_m, np.zeros((SAMPLES, 3)), np.ones(SAMPLES)])
        np.savetxt(file, rows, header="timestamp tx ty tz qx qy qz qw")
    elif name == "flight.ulg":
        pytest.importorskip("pyulog")
        file.write_bytes(recordings.ulog_bytes(time_s, position_m, velocity_mps))
    elif name == "flight.bag":
        recordings.ros_bag(file, "bag", time_s, position_m)
    else:
        kind = "db3" if name == "folder.db3" else "mcap"
        recordings.ros_bag(folder / "folder", kind, time_s, position_m)
        file = folder / ("folder/folder.db3" if kind == "db3" else name)
    return file


def judge(capsys, *words: object) -> dict:
    assert command.main([*map(str, words), "--json"]) == 0, capsys.readouterr().err
    return json.loads(capsys.readouterr().out)


def refusal(capsys, *words: object) -> str:
    assert command.main(list(map(str, words))) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("error: ")
    assert said.err.count("\n") == 1, said.err
    return said.err


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # where pictures go


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_tells_the_same_circle(name, tmp_path, capsys):
    room = recordings.room_stl(tmp_path / "room.stl")
    found = judge(capsys, write(tmp_path, name), "--world", room, "--out", tmp_path / "flight.png")
    assert found["path_length_m"] == pytest.approx(SPEED_MPS * DURATION_S, rel=1e-3)
    assert found["completion_time_s"] == pytest.approx(DURATION_S)
    assert found["max_speed_mps"] == pytest.approx(SPEED_MPS, rel=1e-2)
    assert found["min_clearance_m"] == pytest.approx(HEIGHT_M, abs=1e-3)  # the floor and the ceiling
    centripetal = SPEED_MPS**2 / RADIUS_M
    assert found["acceleration_integral_m2ps3"] == pytest.approx(centripetal**2 * DURATION_S, rel=0.02)
    assert (tmp_path / "flight.png").stat().st_size > 10_000


def test_smoothness_of_samples_far_apart_is_measured_over_a_longer_fit(tmp_path, capsys):
    pytest.importorskip("pyulog")
    time_s, position_m, velocity_mps = circle(0.1, 101)
    (tmp_path / "slow.ulg").write_bytes(recordings.ulog_bytes(time_s, position_m, velocity_mps))
    assert command.main([str(tmp_path / "slow.ulg")]) == 0
    assert "smoothness over 0.4 s, for positions are 0.1 s apart" in capsys.readouterr().out
    found = judge(capsys, tmp_path / "slow.ulg")
    assert found["acceleration_integral_m2ps3"] == pytest.approx(
        (SPEED_MPS**2 / RADIUS_M) ** 2 * 10.0, rel=0.02
    )


def test_its_origin_may_stand_anywhere_in_the_building(tmp_path, capsys):
    room = recordings.room_stl(tmp_path / "room.stl")
    time_s, position_m, _ = circle()
    turned = math.radians(30.0)
    c, s = math.cos(turned), math.sin(turned)
    origin_m = np.array([1.0, 2.0, 0.5])
    own_m = (position_m - origin_m) @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]).T
    (tmp_path / "own.csv").write_text(recordings.csv_text(time_s, own_m))
    found = judge(capsys, tmp_path / "own.csv", "--world", room, "--at", 1, 2, 0.5, 30)
    assert found["min_clearance_m"] == pytest.approx(HEIGHT_M, abs=1e-3)
    assert found["notes"] == []


def test_a_flight_of_ours_is_judged_as_it_was_measured(tmp_path, capsys):
    trial = uavexp.fly(world="random_columns", vehicle="point_mass", seed=100, **{"world.size_m": [9, 6, 3]})
    stored = StoredTrial(name="flight", label="flight", log=trial.log, world=trial.world)
    columns = (
        "path_length_m", "completion_time_s", "mean_speed_mps", "max_speed_mps",
        "acceleration_integral_m2ps3", "jerk_integral_m2ps5",
    )  # fmt: skip
    export(stored, "csv", tmp_path / "flight.csv")
    found = judge(capsys, tmp_path / "flight.csv")
    for column in (*columns, "tracking_error_m"):
        assert found[column] == pytest.approx(trial.metrics[column], rel=1e-6), column
    for extra in ("rosbags", "foxglove", "mcap_protobuf"):
        pytest.importorskip(extra)
    for to, name in (("rosbag2", "bag"), ("mcap", "flight.mcap")):
        export(stored, to, tmp_path / name)
        found = judge(capsys, tmp_path / name)
        for column in columns:
            assert found[column] == pytest.approx(trial.metrics[column], rel=0.05), (to, column)
        if to == "rosbag2":
            assert found["replans"] == trial.metrics["useful_replans"]


def test_a_path_said_again_is_no_replan():
    line = np.column_stack([np.linspace(0.0, 5.0, 11), np.zeros(11), np.zeros(11)])
    beside = np.add(line, [0.0, 0.5, 0.0])
    paths = [line, line, line[4:], beside, beside]
    plans = new_paths([Plan(time_s=float(n), path_m=path) for n, path in enumerate(paths)])
    assert [plan.time_s for plan in plans] == [0.0, 3.0]
    assert departure_m(line, line[4:]) == 0.0
    assert departure_m(line, beside) == pytest.approx(0.5)


def test_a_body_that_looks_north_looks_along_y():
    """PX4's identity: forward is north, and so y; left is west, -x; up is up."""
    turned = from_ned_frd(np.eye(3)[None])[0]
    assert turned @ [1.0, 0.0, 0.0] == pytest.approx([0.0, 1.0, 0.0])
    assert turned @ [0.0, 1.0, 0.0] == pytest.approx([-1.0, 0.0, 0.0])
    assert np.linalg.det(turned) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("header", "text"),
    [
        ("#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m]", "{:.0f}000000,{},{},{}"),
        ("t_ms;X;Y;Z", "{:.0f};{};{};{}"),
        ("timestamp,x,y,z", "1700000{:06.0f},{},{},{}"),
    ],
)
def test_other_peoples_headers_are_understood(header, text, tmp_path, capsys):
    time_s, position_m, _ = circle()
    rows = [text.format(1000.0 * time, *place) for time, place in zip(time_s, position_m, strict=True)]
    body = "\n".join(rows)
    (tmp_path / "a.csv").write_text(f"{header}\n{body.replace('.', ',') if ';' in header else body}\n")
    found = judge(capsys, tmp_path / "a.csv")
    assert found["path_length_m"] == pytest.approx(SPEED_MPS * DURATION_S, rel=1e-3)
    assert found["completion_time_s"] == pytest.approx(DURATION_S)


@pytest.mark.parametrize(
    ("times", "said"),
    [
        ([0.0, 0.1, 0.1, 0.2], "stamps must increase, position 2 has 0.100000 s twice"),
        ([0.0, 0.2, 0.1, 0.3], "stamps must increase, position 2 has 0.100000 s after 0.200000 s"),
        ([0.0, 0.02, 0.04, 1.7e9], "stamps leap by 1.7e+09 s at position 3"),
        ([0.0, 1e5, 2e5, 3e5], "positions are 1e+05 s apart; are its times seconds?"),
        ([0.0], "a flight needs at least 2"),
        ([], "a flight needs at least 2"),
    ],
)
def test_stamps_that_do_not_increase_are_refused(times, said, tmp_path, capsys):
    times = np.array(times)
    (tmp_path / "a.csv").write_text(recordings.csv_text(times, np.ones((len(times), 3))))
    assert said in refusal(capsys, tmp_path / "a.csv")


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.csv", "time_s,vx,vy\n0,1,1\n", "no columns of x, y, z; it has time_s, vx, vy"),
        ("a.csv", "x,y,z\n0,1,1\n", "no columns of time"),
        ("a.csv", "t,x,y,z\n0,1,1,one\n1,1,1,1\n", "could not convert"),
        ("a.csv", "t,x,y,z\n0,1,1\n", "row 0 has 3 columns, 4 are needed"),
        ("a.csv", "t,x,y,z\n0,,,\n1,nan,1,1\n", "has 0 positions"),
        ("a.csv", "", "no rows"),
        ("a.csv", "t,x,y,z\n0,0,0,0\n1,0,4e7,0\n", "a position is 4e+07 m from the origin"),
        ("a.tum", "0 1 2\n", "row 0 has 3 columns, 4 are needed"),
        ("a.ulg", "ULog", "damaged, or not a PX4 log"),
        ("a.bag", "#ROSBAG V2.0\n", "damaged, or not a ROS bag"),
        ("a.mcap", "", "damaged, or not an MCAP"),
        ("a.db3", "SQLite", "damaged, or not a ROS bag"),
        ("a.xyz", "", ".xyz is none of .ulg, .bag"),
    ],
)
def test_what_tells_no_flight_is_one_line(name, text, said, tmp_path, capsys):
    if (extra := READERS.get(Path(name).suffix)) is not None:
        pytest.importorskip(extra)
    (tmp_path / name).write_text(text)
    assert said in refusal(capsys, tmp_path / name)


@pytest.mark.parametrize("name", ["flight.ulg", "flight.bag", "folder/folder.mcap", "folder.db3"])
def test_a_truncated_file_is_one_line_or_told(name, tmp_path, capsys):
    file = write(tmp_path, name)
    whole = file.read_bytes()
    for share in (0.03, 0.5, 0.97):
        file.write_bytes(whole[: int(share * len(whole))])
        code = command.main([str(file)])
        said = capsys.readouterr()
        assert code in (0, 2)
        assert "Traceback" not in said.err
        assert said.err.count("\n") == (1 if code else 0)
        assert code == 2 or name == "flight.ulg"  # which is whole up to its end, wherever that is


def test_a_log_without_valid_position_is_refused(tmp_path, capsys):
    pytest.importorskip("pyulog")
    file = tmp_path / "a.ulg"
    file.write_bytes(recordings.ulog_bytes(*circle(), valid=False))
    assert "none of vehicle_local_position is valid" in refusal(capsys, file)
    file.write_bytes(recordings.ulog_bytes(*circle(), name="sensor_accel"))
    assert "the log has no vehicle_local_position" in refusal(capsys, file)


def test_topics_are_asked_for_or_refused(tmp_path, capsys):
    time_s, position_m, _ = circle()
    file = recordings.ros_bag(tmp_path / "two.bag", "bag", time_s, position_m, ("/pose", "/truth"))
    assert "/pose, /truth tell positions; name one with --topic" in refusal(capsys, file)
    assert judge(capsys, file, "--topic", "/truth")["source"] == "/truth"
    assert "did you mean '/truth'" in refusal(capsys, file, "--topic", "/thruth")
    (tmp_path / "a.csv").write_text(recordings.csv_text(time_s, position_m))
    assert "a table has no topics" in refusal(capsys, tmp_path / "a.csv", "--topic", "/pose")


def test_a_building_that_is_another_frame_is_refused(tmp_path, capsys):
    room = recordings.room_stl(tmp_path / "room.stl")
    time_s, position_m, _ = circle()
    (tmp_path / "far.csv").write_text(recordings.csv_text(time_s, np.add(position_m, [20.0, 0.0, 0.0])))
    said = refusal(capsys, tmp_path / "far.csv", "--world", room)
    assert "lies outside" in said
    assert "--at X Y Z YAW_DEG" in said
    walls = tmp_path / "walls.stl"
    import trimesh

    shells = [
        trimesh.creation.box(bounds=[[0, 0, 0], [10, 8, 3]]),
        *(trimesh.creation.box(bounds=[[x, 0, 0], [x + 0.1, 8, 3]]) for x in (4.0, 5.0, 6.0)),
    ]
    trimesh.util.concatenate(shells).export(walls)
    (tmp_path / "through.csv").write_text(recordings.csv_text(time_s, position_m))
    assert "goes through surfaces" in refusal(capsys, tmp_path / "through.csv", "--world", walls)
    assert "a file is needed" in refusal(capsys)
    assert "does not exist" in refusal(capsys, tmp_path / "through.csv", "--world", tmp_path / "no.stl")
    assert "name it with --world" in refusal(capsys, tmp_path / "through.csv", "world.unit_m=1")


@pytest.mark.skipif(not PX4.is_dir(), reason=f"no logs at {PX4}")
def test_real_px4_logs(capsys):
    found = judge(capsys, PX4 / "sample_px4_events.ulg")
    assert 4.0 < found["path_length_m"] < 6.0  # up 2.5 m and down again
    assert found["replans"] == 2.0
    for name in ("sample.ulg", "sample_log_small.ulg"):
        assert "no position" in refusal(capsys, PX4 / name)
