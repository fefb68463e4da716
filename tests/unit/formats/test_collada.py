"""COLLADA files: every kind of faces and nodes gives the same cube, and damage is one line."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings

from tests.collada_files import NODE, dae, fans, inputs, polygons, polylist, strips, triangles
from tests.damage import DAMAGES, check_ends_well, damaged
from tests.folders import SHARED
from tests.shaped_meshes import area_and_volume, check_is_cube
from uavexp import formats
from uavexp.errors import WorldError
from uavexp.formats import Content, collada


def read(folder: Path, text: str | bytes) -> Content:
    path = folder / "cube.dae"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return formats.read(path, formats.Options())


@pytest.mark.parametrize("step", [1, 3])
@pytest.mark.parametrize("faces", [triangles, polylist, polygons, strips, fans])
def test_faces_of_every_kind(tmp_path: Path, faces: Callable[[int], str], step: int) -> None:
    content = read(tmp_path, dae(faces(step)))
    check_is_cube(content)
    assert (content.kind, content.warnings) == ("dae mesh", ())


def test_encodings_and_namespaces(tmp_path: Path) -> None:
    check_is_cube(read(tmp_path, dae().replace("utf-8", "utf-16").encode("utf-16")))
    check_is_cube(read(tmp_path, b"\xef\xbb\xbf" + dae().encode()))
    check_is_cube(read(tmp_path, dae().replace("http://www.collada.org/2005/11/COLLADASchema", "other")))


def test_unit_and_axis_are_named_and_not_applied(tmp_path: Path) -> None:
    content = read(tmp_path, dae(asset='<unit meter="0.0254" name="inch"/><up_axis> Z_UP </up_axis>'))
    check_is_cube(content)
    assert (content.unit_m, content.up_axis) == (0.0254, "z")
    content = read(tmp_path, dae())  # the standard's defaults
    assert (content.unit_m, content.up_axis) == (1.0, "y")


def test_nodes_stand_where_their_transforms_put_them_in_order(tmp_path: Path) -> None:
    nodes = """<node><translate>10 0 0</translate><rotate>0 0 2 90</rotate>
      <node><scale>2 1 1</scale><instance_geometry url="#cube"/></node>
      <node><matrix>-1 0 0 0 0 1 0 0 0 0 1 5 0 0 0 1</matrix><instance_node url="#kept"/></node></node>"""
    kept = f'<library_nodes><node id="kept">{NODE}</node></library_nodes>'
    content = read(tmp_path, dae(nodes=nodes, libraries=kept))
    low = content.vertices[content.vertices[:, 2] < 2.0]
    high = content.vertices[content.vertices[:, 2] > 2.0]
    np.testing.assert_allclose([low.min(0), low.max(0)], [[9, 0, 0], [10, 2, 1]], atol=1e-12)
    np.testing.assert_allclose([high.min(0), high.max(0)], [[9, -1, 5], [10, 0, 6]], atol=1e-12)
    assert area_and_volume(content) == pytest.approx((6.0 + 10.0, 1.0 + 2.0))  # both turned outward


def test_a_skin_stands_as_modelled_with_a_word(tmp_path: Path) -> None:
    skin = '<library_controllers><controller id="c"><skin source="#cube"/></controller></library_controllers>'
    content = read(tmp_path, dae(nodes='<node><instance_controller url="#c"/></node>', libraries=skin))
    check_is_cube(content)
    assert content.warnings == ("skins and morphs stand as they were modelled, not posed",)


def test_what_is_no_face_is_named(tmp_path: Path) -> None:
    lines = f'<lines count="1">{inputs()}<p>0 1</p></lines>'
    content = read(tmp_path, dae(triangles() + lines + '<triangles count="0">' + inputs() + "</triangles>"))
    check_is_cube(content)
    assert content.warnings == ("lines were not read",)


def test_without_a_scene_all_shapes_are_read(tmp_path: Path) -> None:
    check_is_cube(read(tmp_path, dae().replace("<scene>", "<extra>").replace("</scene>", "</extra>")))


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ("COLLADA", "COLLADO", "no COLLADA"),
        ("</COLLADA>", "", "no XML"),
        ("<asset>", "<assert>", "no XML"),
        ('encoding="utf-8"', 'encoding="utf-99"', "no XML"),
        ('<float_array id="a" count="24">', '<float_array id="a" count="27">', "promises 27 numbers"),
        ('count="8"', 'count="9"', "accessor of 9 positions"),
        ('count="8"', 'count="-8"', "accessor of -8 positions"),
        ('count="8"', 'count="1e400"', "an index belongs"),
        ('count="8"', 'count="7"', "vertex 7 of 7"),
        ('stride="3"', 'stride="2"', "damaged"),
        ('stride="3"', 'stride="three"', "holds 'three'"),
        ('triangles count="12"', 'triangles count="13"', "promises 13 faces, 12 with 36"),
        ('offset="0"', 'offset="-1"', "offset -1"),
        ('offset="0"', 'offset="4"', "not by 5"),
        ('source="#v"', 'source="#w"', "names '#w', which is no vertices or source of it"),
        ('source="#v"', 'source="w"', "names 'w', which is no"),
        ('url="#s"', 'url="#cube"', "which is no visual_scene"),
        ('url="#s"', 'url="other.dae#s"', "names 'other.dae#s'"),
        ("<asset>", '<asset><unit meter="0"/>', "its unit is 0.0 m"),
        ('semantic="POSITION"', 'semantic="NORMAL"', "no POSITION"),
        ('semantic="VERTEX"', 'semantic="NORMAL"', "no VERTEX"),
        ("<node>", "<node><lookat>0 0 0 1 0 0 0 0 1</lookat>", "lookat, which is not supported"),
        ("<node>", "<node><translate>1 2</translate>", "3 numbers needed, 2 found"),
        ("<node>", "<node><scale>nan 1 1</scale>", "NaN"),
        ("0 0 0 0 0 1", "0 0 x 0 0 1", "holds 'x'"),
        ("<asset>", '<!DOCTYPE a [<!ENTITY b "c">]><asset>', "no XML"),
    ],
)
def test_a_damaged_file(tmp_path: Path, old: str, new: str, word: str) -> None:
    text = dae()
    assert old in text
    with pytest.raises(WorldError, match=word):
        read(tmp_path, text.replace(old, new))


def test_entities_and_endless_nodes_end_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    entities = '<!DOCTYPE a [<!ENTITY a "bbbbbbbb"><!ENTITY c "&a;&a;&a;&a;">]><COLLADA>&c;</COLLADA>'
    with pytest.raises(WorldError, match="declares a document type"):
        read(tmp_path, entities)
    outer = '<!DOCTYPE a SYSTEM "/etc/passwd"><COLLADA/>'
    with pytest.raises(WorldError, match="declares a document type"):
        read(tmp_path, outer.encode("utf-16"))
    with pytest.raises(WorldError, match="nests more than 200"):
        read(tmp_path, "<a>" * 100_000)
    monkeypatch.setattr(collada, "MAX_NODES", 1000)
    circle = '<node id="n"><instance_node url="#n"/></node>'
    with pytest.raises(WorldError, match="places more than 1000 nodes"):
        read(tmp_path, dae(nodes=circle))
    controllers = (
        '<library_controllers><controller id="c"><skin source="#c"/></controller></library_controllers>'
    )
    with pytest.raises(WorldError, match="moves nothing"):
        read(tmp_path, dae(nodes='<node><instance_controller url="#c"/></node>', libraries=controllers))


@settings(max_examples=150, deadline=None)
@given(damage=DAMAGES)
def test_damage_ends_in_content_or_one_line(damage: tuple[float, list[tuple[float, bytes]]]) -> None:
    check_ends_well("m.dae", damaged(dae(polylist(2)).encode(), damage))


FILES = sorted(SHARED.glob("gazebo/*/models/*/meshes/*.DAE"))


@pytest.mark.skipif(not FILES, reason=f"no third-party worlds in {SHARED}")
@pytest.mark.filterwarnings("ignore::PendingDeprecationWarning", "ignore::DeprecationWarning")
def test_pycollada_reads_the_same_of_a_shop() -> None:
    pycollada = pytest.importorskip("collada")

    for file in FILES:
        content = formats.read(file, formats.Options())
        bound = [
            shape
            for item in pycollada.Collada(str(file)).scene.objects("geometry")
            for shape in item.primitives()
        ]
        faces = [item if hasattr(item, "ntriangles") else item.triangleset() for item in bound]
        other = np.concatenate([item.vertex[item.vertex_index] for item in faces])
        np.testing.assert_allclose(content.vertices[content.triangles], other, rtol=1e-5, atol=1e-4)
