"""A way too narrow for what flies is refused before the flight, with the parameters that pass it."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from uavexp.config.build import build
from uavexp.config.composition import Composer
from uavexp.config.overrides import parse_settings
from uavexp.errors import WorldError
from uavexp.passage import check_passage, needed_m
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


def test_a_narrow_door_names_the_parameters_that_pass_it_and_they_do(tmp_path: Path) -> None:
    path = door(tmp_path, 0.75)
    with pytest.raises(WorldError, match=r"is 0\.37 m wide on each side") as refused:
        make_world(parts_of(path), 0)
    advised = re.findall(r"\w+\.min_clearance_m=0\.\d+", str(refused.value))
    assert [item.partition(".")[0] for item in advised] == ["planner", "explorer"]
    assert make_world(parts_of(path, *advised), 0).target_m.tolist() == [9.0, 3.0, 1.2]


def test_a_wider_door_a_finer_map_and_a_lesser_planner_pass(tmp_path: Path) -> None:
    wide, narrow = door(tmp_path, 0.86), parts_of(door(tmp_path, 0.75))
    world = make_world(replace(narrow, planner=parts_of(wide, "planner.min_clearance_m=0.2").planner), 0)
    with pytest.raises(WorldError):
        check_passage(world, narrow.planner, narrow.explorer, narrow.mapping, narrow.vehicle.limits)
    finer = parts_of(wide, "mapping.voxel_size_m=0.05").mapping
    check_passage(world, narrow.planner, narrow.explorer, finer, narrow.vehicle.limits)
    make_world(parts_of(door(tmp_path, 0.86)), 0)


def test_what_is_needed_grows_with_the_clearance_and_with_the_voxels(tmp_path: Path) -> None:
    path = door(tmp_path, 0.75)
    parts = parts_of(path)
    limits = parts.vehicle.limits

    def needed(*settings: str) -> float:
        other = parts_of(path, *settings)
        return needed_m(other.planner, other.explorer, other.mapping, limits)

    assert needed() == pytest.approx(0.26 + 0.15)
    assert needed("planner.min_clearance_m=0.2") == pytest.approx(limits.body_radius_m + 0.15)
    assert needed("planner.min_clearance_m=0.3") == pytest.approx(0.3 + 0.15)
    assert needed("mapping.voxel_size_m=0.2") == pytest.approx(0.26 + 0.3)
