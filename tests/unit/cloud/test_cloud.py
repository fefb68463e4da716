"""The cloud pipeline against clouds whose planes, voxels and specks are known."""

from __future__ import annotations

import json
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from uavexp import formats
from uavexp.arrays import Float
from uavexp.cloud.__main__ import main
from uavexp.cloud.cloud_file import CloudError, read_cloud
from uavexp.cloud.outliers import outliers
from uavexp.cloud.pipeline import CloudPipeline
from uavexp.cloud.planes import fit_planes, plane_of
from uavexp.cloud.simulated_scan import simulated_scan
from uavexp.cloud.traversability import obstacles
from uavexp.cloud.voxels import packed, unpacked, voxelise
from uavexp.errors import ConfigError, WorldError
from uavexp.formats import SOLID
from uavexp.scene import Scene
from uavexp.world.boxes import Boxes

ROOM_M = (4.0, 3.0, 2.5)


def scan_of_a_room(rays: int = 8000, noise_m: float = 0.004) -> Float:
    boxes = Boxes()
    boxes.shell(ROOM_M)
    scene = Scene.from_mesh(*boxes.mesh())
    poses = np.array([[1.0, 1.0, 1.2], [3.0, 2.0, 1.0]])
    return simulated_scan(scene, poses, rays, 10.0, noise_m, np.random.default_rng(0))


def test_a_scan_lies_on_the_walls_within_its_noise() -> None:
    points = scan_of_a_room()
    assert len(points) == 16_000  # a closed room
    gap = np.minimum(np.abs(points), np.abs(points - ROOM_M)).min(axis=1)
    assert np.sqrt(np.mean(gap**2)) < 0.004
    assert gap.max() < 0.03


def test_counts_of_a_room() -> None:
    counts = CloudPipeline(voxel_size_m=0.1).run(scan_of_a_room(), ROOM_M).counts
    assert counts.points == 16_000
    assert counts.planes == 6
    assert counts.planar_share > 0.97
    area = 2.0 * np.array([4 * 3, 4 * 2.5, 3 * 2.5])  # rays do not fall evenly, but not far from it
    assert counts.horizontal_share == pytest.approx(area[0] / area.sum(), abs=0.15)
    assert counts.vertical_share + counts.horizontal_share == pytest.approx(counts.planar_share)
    assert counts.deviation is not None
    assert max(map(abs, counts.deviation)) < 0.02


def test_the_same_seed_gives_the_same_model() -> None:
    points = scan_of_a_room(2000)
    one, again = (CloudPipeline(voxel_size_m=0.1, seed=3).run(points) for _ in range(2))
    assert one.counts == again.counts
    np.testing.assert_array_equal(one.voxels.centroid_m, again.voxels.centroid_m)
    assert all(np.array_equal(a.normal, b.normal) for a, b in zip(one.planes, again.planes, strict=True))


def test_stray_points_are_outliers_and_a_grid_has_none() -> None:
    rng = np.random.default_rng(1)
    sheet = np.column_stack([rng.uniform(0.0, 2.0, (4000, 2)), rng.normal(0.0, 0.002, 4000)])
    stray = rng.uniform([0.0, 0.0, 0.5], [2.0, 2.0, 2.0], (15, 3))
    found = outliers(np.vstack([sheet, stray]), 16, 3.0)
    assert found[4000:].all()
    assert found[:4000].mean() < 0.02
    ring = np.linspace(0.0, 2.0 * np.pi, 100, endpoint=False)
    assert not outliers(np.column_stack([np.cos(ring), np.sin(ring), 0.0 * ring]), 8, 1.0).any()


def test_slabs_do_not_change_the_outliers(monkeypatch: pytest.MonkeyPatch) -> None:
    points = scan_of_a_room(1500, 0.02)
    whole = outliers(points, 12, 1.5)
    monkeypatch.setattr("uavexp.cloud.outliers._SLAB_POINTS", 500)
    np.testing.assert_array_equal(outliers(points, 12, 1.5), whole)


def test_planes_are_found_where_they_are() -> None:
    rng = np.random.default_rng(2)
    floor = np.column_stack([rng.uniform(0.0, 4.0, (3000, 2)), np.zeros(3000)])
    wall = np.column_stack([np.full(1500, 1.0), rng.uniform(0.0, 4.0, 1500), rng.uniform(0.2, 2.0, 1500)])
    points = np.vstack([floor, wall])
    settings = {"threshold_m": 0.02, "iterations": 500, "least_share": 0.1, "most_planes": 9, "sample": 10**6}
    planes = fit_planes(points, seed=0, **settings)  # type: ignore[arg-type]
    assert [plane.is_horizontal for plane in planes] == [True, False]
    assert [plane.is_vertical for plane in planes] == [False, True]
    assert abs(planes[0].normal[2]) == pytest.approx(1.0, abs=1e-3)
    assert abs(planes[1].offset_m) == pytest.approx(1.0, abs=0.01)
    number = plane_of(points, planes, 0.02)
    assert (number[:3000] == 0).all()
    assert (number[3000:] == 1).mean() > 0.98


def test_voxels_keep_the_centroid_of_their_points(monkeypatch: pytest.MonkeyPatch) -> None:
    points = np.random.default_rng(3).uniform(-1.0, 1.0, (2000, 3))
    voxels = voxelise(points, 0.25)
    index = np.floor(points / 0.25).astype(int)
    for n in range(0, len(voxels.key), 17):
        mine = points[(index == voxels.index[n]).all(axis=1)]
        assert voxels.points[n] == len(mine)
        np.testing.assert_allclose(voxels.centroid_m[n], mine.mean(axis=0), atol=1e-12)
    assert voxels.points.sum() == 2000
    monkeypatch.setattr("uavexp.cloud.voxels._CHUNK", 300)
    np.testing.assert_allclose(voxelise(points, 0.25).centroid_m, voxels.centroid_m, atol=1e-12)


def test_indices_survive_packing() -> None:
    index = np.random.default_rng(0).integers(-500_000, 500_000, (100, 3))
    np.testing.assert_array_equal(unpacked(packed(index)), index)


def test_specks_are_traversable_and_corners_join() -> None:
    bar = np.array([[n, n, 0] for n in range(10)])  # joined by edges only
    speck = np.array([[30, 0, 0], [31, 1, 1]])
    voxels = voxelise((np.vstack([bar, speck]) + 0.5) * 0.1, 0.1)
    blocked = obstacles(voxels, 3)
    assert {tuple(cell) for cell in voxels.index[blocked]} == {tuple(cell) for cell in bar}
    assert obstacles(voxels, 2).all()


def test_ten_million_points_need_bounded_memory() -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform(0.0, 10.0, (10_000_000, 3))
    points[:, 2] = np.round(points[:, 2])
    tracemalloc.start()
    voxels = voxelise(points, 0.1)
    planes = fit_planes(
        points, threshold_m=0.01, iterations=100, least_share=0.05, most_planes=3, sample=20_000, seed=0
    )
    plane_of(points, planes, 0.01)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert voxels.points.sum() == 10_000_000
    assert peak < 0.5e9  # the points alone are 240 MB, and not counted


@pytest.mark.parametrize(
    ("points", "word"),
    [
        (np.zeros((0, 3)), "no finite point"),
        (np.full((5, 3), np.nan), "no finite point"),
        (np.ones((1, 3)), "at least 3"),
        (np.ones((4, 2)), "shape"),
        (np.random.default_rng(0).uniform(0.0, 100.0, (50, 3)), "hang together"),
        (np.array([[0.0, 0, 0], [1, 1, 1], [1e9, 0, 0], [2, 2, 2]]), "far"),
    ],
)
def test_bad_clouds_are_errors_of_one_line(points: Float, word: str) -> None:
    with pytest.raises(CloudError, match=word) as error:
        CloudPipeline(voxel_size_m=0.05, least_voxels=5).run(points)
    assert "\n" not in str(error.value)


def test_points_that_are_not_finite_are_left_out() -> None:
    points = scan_of_a_room(1000)
    holes = np.vstack([points, np.full((7, 3), np.nan), [[np.inf, 0.0, 0.0]]])
    pipeline = CloudPipeline(voxel_size_m=0.1)
    assert pipeline.run(holes).counts == pipeline.run(points).counts


def test_the_command_prints_one_line_of_counts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    np.savez(tmp_path / "room.npz", points=scan_of_a_room(1500))
    assert main([str(tmp_path / "room.npz"), "--voxel", "0.1", "--truth", *map(str, ROOM_M)]) == 0
    line = capsys.readouterr().out
    assert line.count("\n") == 1
    assert json.loads(line)["planes"] == 6


def test_bad_files_are_one_line_and_exit_code_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "broken.ply").write_bytes(b"ply\nnonsense")
    (tmp_path / "broken.npz").write_bytes(b"nonsense")
    (tmp_path / "cloud.doc").write_bytes(b"")
    np.savez(tmp_path / "other.npz", something=np.zeros(3))
    for name in ("broken.ply", "broken.npz", "cloud.doc", "other.npz", "missing.ply"):
        assert main([str(tmp_path / name)]) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1
        assert name in error
    with pytest.raises(WorldError):
        read_cloud(tmp_path / "missing.ply")


def test_a_cloud_is_read_whatever_its_format_and_case(tmp_path: Path) -> None:
    points = np.random.default_rng(0).uniform(0.0, 2.0, (50, 3)).round(3)
    np.savetxt(tmp_path / "ROOM.XYZ", points)
    np.savez(tmp_path / "voxels.npz", occupied=np.floor(points) + 0.5, resolution=1.0)
    np.testing.assert_allclose(read_cloud(tmp_path / "ROOM.XYZ"), points)
    np.testing.assert_allclose(read_cloud(tmp_path / "voxels.npz"), np.unique(np.floor(points) + 0.5, axis=0))


def test_a_plan_is_no_cloud(tmp_path: Path) -> None:
    (tmp_path / "m.pgm").write_bytes(b"P2 1 1 255 0")
    (tmp_path / "m.yaml").write_text("image: m.pgm\nresolution: 1\norigin: [0, 0, 0]\n")
    with pytest.raises(CloudError, match="no cloud"):
        read_cloud(tmp_path / "m.yaml")


@pytest.mark.parametrize(
    ("name", "value"), [("voxel_size_m", 0.0), ("neighbours", 0), ("least_plane_share", 2.0)]
)
def test_impossible_settings_are_refused(name: str, value: float) -> None:
    with pytest.raises(ConfigError, match=name):
        CloudPipeline(**{name: value})  # type: ignore[arg-type]


def test_its_obstacles_are_a_building_to_fly_in(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cloud, voxels = tmp_path / "room.npz", tmp_path / "voxels.npz"
    stray = np.array([[3.0, 2.5, 1.5], [3.3, 1.0, 1.2]])
    np.savez(cloud, points=np.vstack([scan_of_a_room(60_000), stray]))
    assert main([str(cloud), "--voxel", "0.1", "--out", str(voxels)]) == 0
    counts = json.loads(capsys.readouterr().out)
    cells = formats.read(voxels, formats.Options()).cells
    assert cells is not None
    centres_m = cells.origin + (np.argwhere(cells.state == SOLID) + 0.5) * cells.size
    assert len(centres_m) == counts["obstacle_voxels"]
    for point_m in stray:  # what the pipeline took for outliers or specks is in nobody's way
        assert np.linalg.norm(centres_m - point_m, axis=1).min() > 0.3
    assert main([str(cloud), "--out", str(tmp_path / "voxels.ply")]) == 2
    assert "ends with .npz" in capsys.readouterr().err
