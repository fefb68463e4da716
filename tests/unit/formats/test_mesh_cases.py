"""Files that once crashed the interpreter, were refused though whole, or read as something else."""

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from tests.folders import SHARED
from uavexp import formats
from uavexp.errors import WorldError
from uavexp.world.file import File

CASES = SHARED.parent / "cases"
pytestmark = pytest.mark.skipif(not CASES.is_dir(), reason=f"no cases in {CASES}")
HALL = ([0.0, 0.0, -0.1], [12.0, 8.0, 2.7])  # 56 vertices, 84 triangles, a dividing wall with a gap
HALLS = [
    "obj_quads/quads.obj",
    "ply_tristrips/tristrips.ply",
    "ply_crlf_after_header/crlf_end.ply",
    "glb_quantised/plain.glb",
    "glb_quantised/quant.glb",
    "glb_quantised/unaligned.glb",
]


@pytest.mark.parametrize("name", HALLS)
def test_every_file_of_the_hall_is_the_hall(name: str) -> None:
    content = formats.read(CASES / name, formats.Options())
    assert (content.vertices.shape, content.triangles.shape) == ((56, 3), (84, 3))
    ends = {"start_m": (1.0, 1.0, 1.2), "target_m": (11.0, 1.0, 1.2)}
    world = File(path=str(CASES / name), **ends).generate(np.random.default_rng(0))
    np.testing.assert_allclose([world.vertices_m.min(axis=0), world.vertices_m.max(axis=0)], HALL, atol=1e-6)
    assert world.difficulty.shortest_path_m == pytest.approx(13.4, abs=0.1)  # around the wall, not through it


@pytest.mark.parametrize("name", ["o_comment.ply", "o_word.ply"])
def test_long_lines_of_a_header(name: str) -> None:
    content = formats.read(CASES / "ply_abort" / name, formats.Options())
    assert (content.vertices.shape, content.triangles.shape) == ((8, 3), (6, 3))


def test_an_index_far_beyond_the_vertices() -> None:
    with pytest.raises(WorldError, match="names vertex 100000 of 56"):
        formats.read(CASES / "ply_quad_bad_index" / "badquad.ply", formats.Options())


def test_a_cloud_cut_short() -> None:
    whole = formats.read(CASES / "ply_cloud_truncated" / "whole.ply", formats.Options())
    assert whole.points.shape == (1372, 3)
    with pytest.raises(WorldError, match="promises 1372 rows of vertex, 1008 could be read"):
        formats.read(CASES / "ply_cloud_truncated" / "cut.ply", formats.Options())


def test_a_texture_that_is_a_pipe(tmp_path: Path) -> None:
    shutil.copytree(CASES / "world_check_unlimited", tmp_path, dirs_exist_ok=True)
    os.mkfifo(tmp_path / "fifo.png")
    content = formats.read(tmp_path / "tex_fifo.obj", formats.Options())
    assert (content.vertices.shape, content.triangles.shape) == ((8, 3), (8, 3))
