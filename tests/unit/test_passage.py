"""A way too narrow for what flies is refused before the flight, with the parameters that pass it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from uavexp.config.build import build
from uavexp.config.composition import Composer
from uavexp.config.overrides import parse_settings
from uavexp.errors import WorldError
from uavexp.passage import VOXELS, check_passage, needed_m
from uavexp.trial import Parts, make_world
from uavexp.world.boxes import Boxes


def door(folder: Path, width_m: float) -> Path:
    """Two rooms with a door of some width between them."""
    boxes = Boxes()
    boxes.shell((10.0, 6.0, 2.6))
    boxes.span((5.0, 0.0, 0.0), (5.15, 2.6 - 0.5 * width_m, 2.6))
    boxes.span((5.0, 2.6 + 0.5 * width_m, 0.0), (5.15, 6.0, 2.6))
    vertices, triangles = boxes.mesh()
    path = folder / "door.obj"
    path.write_text(
        "\n".join(
            ["v {:.6f} {:.6f} {:.6f}".format(*v) for v in vertices]
            + ["f {} {} {}".format(*(t + 1)) for t in triangles]
        )
    )
    return path


def parts_of(path: Path, *settings: str) -> Parts:
    given = [
        "world=file",
        f"world.path={path}",
        "world.clearance_m=0.25",
        "world.start_m=[1.0,3.0,1.2]",
        "world.target_m=[9.0,3.0,1.2]",
        *settings,
    ]
    return build(Composer().command(parse_settings(given)).cells[0].config)


def test_a_narrow_door_names_the_parameter_that_passes_it_and_it_does(tmp_path: Path) -> None:
    path = door(tmp_path, 0.68)
    with pytest.raises(WorldError, match=r"leaves 0\.34 m on each side") as refused:
        make_world(parts_of(path), 0)
    advised = re.findall(r"narrow_clearance_m=0\.\d+", str(refused.value))
    assert make_world(parts_of(path, *advised), 0).target_m.tolist() == [9.0, 3.0, 1.2]


def test_a_wider_door_a_finer_map_and_a_lesser_clearance_pass(tmp_path: Path) -> None:
    make_world(parts_of(door(tmp_path, 0.8)), 0)
    narrow = parts_of(door(tmp_path, 0.68), "narrow_clearance_m=0.15")
    world = make_world(narrow, 0)
    usual = parts_of(door(tmp_path, 0.68))
    with pytest.raises(WorldError):
        check_passage(world, usual.planner, usual.explorer, usual.mapping)
    finer = parts_of(door(tmp_path, 0.68), "mapping.voxel_size_m=0.05").mapping
    check_passage(world, usual.planner, usual.explorer, finer)


def test_what_is_needed_grows_with_the_clearance_and_with_the_voxels(tmp_path: Path) -> None:
    path = door(tmp_path, 0.75)

    def needed(*settings: str) -> float:
        parts = parts_of(path, *settings)
        return needed_m(parts.planner, parts.explorer, parts.mapping)

    assert needed() == pytest.approx(0.22 + VOXELS * 0.1)
    assert needed("narrow_clearance_m=0") == pytest.approx(0.3 + VOXELS * 0.1)  # the explorer's own
    assert needed("planner.min_clearance_m=0.2") == pytest.approx(0.22 + VOXELS * 0.1)
    assert needed("mapping.voxel_size_m=0.2") == pytest.approx(0.22 + VOXELS * 0.2)
