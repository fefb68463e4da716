"""Dxf and wkt plans: surfaces whose area and volume are known, drawings of JuPedSim."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.folders import SHARED
from tests.formats import only_world_errors
from uavexp.errors import WorldError
from uavexp.formats import Content, Options, read

ezdxf = pytest.importorskip("ezdxf")
shapely = pytest.importorskip("shapely")
HEIGHT = 2.0
PLANS = SHARED / "floorplans" / "jupedsim"


def volume(content: Content) -> float:
    """By the divergence theorem; that of a closed surface whose normals point out of it."""
    a, b, c = content.vertices[content.triangles].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def is_closed(content: Content) -> bool:
    """Whether every edge is run along as often one way as the other."""
    ends = content.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    size = len(content.vertices)
    return bool((np.sort(ends @ [size, 1]) == np.sort(ends @ [1, size])).all())


def areas(content: Content) -> tuple[float, float]:
    """Of the walls, and of floor and ceiling."""
    corners = content.vertices[content.triangles]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(cross, axis=1)
    level = np.ptp(corners[:, :, 2], axis=1) == 0.0
    return float(area[~level].sum()), float(area[level].sum())


ROOM = "POLYGON ((0 0, 10 0, 10 8, 0 8, 0 0), (2 2, 3 2, 3 3, 2 3, 2 2))"  # 80 less 1
HALL = "POLYGON ((10 3, 10 5, 14 5, 14 3, 10 3))"  # the other way round, at the room's edge


@pytest.mark.parametrize(
    ("text", "area"),
    [
        (ROOM, 79.0),
        (ROOM.lower(), 79.0),
        (f"GEOMETRYCOLLECTION ({ROOM}, {HALL})", 87.0),
        (f"GEOMETRYCOLLECTION (GEOMETRYCOLLECTION ({ROOM}), LINESTRING (0 0, 1 1))", 79.0),
        (f"MULTIPOLYGON ({ROOM[8:]}, {HALL[8:]})", 87.0),
        (f"{ROOM}\n\n# the way in\n{HALL}\n", 87.0),
        (f"SRID=25832;{ROOM}", 79.0),
        (f"GEOMETRYCOLLECTION ({ROOM}, POLYGON ((9 3, 14 3, 14 5, 9 5, 9 3)))", 87.0),  # overlapping
        ("POLYGON Z ((0 0 7, 4 0 7, 4 2 7, 0 0 7))", 4.0),
        ("POLYGON ((0 0, 2 2, 2 0, 0 2, 0 0))", 2.0),  # crosses itself
        (f"GEOMETRYCOLLECTION ({ROOM}, POLYGON ((20 0, 21 0, 21 1, 20 1, 20 0)))", 80.0),  # apart
    ],
)
def test_a_walkable_area_is_a_closed_surface(tmp_path: Path, text: str, area: float) -> None:
    (tmp_path / "a.wkt").write_text(text)
    content = read(tmp_path / "a.wkt", Options(wall_height_m=HEIGHT))
    assert is_closed(content)
    assert volume(content) == pytest.approx(area * HEIGHT)
    assert np.unique(content.vertices[:, 2]).tolist() == [0.0, HEIGHT]


@pytest.mark.skipif(not PLANS.is_dir(), reason=f"no {PLANS}")
@pytest.mark.parametrize("path", sorted(PLANS.glob("**/*.wkt")), ids=lambda path: path.stem)
def test_published_areas_are_whole(path: Path) -> None:
    area = shapely.from_wkt(path.read_text())
    content = read(path, Options(wall_height_m=HEIGHT))
    assert is_closed(content)
    assert volume(content) == pytest.approx(shapely.union_all(list(area.geoms)).area * HEIGHT, rel=1e-9)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        (ROOM[:-4], "truncated"),
        ("POINT (1 2)", "no polygon"),
        ("POLYGON EMPTY", "no polygon"),
        ("POLYGON ((0 0, 1 0, 2 0, 0 0))", "no polygon"),
        ("POLYGON ((0 0, 1 nan, 1 1, 0 0))", "finite|wkt"),
        ("POLYGON ((0 0, 1e300 0, 1 1, 0 0))", "finite"),
        ("this is no plan", "no wkt"),
        ("POLYGON 0 0)", "brackets"),
        ("GEOMETRYCOLLECTION (" * 100_000 + ROOM + ")" * 100_000, "brackets"),
    ],
)
def test_other_text_is_one_line(tmp_path: Path, text: str, word: str) -> None:
    (tmp_path / "a.wkt").write_text(text)
    with pytest.raises(WorldError, match=word) as error:
        read(tmp_path / "a.wkt", Options())
    assert "\n" not in str(error.value)


def drawn(path: Path, draw: Callable[..., object], unit: int = 6, form: str = "asc") -> Path:
    document = ezdxf.new()
    document.header["$INSUNITS"] = unit
    for name in ("walls", "doors"):
        document.layers.add(name)
    draw(document)
    document.saveas(path, fmt=form)
    return path


def square(document: object) -> None:
    corners = [(0, 0), (6, 0), (6, 4), (0, 4)]
    document.modelspace().add_lwpolyline(corners, close=True, dxfattribs={"layer": "walls"})  # type: ignore[attr-defined]


def lines(document: object) -> None:
    for one, other in (((0, 0), (6, 0)), ((6, 0), (6, 4)), ((6, 4), (0, 4)), ((0, 4), (0, 0))):
        document.modelspace().add_line(one, other, dxfattribs={"layer": "walls"})  # type: ignore[attr-defined]


def old_polyline(document: object) -> None:
    corners = [(0, 0, 9), (6, 0, 9), (6, 4, 9), (0, 4, 9)]
    document.modelspace().add_polyline2d([c[:2] for c in corners], close=True)  # type: ignore[attr-defined]


def blocks(document: object) -> None:
    block = document.blocks.new("side")  # type: ignore[attr-defined]
    block.add_line((0, 0), (1, 0))
    inner = document.blocks.new("corner")  # type: ignore[attr-defined]
    inner.add_blockref("side", (0, 0), dxfattribs={"xscale": 6})
    inner.add_blockref("side", (0, 0), dxfattribs={"xscale": 4, "rotation": 90})
    space = document.modelspace()  # type: ignore[attr-defined]
    space.add_blockref("corner", (0, 0), dxfattribs={"layer": "walls"})
    space.add_blockref("corner", (6, 4), dxfattribs={"layer": "walls", "rotation": 180})


@pytest.mark.parametrize("form", ["asc", "bin"])
@pytest.mark.parametrize("draw", [square, lines, old_polyline, blocks])
def test_walls_stand_on_every_kind_of_line(tmp_path: Path, draw: Callable[..., object], form: str) -> None:
    content = read(drawn(tmp_path / "a.DXF", draw, form=form), Options(wall_height_m=HEIGHT))
    assert areas(content) == pytest.approx((20 * HEIGHT, 2 * 24))
    assert content.warnings == ()


def test_arcs_bend_as_drawn(tmp_path: Path) -> None:
    def draw(document: object) -> None:
        space = document.modelspace()  # type: ignore[attr-defined]
        space.add_circle((0, 0), 2)
        space.add_arc((0, 0), 1, 0, 90)
        space.add_lwpolyline([(-3, 0, 0, 0, 1.0), (3, 0)])  # half a circle by its bulge

    content = read(drawn(tmp_path / "a.dxf", draw), Options(wall_height_m=HEIGHT))
    assert areas(content)[0] == pytest.approx(HEIGHT * np.pi * (4 + 0.5 + 3), rel=0.002)
    reach = np.linalg.norm(content.vertices[:, :2], axis=1)
    assert reach.max() == pytest.approx(np.hypot(3, 3))  # the corner of the floor
    assert content.vertices[:, 1].min() == pytest.approx(-3.0, abs=0.003)


def test_layers_are_chosen_and_others_told(tmp_path: Path) -> None:
    def draw(document: object) -> None:
        square(document)
        space = document.modelspace()  # type: ignore[attr-defined]
        space.add_line((1, 1), (3, 1), dxfattribs={"layer": "doors"})
        space.add_line((3, 3), (5, 3), dxfattribs={"layer": "loose"})  # in no table
        space.add_text("way in", dxfattribs={"layer": "walls"})
        document.layers.add("old").off()  # type: ignore[attr-defined]
        space.add_line((1, 1), (3, 3), dxfattribs={"layer": "old"})

    path = drawn(tmp_path / "a.dxf", draw, unit=4)
    content = read(path, Options(wall_height_m=HEIGHT))
    assert areas(content)[0] == pytest.approx(24 * HEIGHT * 1000)
    assert content.unit_m == 0.001
    told = "; ".join(content.warnings)
    assert "doors (1), loose (1), walls (1)" in told
    assert "1 TEXT" in told
    assert "1 on layer old" in told
    chosen = read(path, Options(wall_height_m=HEIGHT, layers=("Walls",), unit_m=0.01))
    assert areas(chosen)[0] == pytest.approx(20 * HEIGHT * 100)
    assert chosen.warnings == ("left out: 1 TEXT",)
    with pytest.raises(WorldError, match=r"no layer windows; its layers are .*walls"):
        read(path, Options(layers=("windows",)))


def test_blocks_that_hold_themselves_or_multiply_are_one_line(tmp_path: Path) -> None:
    def loop(document: object) -> None:
        document.blocks.new("a").add_blockref("b", (0, 0))  # type: ignore[attr-defined]
        document.blocks.new("b").add_blockref("a", (1, 0))  # type: ignore[attr-defined]
        document.modelspace().add_blockref("a", (0, 0))  # type: ignore[attr-defined]

    def rows(document: object) -> None:
        document.blocks.new("a").add_line((0, 0), (1, 0))  # type: ignore[attr-defined]
        attributes = {"row_count": 32000, "column_count": 32000, "row_spacing": 1, "column_spacing": 1}
        document.modelspace().add_blockref("a", (0, 0), dxfattribs=attributes)  # type: ignore[attr-defined]

    for draw in (loop, rows):
        with pytest.raises(WorldError, match=r"blocks|unpacks|no LINE"):
            read(drawn(tmp_path / "a.dxf", draw), Options())


def test_drawings_without_walls_or_end_are_one_line(tmp_path: Path) -> None:
    path = drawn(tmp_path / "a.dxf", lambda document: document.modelspace().add_point((0, 0)))
    with pytest.raises(WorldError, match="holds no LINE"):
        read(path, Options())
    whole = drawn(path, square).read_bytes()
    for length in (100, len(whole) // 2, len(whole) - 8):
        path.write_bytes(whole[:length])
        with pytest.raises(WorldError, match="truncated"):
            read(path, Options())


@pytest.mark.skipif(not PLANS.is_dir(), reason=f"no {PLANS}")
@pytest.mark.parametrize("path", sorted(PLANS.glob("dxf/*.dxf")), ids=lambda path: path.stem)
def test_published_drawings_have_as_long_walls_as_their_lines(path: Path) -> None:
    space = ezdxf.readfile(path).modelspace()
    layers = {
        e.dxf.layer
        for e in space.query("LINE LWPOLYLINE")
        if "walkable" in e.dxf.layer or "obstacles" in e.dxf.layer
    }
    length = 0.0
    for entity in space.query("LINE LWPOLYLINE"):
        if entity.dxf.layer in layers:
            points = (
                [entity.dxf.start, entity.dxf.end] if entity.dxftype() == "LINE" else entity.get_points("xy")
            )
            points = np.array([tuple(point)[:2] for point in points])
            closed = entity.dxftype() == "LWPOLYLINE" and entity.closed
            length += np.linalg.norm(
                np.diff(points, axis=0, append=points[:1] if closed else points[-1:]), axis=1
            ).sum()
    content = read(path, Options(wall_height_m=1.0, unit_m=1.0, layers=tuple(layers)))
    assert areas(content)[0] == pytest.approx(length, rel=0.01)


@settings(max_examples=25, deadline=None)
@given(place=st.integers(0), byte=st.integers(0, 255), name=st.sampled_from(["a.dxf", "a.wkt"]))
def test_damaged_bytes_end_in_one_line(
    tmp_path_factory: pytest.TempPathFactory, place: int, byte: int, name: str
) -> None:
    path = tmp_path_factory.mktemp("plan") / name
    if name == "a.dxf":
        drawn(path, blocks)
    else:
        path.write_text(f"GEOMETRYCOLLECTION ({ROOM}, {HALL})")
    only_world_errors(path, place, byte)
