"""Gazebo worlds: shapes and models stand where Gazebo would put them, and what is missing is said."""

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings

from tests.collada_files import dae
from tests.damage import DAMAGES, check_ends_well, damaged
from tests.folders import SHARED
from tests.shaped_meshes import area_and_volume
from tests.unit.formats.test_stl import binary
from uavexp import formats
from uavexp.errors import WorldError
from uavexp.formats import Content, sdf_scene

BOX = "<geometry><box><size>2 4 6</size></box></geometry>"


def collision(geometry: str = BOX, pose: str = "") -> str:
    return f'<collision name="c">{pose}{geometry}</collision>'


def model(
    inner: str | None = None, name: str = "m", pose: str = "", static: str = "<static>true</static>"
) -> str:
    link = f'<link name="l">{collision()}</link>' if inner is None else inner
    return f'<model name="{name}">{static}{pose}{link}</model>'


def world(inner: str) -> str:
    return f'<?xml version="1.0"?><sdf version="1.7"><world name="w">{inner}</world></sdf>'


def read(folder: Path, text: str, name: str = "w.world") -> Content:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return formats.read(path, formats.Options())


def box(content: Content) -> list[list[float]]:
    corners = content.vertices[content.triangles].reshape(-1, 3)
    return [corners.min(axis=0).tolist(), corners.max(axis=0).tolist()]


def check_box(content: Content, low: list[float], high: list[float]) -> None:
    np.testing.assert_allclose(box(content), [low, high], atol=1e-9)


def test_a_box_stands_about_its_origin(tmp_path: Path) -> None:
    content = read(tmp_path, world(model()))
    check_box(content, [-1, -2, -3], [1, 2, 3])
    assert (content.kind, content.unit_m, content.up_axis) == ("Gazebo world", 1.0, "z")
    assert content.warnings == ()


@pytest.mark.parametrize(
    ("geometry", "half"),
    [
        ("<sphere><radius>2</radius></sphere>", [2, 2, 2]),
        ("<cylinder><radius>2</radius><length> 3 </length></cylinder>", [2, 2, 1.5]),
        ("<capsule><radius>1</radius><length>3</length></capsule>", [1, 1, 2.5]),
        ("<ellipsoid><radii>1 2 3</radii></ellipsoid>", [1, 2, 3]),
        ("<cone><radius>2</radius><length>3</length></cone>", [2, 2, 1.5]),
    ],
)
def test_round_shapes(tmp_path: Path, geometry: str, half: list[float]) -> None:
    link = f'<link name="l">{collision(f"<geometry>{geometry}</geometry>")}</link>'
    np.testing.assert_allclose(box(read(tmp_path, world(model(link))))[1], half, rtol=0.005)


def test_a_polyline_stands_on_its_outline(tmp_path: Path) -> None:
    points = "".join(f"<point>{x} {y}</point>" for x, y in ((0, 0), (3, 0), (3, 1), (1, 1), (1, 2), (0, 2)))
    shape = f"<geometry><polyline>{points}<height>2.5</height></polyline></geometry>"
    content = read(tmp_path, world(model(f'<link name="l">{collision(shape)}</link>')))
    check_box(content, [0, 0, 0], [3, 2, 2.5])
    assert area_and_volume(content)[1] == pytest.approx(4.0 * 2.5)


def test_poses_are_nested_roll_pitch_yaw_about_fixed_axes(tmp_path: Path) -> None:
    half_turn = "1.5707963267948966"
    link = (
        f'<link name="l"><pose>0 0 3 0 0 {half_turn}</pose>'
        + collision(pose=f"<pose>1 0 0 {half_turn} 0 0</pose>")
        + "</link>"
    )
    content = read(tmp_path, world(model(link, pose="<pose>10 0 0 0 0 0</pose>")))
    # the box 2 4 6 rolled is 2 6 4, moved 1 along x, turned: 6 2 4 about (10, 1, 3)
    check_box(content, [7, 0, 1], [13, 2, 5])
    yawed = "<pose>0 0 0 0.3 -0.2 0.5</pose>"
    c, s = np.cos([0.3, -0.2, 0.5]), np.sin([0.3, -0.2, 0.5])
    roll = np.array([[1, 0, 0], [0, c[0], -s[0]], [0, s[0], c[0]]])
    pitch = np.array([[c[1], 0, s[1]], [0, 1, 0], [-s[1], 0, c[1]]])
    yaw = np.array([[c[2], -s[2], 0], [s[2], c[2], 0], [0, 0, 1]])
    turned = read(tmp_path, world(model(pose=yawed))).vertices
    straight = read(tmp_path, world(model())).vertices
    np.testing.assert_allclose(turned, straight @ (yaw @ pitch @ roll).T, atol=1e-12)
    degrees = '<pose degrees="true">0 0 0 0 0 90</pose>'
    check_box(read(tmp_path, world(model(pose=degrees))), [-2, -1, -3], [2, 1, 3])
    quaternion = '<pose rotation_format="quat_xyzw">0 0 0 0 0 0.5 0.5</pose>'
    check_box(read(tmp_path, world(model(pose=quaternion))), [-2, -1, -3], [2, 1, 3])


def test_poses_may_be_relative_to_what_stands_beside_them(tmp_path: Path) -> None:
    frames = (
        '<frame name="f"><pose relative_to="g">1 0 0 0 0 0</pose></frame>'
        '<frame name="g"><pose>0 5 0 0 0 0</pose></frame>'
    )
    content = read(tmp_path, world(frames + model(pose='<pose relative_to="f">0 0 7 0 0 0</pose>')))
    check_box(content, [0, 3, 4], [2, 7, 10])
    turned = frames.replace("0 5 0 0 0 0", "0 5 0 0 0 1.5707963267948966")  # what is ahead of it lies at y
    content = read(tmp_path, world(turned + model(pose='<pose relative_to="f">0 0 7 0 0 0</pose>')))
    check_box(content, [-2, 5, 4], [2, 7, 10])
    with pytest.raises(WorldError, match="relative to 'nothing'"):
        read(tmp_path, world(model(pose='<pose relative_to="nothing">0 0 7 0 0 0</pose>')))
    circle = '<frame name="f"><pose relative_to="g"/></frame><frame name="g"><pose relative_to="f"/></frame>'
    with pytest.raises(WorldError, match="relative to"):
        read(tmp_path, world(circle + model(pose='<pose relative_to="f"/>')))


def test_a_plane_ends_where_the_rest_does(tmp_path: Path) -> None:
    shape = collision("<geometry><plane><size>100 100</size></plane></geometry>")
    plane = f'<link name="l">{shape}</link>'
    content = read(tmp_path, world(model() + model(plane, "ground", pose="<pose>3 0 -3.5 0 0 0</pose>")))
    check_box(content, [-1, -2, -3.5], [1, 2, 3])
    wall = plane.replace("<plane>", "<plane><normal>0 -1 0</normal>")
    content = read(tmp_path, world(model() + model(wall, "wall", pose="<pose>0 9 0 0 0 0</pose>")))
    check_box(content, [-1, -2, -3], [1, 9, 3])
    normal = np.cross(*np.diff(content.vertices[content.triangles[-1]], axis=0))
    assert normal[1] < 0.0
    with pytest.raises(WorldError, match="no collision shapes but planes"):
        read(tmp_path, world(model(plane)))


def folder_of_models(folder: Path) -> Path:
    """Models beside worlds/: a chair of a mesh in cm, scaled and moved; a set of two chairs."""
    chair = "<mesh><uri>model://chair/meshes/chair.dae</uri><scale>1 2 3</scale></mesh>"
    link = f'<link name="l">{collision(f"<geometry>{chair}</geometry>")}</link>'
    pose = "<pose>100 0 0 0 0 0</pose>"
    (folder / "models" / "chair" / "meshes").mkdir(parents=True)
    (folder / "models" / "set").mkdir()
    mesh = dae(asset='<unit meter="0.01"/><up_axis>Y_UP</up_axis>')  # Gazebo passes over the axis
    (folder / "models" / "chair" / "meshes" / "chair.dae").write_text(mesh)
    (folder / "models" / "chair" / "old.sdf").write_text("<sdf/>")
    (folder / "models" / "chair" / "new.sdf").write_text(f"<sdf>{model(link, pose=pose)}</sdf>")
    config = '<model><sdf version="1.10">new.sdf</sdf><sdf version="1.9">old.sdf</sdf></model>'
    (folder / "models" / "chair" / "model.config").write_text(config)
    chair = "<include><uri>model://chair</uri>{}</include>"
    both = chair.format("") + chair.format("<pose>1 0 0 0 0 0</pose>")
    (folder / "models" / "set" / "model.sdf").write_text(f"<sdf>{model(both)}</sdf>")
    return folder / "worlds" / "w.world"


def test_models_are_found_beside_the_world_and_placed_by_the_include(tmp_path: Path) -> None:
    path = folder_of_models(tmp_path)
    chair = "<include><uri>model://chair</uri>{}</include>"
    content = read(path.parent, world(chair.format("")))
    check_box(content, [100, 0, 0], [100.01, 0.02, 0.03])  # the model's own pose
    content = read(path.parent, world(chair.format("<pose>0 0 1 0 0 0</pose>")))
    check_box(content, [0, 0, 1], [0.01, 0.02, 1.03])  # the include's in its place
    content = read(
        path.parent,
        world(model("<include><uri>model://set</uri></include>", pose="<pose>0 0 5 0 0 0</pose>")),
    )
    check_box(content, [1, 0, 5], [100.01, 0.02, 5.03])
    assert content.triangles.shape == (24, 3)
    inside = tmp_path / "models" / "chair"
    assert set(formats.files(path)) == {
        path,
        tmp_path / "models" / "set" / "model.sdf",
        inside / "new.sdf",
        inside / "meshes" / "chair.dae",
    }
    (inside / "meshes" / "chair.dae").write_text("<COLLADA/>")
    with pytest.raises(WorldError, match=r"chair\.dae holds no triangles"):
        formats.read(path, formats.Options())


def test_meshes_of_other_kinds_and_places(tmp_path: Path) -> None:
    (tmp_path / "cube.STL").write_bytes(binary())
    for uri in ("cube.STL", "file://cube.STL", str(tmp_path / "cube.STL"), f"file://{tmp_path}/cube.STL"):
        mesh = f"<geometry><mesh><uri>{uri}</uri><scale>-1 1 1</scale></mesh></geometry>"
        content = read(tmp_path, world(model(f'<link name="l">{collision(mesh)}</link>')))
        check_box(content, [-1, 0, 0], [0, 1, 1])
        assert area_and_volume(content)[1] == pytest.approx(1.0)  # mirrored, and still turned outward


def test_what_was_not_read_is_named(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.stl")
    pipe = collision("<geometry><mesh><uri>pipe.stl</uri></mesh></geometry>")
    terrain = collision("<geometry><heightmap><uri>hills.png</uri></heightmap></geometry>")
    seen = '<link name="l"><visual name="v"><geometry/></visual></link>'
    text = world(
        model(static="")
        + model(f'<link name="l">{pipe}{terrain}</link>', "hills")
        + model(seen, "picture")
        + model(name="robot", inner=f'<plugin name="p"/><link name="l">{collision()}</link>')
        + model(name="lost", pose="<pose>0 0 400000 0 0 0</pose>")
        + "".join(f"<include><uri>model://{name}_</uri></include>" for name in "abcdefg")
        + "<include><uri>https://fuel.gazebosim.org/1.0/openrobotics/models/Sun</uri></include>"
        + '<actor name="walker"/>'
    )
    content = read(tmp_path, text)
    assert set(content.warnings) == {
        "models that are not static stand where the file puts them: m",
        "meshes were not found beside the world or above it, and are missing: pipe.stl",
        "shapes of the kind heightmap were not read: hills",
        "models that are seen but collide with nothing were not read: picture",
        "models with plugins, which may move them, stand still: robot",
        "models farther than 10000 m from the others were not read: lost",
        "models were not found beside the world or above it, and are missing: a_, b_, c_, d_, e_ and 2 more",
        "elements of the kind actor were not read: walker",
    }
    with pytest.raises(WorldError, match=r"holds nothing solid: models were not found .*: a_$"):
        read(tmp_path, world("<include><uri>model://a_</uri></include>"))


def test_gazebo_s_own_ground_plane_needs_no_file(tmp_path: Path) -> None:
    ground = "<include><uri>model://ground_plane</uri><pose>0 0 -9 0 0 0</pose></include>"
    check_box(read(tmp_path, world(model() + ground)), [-1, -2, -9], [1, 2, 3])


def test_the_state_of_a_saved_world_is_where_things_stand(tmp_path: Path) -> None:
    state = '<state><model name="m"><pose>0 0 50 0 0 0</pose></model></state>'
    check_box(read(tmp_path, world(model() + state)), [-1, -2, 47], [1, 2, 53])
    links = state.replace("</pose>", '</pose><link name="l"><pose>0 0 60 0 0 0</pose></link>')
    check_box(read(tmp_path, world(model() + links)), [-1, -2, 57], [1, 2, 63])
    scaled = read(tmp_path, world(model() + state.replace("<pose>", "<scale>1 1 2</scale><pose>")))
    assert scaled.warnings == ("models that the saved state scales stand unscaled: m",)
    assert (
        read(tmp_path, world(model() + state.replace("<pose>", "<scale>1 1 1</scale><pose>"))).warnings == ()
    )


def test_a_model_alone_is_read(tmp_path: Path) -> None:
    check_box(read(tmp_path, f"<sdf>{model()}</sdf>", "model.sdf"), [-1, -2, -3], [1, 2, 3])


def test_an_attribute_without_a_value_passes_as_in_gazebo(tmp_path: Path) -> None:
    content = read(tmp_path, world(model(pose="<pose frame=>0 0 1 0 0 0</pose>")))
    check_box(content, [-1, -2, -2], [1, 2, 4])


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("<world/>", "its root is world, sdf is needed"),
        ("<sdf><world>", "no XML"),
        (world(""), "nothing solid"),
        (world(model(pose="<pose>1 2 3</pose>")), "6 numbers needed, 3 found"),
        (world(model(pose="<pose>1 2 x 0 0 0</pose>")), "holds 'x'"),
        (world(model(pose="<pose>1 2 nan 0 0 0</pose>")), "NaN"),
        (world(model(pose='<pose rotation_format="quat_xyzw">0 0 0 0 0 0 0</pose>')), "quaternion"),
        (world(model()).replace("2 4 6", "2 4"), "3 numbers needed, 2 found"),
        (world(model()).replace("<size>2 4 6</size>", "<size>1e999 1 1</size>"), "NaN"),
    ],
)
def test_a_damaged_world(tmp_path: Path, text: str, word: str) -> None:
    with pytest.raises(WorldError, match=word):
        read(tmp_path, text)


def test_models_in_themselves_end_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "models" / "a").mkdir(parents=True)
    twice = "<include><uri>model://a</uri></include>" * 2
    (tmp_path / "models" / "a" / "model.sdf").write_text(f"<sdf>{model(twice)}</sdf>")
    monkeypatch.setattr(sdf_scene, "MAX_MODELS", 1000)
    with pytest.raises(WorldError, match="places more than 1000 models"):
        read(tmp_path, world(twice))


@settings(max_examples=100, deadline=None)
@given(damage=DAMAGES)
def test_damage_ends_in_content_or_one_line(damage: tuple[float, list[tuple[float, bytes]]]) -> None:
    check_ends_well("m.world", damaged(world(model(pose="<pose>1 2 3 0 0 1</pose>") * 3).encode(), damage))


@pytest.mark.skipif(not SHARED.is_dir(), reason=f"no third-party worlds in {SHARED}")
@pytest.mark.parametrize("name", ["cerlab_building_2f/orig/building_2f", "cerlab_floorplan1/orig/floorplan1"])
def test_the_walls_stand_where_others_put_them(name: str) -> None:
    from uavexp.o3d import open3d

    content = formats.read(SHARED / "worlds" / f"{name}_static.world", formats.Options())
    other = formats.read(SHARED / "worlds" / name.split("/")[0] / "mesh.ply", formats.Options())
    scene = open3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        open3d.core.Tensor(other.vertices.astype(np.float32)),
        open3d.core.Tensor(other.triangles.astype(np.uint32)),
    )
    distance = scene.compute_distance(open3d.core.Tensor(content.vertices.astype(np.float32))).numpy()
    assert distance.max() < 0.02
    assert box(content)[1][2] == box(other)[1][2]


@pytest.mark.skipif(not SHARED.is_dir(), reason=f"no third-party worlds in {SHARED}")
def test_a_whole_shop_and_barn_are_read() -> None:
    shop = formats.read(SHARED / "gazebo/bookstore/worlds/bookstore.world", formats.Options())
    np.testing.assert_allclose(np.ptp(shop.vertices, axis=0), [15.7, 14.6, 3.7], atol=0.05)
    assert (
        len(formats.files(SHARED / "gazebo/bookstore/worlds/bookstore.world")) == 1 + 26 + 25
    )  # two more stand in a comment
    assert [text.split(":")[0] for text in shop.warnings] == [
        "meshes were not found beside the world or above it, and are missing",  # named in another case
        "models farther than 10000 m from the others were not read",  # a book at z = 343,583 m
    ]
    for file in SHARED.glob("gazebo/barn/*.world"):
        content = formats.read(file, formats.Options())
        assert "models with plugins" in content.warnings[0]
    for file in SHARED.glob("gazebo/barn/static/*.world"):
        content = formats.read(file, formats.Options())
        cylinders = file.read_text().count("<collision") - 1
        assert content.triangles.shape[0] == cylinders * 4 * 48 + 2  # and the ground
