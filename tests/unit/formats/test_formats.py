"""Any file: found by its suffix, and one line where it cannot be read."""

import os
import sys
from pathlib import Path

import pytest

from tests.folders import DATA
from tests.unit.formats.test_stl import binary
from uavexp import formats
from uavexp.errors import WorldError

MODULES = Path(formats.__file__).parent


def read(path: Path) -> formats.Content:
    return formats.read(path, formats.Options())


def test_every_suffix_has_a_module() -> None:
    for suffix, module in formats.READERS.items():
        assert suffix == suffix.lower()
        assert (MODULES / f"{module}.py").is_file()


def test_a_suffix_of_any_case_is_the_same(tmp_path: Path) -> None:
    for name in ("flat.ply", "flat.obj", "flat.stl", "flat.glb"):
        path = tmp_path / name.upper()
        path.write_bytes((DATA / name).read_bytes())
        assert read(path).triangles.shape == (96, 3)


def test_a_library_that_is_not_installed_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "plan.dxf").write_text("0\nEOF\n")
    monkeypatch.delitem(sys.modules, "uavexp.formats.dxf", raising=False)
    for name in ["ezdxf", *(name for name in sys.modules if name.startswith("ezdxf."))]:
        monkeypatch.setitem(sys.modules, name, None)  # as where it is missing
    with pytest.raises(WorldError, match=r"reading \.dxf needs ezdxf: pip install 'uavexp\[formats\]'"):
        read(tmp_path / "plan.dxf")


def test_more_than_the_memory_holds_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from uavexp.formats import stl

    def too_much(path: Path, options: formats.Options) -> formats.Content:
        raise MemoryError

    monkeypatch.setattr(stl, "read", too_much)
    (tmp_path / "m.stl").write_bytes(binary())
    with pytest.raises(WorldError, match=r"m\.stl holds more than the memory does"):
        read(tmp_path / "m.stl")


def test_pipes_folders_and_locked_files_are_named(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.ply")  # opening it would wait for ever
    (tmp_path / "folder.ply").mkdir()
    for name, word in (
        ("pipe.ply", "is not a file"),
        ("folder.ply", "is not a file"),
        ("no.ply", "not exist"),
    ):
        with pytest.raises(WorldError, match=word):
            read(tmp_path / name)
        with pytest.raises(OSError, match="no such file"):
            formats.files(tmp_path / name)
    (tmp_path / "empty.obj").touch()
    with pytest.raises(WorldError, match="empty"):
        read(tmp_path / "empty.obj")
    (tmp_path / "m.fbx").write_text("m")
    with pytest.raises(WorldError, match=r"extension '\.fbx'; one of \.ply \.obj"):
        read(tmp_path / "m.fbx")


def test_files_are_those_that_the_content_depends_on(tmp_path: Path) -> None:
    for name in ("m.obj", "tracks.csv"):  # any suffix; the materials of an obj are not read
        (tmp_path / name).write_text("mtllib m.mtl\n")
        assert formats.files(tmp_path / name) == (tmp_path / name,)
    rest = "\nresolution: 1\norigin: [0, 0, 0]\n"
    flow = "{image: m.pgm, resolution: 1, origin: [0, 0, 0]}"
    for text in (f"image: m.pgm # the plan{rest}", f'"image": m.pgm{rest}', flow):
        (tmp_path / "m.YAML").write_text(text)
        (tmp_path / "m.pgm").write_text("P2 1 1 255 0")
        assert formats.files(tmp_path / "m.YAML") == (tmp_path / "m.YAML", tmp_path / "m.pgm")
    (tmp_path / "m.YAML").write_text("image: /dev/zero\nresolution: 1\norigin: [0, 0, 0]\n")
    with pytest.raises(WorldError, match=r"names .*, which is no file"):
        formats.files(tmp_path / "m.YAML")
