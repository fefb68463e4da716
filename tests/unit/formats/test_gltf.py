"""GLTF files: every way to store a cube is the same cube, and damage is one line."""

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings

from tests.damage import DAMAGES, check_ends_well, damaged
from tests.folders import DATA, SHARED
from tests.shaped_meshes import CUBE, TRIANGLES, area_and_volume, check_is_cube
from uavexp import formats
from uavexp.errors import WorldError
from uavexp.formats import Content

Json = dict[str, Any]
TYPES = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}


def scene(
    positions: np.ndarray = CUBE,
    number: str = "f4",
    index: str | None = "u2",
    corners: np.ndarray = TRIANGLES,
) -> tuple[Json, bytes]:
    """A cube's json and its buffer."""
    accessors = [(positions, number, "VEC3")]
    if index is None:
        accessors = [(positions[corners.reshape(-1)], number, "VEC3")]
    else:
        accessors.append((corners.reshape(-1, 1), index, "SCALAR"))
    data, views, described = b"", [], []
    for values, type_, shape in accessors:
        part = values.astype("<" + type_).tobytes()
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(part)})
        described.append(
            {"bufferView": len(views) - 1, "componentType": TYPES[type_], "count": len(values), "type": shape}
        )
        data += part.ljust(-(-len(part) // 4) * 4, b"\0")
    primitive: Json = {"attributes": {"POSITION": 0}} | ({} if index is None else {"indices": 1})
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [primitive]}],
        "accessors": described,
        "bufferViews": views,
        "buffers": [{"byteLength": len(data)}],
    }, data


def glb(document: Json, data: bytes, pad: bool = True) -> bytes:
    text = json.dumps(document).encode()
    text = text.ljust(-(-len(text) // 4) * 4 + (0 if pad else 3), b" ")
    chunks = len(text).to_bytes(4, "little") + b"JSON" + text
    chunks += len(data).to_bytes(4, "little") + b"BIN\0" + data
    return b"glTF" + (2).to_bytes(4, "little") + (12 + len(chunks)).to_bytes(4, "little") + chunks


def read(folder: Path, data: bytes, name: str = "cube.glb") -> Content:
    (folder / name).write_bytes(data)
    return formats.read(folder / name, formats.Options())


@pytest.mark.parametrize("number", TYPES)
@pytest.mark.parametrize("index", ["u1", "u2", "u4", None])
def test_numbers_of_every_type(tmp_path: Path, number: str, index: str | None) -> None:
    content = read(tmp_path, glb(*scene(number=number, index=index)))
    check_is_cube(content)
    assert content.kind == "glb mesh"


@pytest.mark.parametrize("number", ["i1", "u1", "i2", "u2"])
def test_normalised_numbers_are_shares_of_the_greatest(tmp_path: Path, number: str) -> None:
    document, data = scene(CUBE * np.iinfo(number).max, number)
    document["accessors"][0]["normalized"] = True
    check_is_cube(read(tmp_path, glb(document, data)))


def test_buffers_in_the_file_beside_it_and_in_the_text(tmp_path: Path) -> None:
    document, data = scene()
    check_is_cube(read(tmp_path, glb(document, data, pad=False)))
    document["buffers"][0]["uri"] = "a%20b.bin"
    with pytest.raises(WorldError, match=r"needs its buffer .*a b\.bin, which is no file"):
        read(tmp_path, json.dumps(document).encode(), "cube.gltf")
    (tmp_path / "a b.bin").write_bytes(data)
    check_is_cube(read(tmp_path, json.dumps(document).encode(), "cube.gltf"))
    assert formats.files(tmp_path / "cube.gltf") == (tmp_path / "cube.gltf", tmp_path / "a b.bin")
    (tmp_path / "a b.bin").write_bytes(data[:-1])
    with pytest.raises(WorldError, match="buffer 0 promises 168 bytes, 167 found"):
        read(tmp_path, json.dumps(document).encode(), "cube.gltf")
    document["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    check_is_cube(read(tmp_path, json.dumps(document).encode(), "cube.gltf"))
    assert formats.files(tmp_path / "cube.gltf") == (tmp_path / "cube.gltf",)
    half = {"byteLength": 96, "uri": "data:;base64," + base64.b64encode(data[:96]).decode()}
    rest = {"byteLength": 72, "uri": "data:;base64," + base64.b64encode(data[96:]).decode()}
    document |= {"buffers": [half, rest]}
    document["bufferViews"][1] |= {"buffer": 1, "byteOffset": 0}
    check_is_cube(read(tmp_path, json.dumps(document).encode(), "cube.gltf"))


def test_interleaved_and_sparse_accessors(tmp_path: Path) -> None:
    document, data = scene()
    wide = np.zeros((8, 5), "<f4")
    wide[:, 1:4] = CUBE
    document["bufferViews"][0] |= {"byteStride": 20, "byteLength": 160}
    document["accessors"][0]["byteOffset"] = 4
    document["bufferViews"][1]["byteOffset"] = 160
    document["buffers"][0]["byteLength"] = 232
    check_is_cube(read(tmp_path, glb(document, wide.tobytes() + data[96:])))
    document, data = scene(np.minimum(CUBE, 0.5))
    places = np.flatnonzero(CUBE.any(axis=1))
    patch = places.astype("<u2").tobytes() + b"\0\0" + CUBE[places].astype("<f4").tobytes()
    document["bufferViews"] += [
        {"buffer": 0, "byteOffset": 168, "byteLength": 14},
        {"buffer": 0, "byteOffset": 184, "byteLength": 84},
    ]
    document["accessors"][0]["sparse"] = {
        "count": 7,
        "indices": {"bufferView": 2, "componentType": 5123},
        "values": {"bufferView": 3},
    }
    document["buffers"][0]["byteLength"] = 268
    check_is_cube(read(tmp_path, glb(document, data + patch)))
    del document["accessors"][0]["bufferView"]  # zeros, changed at seven corners
    check_is_cube(read(tmp_path, glb(document, data + patch)))


def test_strips_and_fans(tmp_path: Path) -> None:
    sides = [[0, 1, 2, 3], [4, 6, 5, 7], [0, 4, 1, 5], [2, 3, 6, 7], [0, 2, 4, 6], [1, 5, 3, 7]]
    for mode, order in ((5, [0, 1, 2, 3]), (6, [0, 1, 3, 2])):
        document, data = scene(corners=np.array(sides)[:, order])
        document["accessors"] = document["accessors"][:1] + [
            document["accessors"][1] | {"count": 4, "byteOffset": 8 * side} for side in range(6)
        ]
        document["meshes"][0]["primitives"] = [
            {"attributes": {"POSITION": 0}, "indices": 1 + side, "mode": mode} for side in range(6)
        ] + [{"attributes": {"POSITION": 0}, "mode": 1}]
        content = read(tmp_path, glb(document, data))
        assert area_and_volume(content) == pytest.approx((6.0, 1.0))
        assert content.warnings == ("1 sets of points or lines were not read",)


def test_nodes_stand_where_their_parents_put_them(tmp_path: Path) -> None:
    document, data = scene()
    half = np.sqrt(0.5)
    document["nodes"] = [
        {"children": [1, 2], "translation": [10.0, 0.0, 0.0]},
        {"mesh": 0, "rotation": [0.0, 0.0, half, half], "scale": [2.0, 1.0, 1.0]},  # x to y
        {"mesh": 0, "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1]},  # mirrored, lifted
    ]
    content = read(tmp_path, glb(document, data))
    first, second = content.vertices[:8], content.vertices[8:]
    if first[:, 2].max() > 2.0:
        first, second = second, first
    np.testing.assert_allclose([first.min(axis=0), first.max(axis=0)], [[9, 0, 0], [10, 2, 1]], atol=1e-12)
    np.testing.assert_allclose([second.min(axis=0), second.max(axis=0)], [[9, 0, 5], [10, 1, 6]], atol=1e-12)
    assert area_and_volume(content) == pytest.approx((6.0 + 10.0, 1.0 + 2.0))  # both turned outward


def test_only_the_default_scene_is_read_and_without_scenes_all_of_it(tmp_path: Path) -> None:
    document, data = scene()
    document["nodes"].append({"mesh": 0, "translation": [3, 0, 0]})
    document["scenes"].append({"nodes": [1]})
    content = read(tmp_path, glb(document, data))
    check_is_cube(content)
    assert content.warnings == ("of several scenes the default one was read",)
    del document["scenes"]
    assert read(tmp_path, glb(document, data)).triangles.shape == (24, 3)


def nested(document: Json, path: tuple[Any, ...], value: Any) -> Json:
    changed: Any = json.loads(json.dumps(document))
    inner = changed
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    return dict(changed)


@pytest.mark.parametrize(
    ("path", "value", "word"),
    [
        (("extensionsRequired",), ["KHR_draco_mesh_compression"], "compressed by KHR_draco_mesh_compression"),
        (("extensionsRequired",), ["EXT_meshopt_compression"], "without compression"),
        (("extensionsRequired",), ["ACME_curves"], "ACME_curves, which is not supported"),
        (("bufferViews", 0, "extensions"), {"EXT_meshopt_compression": {}}, "compressed by EXT_meshopt"),
        (("nodes", 0, "extensions"), {"EXT_mesh_gpu_instancing": {}}, "without instancing"),
        (("nodes", 0, "children"), [0], "node 0 stands in two places"),
        (("nodes", 0, "children"), [1], "names nodes 1 of 1"),
        (("nodes", 0, "children"), [-1], "names nodes -1 of 1"),
        (("nodes", 0, "mesh"), 7, "names meshes 7 of 1"),
        (("nodes", 0, "matrix"), [1, 2], "damaged"),
        (("nodes", 0, "rotation"), "no", "damaged"),
        (("nodes", 0, "translation"), [0, 0, 1e400], "NaN or infinite"),
        (("accessors", 0, "count"), 10**12, "damaged or truncated"),
        (("accessors", 0, "count"), -1, "damaged"),
        (("accessors", 0, "count"), 7, "names vertex 7 of 7"),
        (("accessors", 0, "type"), "VEC9", "damaged"),
        (("accessors", 0, "type"), "VEC2", "3 numbers"),
        (("accessors", 0, "bufferView"), None, "names bufferViews None"),
        (("accessors", 1, "count"), 35, "damaged"),
        (("bufferViews", 0, "byteStride"), 0, "byteStride"),
        (("buffers", 0, "byteLength"), 10**12, "truncated"),
        (("asset", "version"), "1.0", "glTF 1.0, 2 is needed"),
        (("asset",), None, "no asset"),
        (("meshes", 0, "primitives"), [], "no triangles"),
        (("meshes",), {}, "names meshes 0 of 0"),
        (("scenes", 0), [], "damaged"),
        (("scenes", 0, "nodes"), [[0]], "damaged"),
    ],
    ids=str,
)
def test_a_damaged_document(tmp_path: Path, path: tuple[Any, ...], value: Any, word: str) -> None:
    document, data = scene()
    with pytest.raises(WorldError, match=word):
        read(tmp_path, glb(nested(document, path, value), data))


def test_a_scene_that_places_a_mesh_without_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from uavexp.formats import parts

    monkeypatch.setattr(parts, "MAX_SIZE", 50)
    document, data = scene()
    check_is_cube(read(tmp_path, glb(document, data)))
    document["nodes"] = [{"mesh": 0}] * 3
    document["scenes"][0]["nodes"] = [0, 1, 2]
    with pytest.raises(WorldError, match="places more than 50"):
        read(tmp_path, glb(document, data))


def test_deeply_nested_json_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(WorldError, match="json cannot be parsed"):
        read(tmp_path, b"[" * 200_000, "deep.gltf")
    document, data = scene()
    document["nodes"] = [{"children": [i + 1]} for i in range(5000)] + [{"mesh": 0}]
    check_is_cube(read(tmp_path, glb(document, data)))


@settings(max_examples=150, deadline=None)
@given(damage=DAMAGES)
def test_damage_ends_in_content_or_one_line(damage: tuple[float, list[tuple[float, bytes]]]) -> None:
    check_ends_well("m.glb", damaged(glb(*scene()), damage))
    document, data = scene()
    document["buffers"][0]["uri"] = "data:;base64," + base64.b64encode(data).decode()
    check_ends_well("m.gltf", damaged(json.dumps(document).encode(), damage))


QUANTISED = SHARED.parent / "cases" / "glb_quantised"
FILES = [DATA / "flat.glb", *SHARED.glob("worlds_extra/*.glb"), *QUANTISED.glob("*.glb")]


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.name))
def test_trimesh_reads_the_same(file: Path) -> None:
    trimesh = pytest.importorskip("trimesh")

    content = formats.read(file, formats.Options())
    other = trimesh.load(file, process=False, force="mesh")
    assert content.vertices.shape == other.vertices.shape
    assert content.triangles.shape == other.faces.shape
    np.testing.assert_allclose(areas(content.vertices[content.triangles]), areas(other.triangles))
    np.testing.assert_allclose([content.vertices.min(0), content.vertices.max(0)], other.bounds, atol=1e-6)


def areas(corners: np.ndarray) -> np.ndarray:
    """Doubled areas of triangles (F, 3, 3), sorted."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.sort(np.linalg.norm(normals, axis=1))
