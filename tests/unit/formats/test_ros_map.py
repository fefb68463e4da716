"""ROS maps: each rule of map_server on pixels whose state is known, each image against Pillow."""

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from tests.folders import SHARED
from tests.formats import only_world_errors
from uavexp.errors import WorldError
from uavexp.formats import FREE, SOLID, UNMEASURED, Content, Options, files, read

KEYS = "image: {image}\nresolution: 0.5\norigin: [1.0, 2.0, 0.0]\n"
S, F, U = SOLID, FREE, UNMEASURED


def plain(rows: list[list[int]], greatest: int = 255) -> bytes:
    body = "\n".join(" ".join(map(str, row)) for row in rows)
    return f"P2\n# plain\n{len(rows[0])} {len(rows)}\n{greatest}\n{body}\n".encode()


def written(folder: Path, image: bytes, extra: str = "", name: str = "m.pgm", yaml: str = "m.yaml") -> Path:
    (folder / name).write_bytes(image)
    (folder / yaml).write_text(KEYS.format(image=name) + extra)
    return folder / yaml


def states(content: Content) -> list[list[int]]:
    """Rows as in the image, from above."""
    assert content.cells is not None
    return content.cells.state[..., 0].T[::-1].tolist()


@pytest.mark.parametrize(
    ("extra", "pixels", "expected"),
    [
        ("free_thresh: 0.196\n", [0, 254, 205, 89, 90], [S, F, U, S, U]),
        ("", [0, 254, 205, 192, 191], [S, F, F, F, U]),  # map_saver's defaults, 0.65 and 0.25
        ("negate: 1\nfree_thresh: 0.196\n", [255, 1, 50, 166, 165], [S, F, U, S, U]),
        ("negate: true\nfree_thresh: 0.196\n", [255, 1, 50, 166, 165], [S, F, U, S, U]),
        ("negate: 0\nfree_thresh: 1.96e-1\noccupied_thresh: 65e-2\n", [0, 254, 205, 89, 90], [S, F, U, S, U]),
        (
            "mode: scale\noccupied_thresh: 1.0\nfree_thresh: 0\n",
            [0, 255, 89, 90, 207, 205],
            [S, F, S, S, F, U],
        ),
        ("mode: scale\noccupied_thresh: 0.8\nfree_thresh: 0.2\n", [51, 204, 128, 105, 176], [S, F, U, S, F]),
        ("occupied_thresh: 1.0\nfree_thresh: 0.0\n", [0, 1, 254, 255], [S, U, U, F]),  # a threshold is inside
        ("mode: raw\n", [0, 19, 20, 64, 65, 100, 101, 255], [F, F, U, U, S, S, U, U]),
        ("mode: raw\nnegate: 1\n", [0, 100, 255], [F, S, U]),
    ],
)
def test_each_mode_judges_a_pixel_as_map_server_does(
    tmp_path: Path, extra: str, pixels: list[int], expected: list[int]
) -> None:
    assert states(read(written(tmp_path, plain([pixels]), extra), Options())) == [expected]


def test_rows_run_down_and_columns_to_the_right(tmp_path: Path) -> None:
    content = read(written(tmp_path, plain([[0, 254, 254], [254, 254, 0]])), Options(wall_height_m=2.0))
    cells = content.cells
    assert cells is not None
    assert cells.is_plan
    assert cells.state[:, :, 0].tolist() == [[F, S], [F, F], [S, F]]  # x right, y up
    np.testing.assert_array_equal(cells.origin, [1.0, 2.0, 0.0])
    np.testing.assert_array_equal(cells.size, [0.5, 0.5, 2.0])


def test_what_is_not_opaque_is_unmeasured(tmp_path: Path) -> None:
    pixels = np.array([[[0, 0, 0, 255], [255, 255, 255, 255], [255, 255, 255, 254], [0, 0, 0, 0]]], np.uint8)
    Image.fromarray(pixels).save(tmp_path / "m.png")
    for mode in ("trinary", "scale"):
        path = written(tmp_path, (tmp_path / "m.png").read_bytes(), f"mode: {mode}\n", "m.png")
        assert states(read(path, Options())) == [[S, F, U, U]]


@pytest.mark.parametrize("mode", ["1", "L", "P", "RGB", "I;16"])
@pytest.mark.parametrize("kind", ["png", "bmp"])
def test_every_kind_of_pixel_is_read(tmp_path: Path, mode: str, kind: str) -> None:
    if kind == "bmp" and mode == "I;16":
        pytest.skip("bmp has no 16 bits")
    grey = np.random.default_rng(0).choice(np.array([0, 255], np.uint8), (6, 9))
    image = Image.fromarray(65535 * (grey > 0).astype(np.uint16)) if mode == "I;16" else Image.fromarray(grey)
    (image if mode == "I;16" else image.convert(mode)).save(tmp_path / f"m.{kind}")
    path = written(tmp_path, (tmp_path / f"m.{kind}").read_bytes(), name=f"m.{kind}")
    assert states(read(path, Options())) == np.where(grey == 0, S, F).tolist()


@pytest.mark.parametrize(
    "image",
    [
        plain([[0, 254], [205, 0]]),
        b"P2 2 2 255 0 254 # the far row\n205 # near\n0",
        b"P5\n# of a camera\n2 2\n255\n\x00\xfe\xcd\x00",
        plain([[0, 100], [80, 0]], 100),
        b"P5 2 2 65535\n\x00\x00\xfe\xfe\xcd\xcd\x00\x00",
    ],
)
def test_every_form_of_pgm_is_the_same_map(tmp_path: Path, image: bytes) -> None:
    assert states(read(written(tmp_path, image, "free_thresh: 0.196\n"), Options())) == [[S, F], [U, S]]


@pytest.mark.parametrize("number", ["-1e-05", "5e-1", "-0.5", "1", "+3.0E+0"])
def test_numbers_are_read_as_c_writes_them(tmp_path: Path, number: str) -> None:
    path = tmp_path / "m.yml"
    (tmp_path / "m.pgm").write_bytes(plain([[0]]))
    path.write_text(f"image: m.pgm # the plan\nresolution: 5e-2\norigin: [{number}, 2, {number}]\n")
    cells = read(path, Options()).cells
    assert cells is not None
    assert cells.origin[0] == cells.yaw_rad == float(number)
    assert cells.size[0] == 0.05


def test_the_grey_of_map_saver_that_counts_as_free_is_told(tmp_path: Path) -> None:
    image = plain([[0, 254, 205, 205]])
    (warning,) = read(written(tmp_path, image), Options()).warnings
    assert "50 %" in warning
    assert not read(written(tmp_path, image, "free_thresh: 0.196\n"), Options()).warnings


@pytest.mark.parametrize(
    "text",
    ['"image": m.pgm\n{}', "{{image: m.pgm, {} }}", "image: 'm.pgm' # plan\n{}", "image: ./m.pgm\n{}"],
)
def test_the_image_is_named_by_one_parser(tmp_path: Path, text: str) -> None:
    rest = ["resolution: 1", "origin: [0, 0, 0]"]
    (tmp_path / "m.pgm").write_bytes(plain([[0]]))
    (tmp_path / "m.YAML").write_text(text.format((", " if "{{" in text else "\n").join(rest)))
    assert [file.name for file in files(tmp_path / "m.YAML")] == ["m.YAML", "m.pgm"]
    assert states(read(tmp_path / "m.YAML", Options())) == [[S]]


@pytest.mark.parametrize("name", ["/dev/zero", "fifo.pgm", "folder", "missing.pgm"])
def test_only_regular_files_are_opened(tmp_path: Path, name: str) -> None:
    os.mkfifo(tmp_path / "fifo.pgm")
    (tmp_path / "folder").mkdir()
    (tmp_path / "m.yaml").write_text(KEYS.format(image=name))
    with pytest.raises(WorldError, match=r"no regular file|does not exist"):
        read(tmp_path / "m.yaml", Options())


@pytest.mark.parametrize(
    ("image", "extra", "word"),
    [
        (b"P5 60000 60000 255\n" + b"\0" * 99, "", "pixels"),
        (plain([[0, 1]])[:-3], "", "truncated"),
        (b"GIF89a" + b"\0" * 99, "", "pgm, png or bmp"),
        (plain([[0]]), "occupied_thresh: 0.2\nfree_thresh: 0.3\n", "free_thresh"),
        (plain([[0]]), "negate: [1]\n", "negate"),
        (plain([[0]]), "mode: [" + "[" * 5000 + "\n", "yaml"),
        (plain([[0]]), "origin: [[1, 1], 0, 0]\n", "origin"),
        (plain([[0]]), "# " + "long " * 400_000, "bytes"),
    ],
)
def test_absurd_maps_are_one_line(tmp_path: Path, image: bytes, extra: str, word: str) -> None:
    with pytest.raises(WorldError, match=word) as error:
        read(written(tmp_path, image, extra), Options())
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 500


@pytest.mark.skipif(not SHARED.is_dir(), reason=f"no {SHARED}")
@pytest.mark.parametrize("path", sorted(SHARED.glob("ros_maps/**/*.yaml")), ids=lambda path: path.parent.name)
def test_published_maps_have_as_many_cells_as_pillow_counts_pixels(path: Path) -> None:
    if path.name == "invalid_image.yaml":
        pytest.skip("its image is missing, as published")
    (_, image) = files(path)
    grey = np.asarray(Image.open(image).convert("L"), dtype=float)
    content = read(path, Options())
    assert content.cells is not None
    assert content.cells.state.size == grey.size
    if path.stem != "depot_speed":  # the only one in mode scale
        assert np.count_nonzero(content.cells.state == SOLID) == np.count_nonzero(grey < 255 * 0.35)


@settings(max_examples=50, deadline=None)
@given(
    place=st.integers(0, 200), byte=st.integers(0, 255), kind=st.sampled_from(["pgm", "png", "bmp", "yaml"])
)
def test_damaged_bytes_end_in_one_line(
    tmp_path_factory: pytest.TempPathFactory, place: int, byte: int, kind: str
) -> None:
    folder = tmp_path_factory.mktemp("map")
    grey = Image.fromarray(np.full((4, 5), 254, np.uint8))
    name = "m.pgm" if kind == "yaml" else f"m.{kind}"
    grey.save(folder / name)
    path = written(folder, (folder / name).read_bytes(), "mode: scale\nnegate: 0\n", name)
    only_world_errors(path if kind == "yaml" else folder / name, place, byte, path)
