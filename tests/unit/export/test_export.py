"""Exported flights, read back by programs that are not ours."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import yaml
from PIL import Image
from scipy.spatial.transform import Rotation

from tests.folders import DATA
from tests.logs import changed, empty_log, make_log, still_curve
from uavexp.errors import ConfigError, RecordError
from uavexp.export import __main__ as command
from uavexp.export.formats import FORMATS, export
from uavexp.export.map_voxels import map_voxels, mapped_until_m
from uavexp.store.logs import log_arrays, pack
from uavexp.store.stored_trial import StoredTrial, read_trial
from uavexp.types import Shape

trimesh = pytest.importorskip("trimesh")
make_reader = pytest.importorskip("mcap.reader").make_reader
DecoderFactory = pytest.importorskip("mcap_protobuf.decoder").DecoderFactory
AnyReader = pytest.importorskip("rosbags.highlevel").AnyReader
FLOWN = DATA / "study" / "trials" / "mcr_rooms-s0-a1cbaac7e702"
SIZE_M = 0.1


@pytest.fixture(scope="module")
def flown() -> StoredTrial:
    """A flight whose log kept its occupied voxels alone."""
    return read_trial(FLOWN)


@pytest.fixture(scope="module")
def noted() -> StoredTrial:
    """A flight of 20 s round a circle with a map that grows, beside three movers."""
    rng = np.random.default_rng(3)
    shape = (70, 60, 26)
    state = rng.choice(3, size=shape, p=[0.3, 0.6, 0.1])
    state[8:24, 16:32, 8:24] = 1  # a block that an octree prunes
    origin_m = np.array([-4.0, -3.0, -0.2])
    index = np.argwhere(state == 2)
    log = make_log(
        lambda t: np.stack([2.0 * np.cos(t), 2.0 * np.sin(t), np.full_like(t, 1.2)], axis=1),
        lambda t: np.stack([-2.0 * np.sin(t), 2.0 * np.cos(t), np.zeros_like(t)], axis=1),
        duration_s=20.0,
    )
    rows = log.steps.time_s.size
    log = changed(
        log,
        mapped_m=(origin_m + (index + 0.5) * SIZE_M).astype(np.float32),
        map_origin_m=origin_m,
        map_voxel_size_m=SIZE_M,
        map_shape=np.array(shape),
        map_free=np.packbits(state.ravel() == 1),
        map_occupied_s=rng.uniform(0.0, 20.0, len(index)).astype(np.float32),
        mover_shape=np.array([Shape.SPHERE, Shape.CYLINDER, Shape.BOX], dtype=np.uint8),
        mover_half_size_m=np.full((3, 3), 0.3),
        mover_position_m=np.tile(np.arange(9.0, dtype=np.float32).reshape(3, 3), (rows, 1, 1)),
        mover_clearance_m=np.ones(rows),
    )
    return StoredTrial(name="circle", label="circle", log=log, world=None)


def written(trial: StoredTrial, to: str, folder: Path) -> Path:
    return Path(export(trial, to, folder / f"flight{FORMATS[to].suffix}")[0])


def messages(file: Path) -> dict[str, list[tuple[float, Any]]]:
    with file.open("rb") as stream:
        found: dict[str, list[tuple[float, Any]]] = {}
        for schema, channel, message, decoded in make_reader(
            stream, decoder_factories=[DecoderFactory(), _Json()]
        ).iter_decoded_messages():
            assert schema.name.startswith("foxglove.") or channel.topic == "/figures"
            found.setdefault(channel.topic, []).append((message.log_time * 1e-9, decoded))
    return found


class _Json:
    """Reads messages in JSON, which mcap leaves to its user."""

    def decoder_for(self, encoding: str, schema: Any) -> Any:
        import json

        return json.loads if encoding == "json" else None


def test_a_table_of_state_and_reference_has_the_log_to_the_last_bit(flown, tmp_path) -> None:
    table = pd.read_csv(written(flown, "csv", tmp_path))
    steps = flown.log.steps
    for axis, name in enumerate("xyz"):
        np.testing.assert_array_equal(table[f"position_{name}_m"], steps.position_m[:, axis])
        np.testing.assert_array_equal(
            table[f"reference_position_{name}_m"], steps.reference_position_m[:, axis]
        )
    np.testing.assert_array_equal(table["time_s"], steps.time_s)
    np.testing.assert_array_equal(table["quaternion_w"], steps.quaternion_wxyz[:, 0])


def test_setpoints_are_north_east_down(noted, tmp_path) -> None:
    table = pd.read_csv(written(noted, "px4", tmp_path))
    at_s = table["timestamp"].to_numpy() * 1e-6
    assert np.diff(at_s) == pytest.approx(0.02)
    np.testing.assert_allclose(table["position[0]"], 2.0 * np.sin(at_s), atol=1e-5)  # north: our y
    np.testing.assert_allclose(table["position[1]"], 2.0 * np.cos(at_s), atol=1e-5)  # east: our x
    np.testing.assert_allclose(table["position[2]"], -1.2, atol=1e-5)
    np.testing.assert_allclose(table["velocity[0]"][1:-1], 2.0 * np.cos(at_s)[1:-1], atol=1e-4)
    np.testing.assert_allclose(table["yaw"], math.pi / 2, atol=1e-5)  # looking along our x, east


def test_the_mesh_of_a_map_encloses_its_voxels(flown, noted, tmp_path) -> None:
    block = np.argwhere(np.ones((3, 2, 2))) * SIZE_M
    log = changed(noted.log, mapped_m=block.astype(np.float32), map_shape=np.zeros(0, dtype=np.int64))
    mesh = trimesh.load(written(StoredTrial(name="b", label="b", log=log, world=None), "ply", tmp_path))
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(12 * SIZE_M**3, rel=1e-5)
    mesh = trimesh.load(written(flown, "ply", tmp_path), process=False)
    inside_m = flown.log.mapped_m
    np.testing.assert_allclose(mesh.bounds[0], inside_m.min(axis=0) - 0.05, atol=1e-4)
    np.testing.assert_allclose(mesh.bounds[1], inside_m.max(axis=0) + 0.05, atol=1e-4)


def test_an_octomap_knows_every_voxel_of_the_map(noted, tmp_path) -> None:
    octomap = pytest.importorskip("pyoctomap")
    tree = octomap.OcTree(bytes(written(noted, "octomap", tmp_path)))
    assert tree.getResolution() == pytest.approx(SIZE_M)
    voxels = map_voxels(noted.log)
    centres_m = voxels.origin_m + (np.argwhere(np.ones_like(voxels.free)) + 0.5) * SIZE_M
    rows = np.random.default_rng(0).choice(len(centres_m), 4000, replace=False)
    for row, (occupied, free) in zip(
        rows, np.stack([voxels.occupied.ravel(), voxels.free.ravel()], axis=1)[rows], strict=True
    ):
        node = tree.search(centres_m[row])
        kind = "unknown" if node is None else "occupied" if tree.isNodeOccupied(node) else "free"
        assert kind == ("occupied" if occupied else "free" if free else "unknown"), centres_m[row]
    leaves = sum(1 for _ in tree.begin_leafs())
    assert leaves < (voxels.occupied | voxels.free).sum() - 3000, "the block of free space is pruned"


def test_our_own_reader_counts_the_octomaps_nodes_and_finds_the_same_cells(noted, tmp_path) -> None:
    from uavexp.formats import FREE, SOLID, octomap
    from uavexp.formats.base import Options

    cells = octomap.read(written(noted, "octomap", tmp_path), Options()).cells  # refuses another count
    voxels = map_voxels(noted.log)
    assert (cells.state == SOLID).sum() == voxels.occupied.sum()
    assert (cells.state == FREE).sum() == voxels.free.sum()
    np.testing.assert_allclose(cells.origin, voxels.origin_m, atol=1e-9)


def test_a_ros_map_is_the_slice_at_flight_height(noted, tmp_path) -> None:
    file = written(noted, "nav2map", tmp_path)
    described = yaml.safe_load(file.read_text())
    grey = np.array(Image.open(file.parent / described["image"]))
    voxels = map_voxels(noted.log)
    assert grey.shape == voxels.free.shape[1::-1]
    assert described["origin"][:2] == pytest.approx([-4.0, -3.0])
    occupied = described["occupied_thresh"] < (255 - grey[::-1].T) / 255
    free = described["free_thresh"] > (255 - grey[::-1].T) / 255
    layer = round((1.2 + 0.2) / SIZE_M - 0.5)
    band = voxels.occupied[:, :, layer - 2 : layer + 2].any(axis=2) | voxels.occupied[:, :, layer + 2]
    assert not (occupied & ~band).any()
    assert occupied[voxels.occupied[:, :, layer]].all()
    np.testing.assert_array_equal(free, voxels.free[:, :, layer] & ~occupied)


def test_our_own_reader_takes_the_ros_map_for_a_building(noted, tmp_path) -> None:
    from uavexp.formats import ros_map
    from uavexp.formats.base import Options

    state = ros_map.read(written(noted, "nav2map", tmp_path), Options()).cells.state
    assert set(np.unique(state)) == {0, 1, 2}


def test_an_mcap_tells_where_the_vehicle_was_and_what_it_knew(noted, tmp_path) -> None:
    file = written(noted, "mcap", tmp_path)
    assert file.stat().st_size < 5e6
    found = messages(file)
    assert {"/tf", "/state", "/estimate", "/reference", "/map", "/movers", "/vehicle"} <= set(found)
    for at_s, pose in found["/tf"][::97]:
        place = pose.translation
        np.testing.assert_allclose(
            [place.x, place.y, place.z], [2 * math.cos(at_s), 2 * math.sin(at_s), 1.2], atol=1e-9
        )
        assert pose.timestamp.seconds + pose.timestamp.nanos * 1e-9 == pytest.approx(at_s)
    sizes = [len(cloud.data) // 12 for _, cloud in found["/map"]]
    assert sizes == sorted(sizes)
    assert sizes[0] < 0.01 * sizes[-1]
    assert sizes[-1] == len(noted.log.mapped_m)
    points = np.frombuffer(found["/map"][-1][1].data, "<f4").reshape(-1, 3)
    np.testing.assert_array_equal(points, noted.log.mapped_m)
    last = found["/movers"][-1][1].entities
    assert [len(e.spheres) + 2 * len(e.cylinders) + 4 * len(e.cubes) for e in last] == [1, 2, 4]
    speeds = [figures["speed_mps"] for _, figures in found["/figures"]]
    assert speeds == pytest.approx([2.0] * len(speeds))


def test_an_mcap_tells_every_plan_and_its_cause(flown, tmp_path) -> None:
    found = messages(written(flown, "mcap", tmp_path))
    at_s, state = found["/state"][90]
    turned, speed = state.pose.orientation, state.linear_velocity
    world_mps = Rotation.from_quat([turned.x, turned.y, turned.z, turned.w]).apply(
        [speed.x, speed.y, speed.z]
    )
    row = round(at_s / flown.log.step_s)
    np.testing.assert_allclose(world_mps, flown.log.steps.velocity_mps[row], atol=1e-9)
    replans = flown.log.replans
    assert [line.name for _, line in found["/causes"]] == [replan.cause for replan in replans]
    assert [at_s for at_s, _ in found["/causes"]] == pytest.approx([replan.time_s for replan in replans])
    taken = [replan for replan in replans if np.isfinite(replan.effective_s) and len(replan.trajectory_m)]
    for (_, update), replan in zip(found["/plan"], taken, strict=True):
        points = [(p.x, p.y, p.z) for p in update.entities[0].lines[0].points]
        np.testing.assert_allclose(points, replan.trajectory_m)


def test_the_layout_shows_topics_that_are_there(noted, flown, tmp_path) -> None:
    import json

    from uavexp.export.mcap import LAYOUT

    layout = json.loads(LAYOUT.read_text())["configById"]
    topics = {*messages(written(noted, "mcap", tmp_path)), *messages(written(flown, "mcap", tmp_path))}
    shown = {*layout["3D!flight"]["topics"], layout["RosOut!causes"]["topicToRender"]}
    for panel in (layout["Plot!clearance"], layout["Plot!speed"]):
        shown |= {path["value"].split(".")[0] for path in panel["paths"]}
    assert shown <= topics


def test_a_rosbag_is_read_by_ros_readers(flown, tmp_path) -> None:
    with AnyReader([written(flown, "rosbag2", tmp_path)]) as bag:
        found: dict[str, list[tuple[int, Any]]] = {}
        for connection, stamp, raw in bag.messages():
            found.setdefault(connection.topic, []).append((stamp, bag.deserialize(raw, connection.msgtype)))
    stamp, state = found["/state"][40]
    row = round(stamp * 1e-9 / flown.log.step_s)
    place = state.pose.pose.position
    np.testing.assert_array_equal([place.x, place.y, place.z], flown.log.steps.position_m[row])
    assert state.header.stamp.sec * 10**9 + state.header.stamp.nanosec == stamp
    assert [text.data.split(": ")[1].split(",")[0] for _, text in found["/causes"]] == [
        replan.cause for replan in flown.log.replans
    ]
    cloud = found["/map"][-1][1]
    np.testing.assert_array_equal(cloud.data.view("<f4").reshape(-1, 3), flown.log.mapped_m)
    turned, speed = state.pose.pose.orientation, state.twist.twist.linear
    body = Rotation.from_quat([turned.x, turned.y, turned.z, turned.w])
    np.testing.assert_allclose(
        body.apply([speed.x, speed.y, speed.z]), flown.log.steps.velocity_mps[row], atol=1e-9
    )
    np.testing.assert_allclose(
        [turned.w, turned.x, turned.y, turned.z], flown.log.steps.quaternion_wxyz[row], atol=1e-12
    )


def test_a_rerun_recording_is_one(flown, tmp_path) -> None:
    pytest.importorskip("rerun")
    assert written(flown, "rrd", tmp_path).read_bytes()[:3] == b"RRF"


def test_the_map_of_an_older_log_is_all_there_from_the_start(flown) -> None:
    assert len(mapped_until_m(flown.log, 0.0)) == len(flown.log.mapped_m)
    voxels = map_voxels(flown.log)
    assert voxels.occupied.sum() == len(flown.log.mapped_m)
    assert voxels.voxel_size_m == 0.1
    assert not voxels.free.any()


@pytest.mark.parametrize("to", [name for name in FORMATS if name != "rrd"])
def test_a_flight_of_one_row_without_a_map_is_written_or_refused(to, tmp_path) -> None:
    log = make_log(still_curve(), still_curve(), duration_s=0.0)
    trial = StoredTrial(name="still", label="still", log=log, world=None)
    if to == "octomap":
        with pytest.raises(ConfigError, match="1 to 65,536 voxels"):
            written(trial, to, tmp_path)
    else:
        assert written(trial, to, tmp_path).exists()


def test_the_command_says_what_it_wrote_and_what_is_wrong(tmp_path, capsys) -> None:
    out = tmp_path / "new" / "flight.csv"
    assert command.main([str(FLOWN), "--to", "csv", "--out", str(out)]) == 0
    assert capsys.readouterr().out == f"{out}\n"
    assert command.main([str(FLOWN), "--to", "ply", "--out", str(out)]) == 2
    assert "ends in .ply" in capsys.readouterr().err
    assert command.main([str(DATA / "study"), "--to", "csv"]) == 2
    assert "is a study of 12 trials, name one, e.g." in capsys.readouterr().err
    assert command.main([str(tmp_path / "none"), "--to", "csv"]) == 2
    assert "no such folder" in capsys.readouterr().err
    assert command.main([str(FLOWN), "--to", "csv", "--out", str(out / "below.csv")]) == 2
    assert "cannot be written" in capsys.readouterr().err


def test_a_missing_package_is_one_line_that_names_it(flown, tmp_path, monkeypatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "foxglove", None)
    monkeypatch.delitem(sys.modules, "uavexp.export.mcap", raising=False)
    with pytest.raises(ConfigError, match="pip install foxglove-sdk"):
        export(flown, "mcap", tmp_path / "a.mcap")


def test_a_damaged_or_empty_flight_is_one_line(tmp_path) -> None:
    (tmp_path / "log.npz").write_bytes((FLOWN / "log.npz").read_bytes()[:1000])
    with pytest.raises(RecordError, match="damaged"):
        read_trial(tmp_path)
    (tmp_path / "log.npz").write_bytes(pack(log_arrays(empty_log())))
    with pytest.raises(RecordError, match="before its first step"):
        read_trial(tmp_path)
