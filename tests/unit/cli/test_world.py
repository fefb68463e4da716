"""`python -m uavexp.world FILE`: what it says of a building is what is in the file."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.folders import DATA
from uavexp.cli.world import main

KEYS = {
    "kind", "vertices", "triangles", "points", "bounds_m", "cells", "parts", "start_m", "target_m",
    "ends_free", "shortest_path_m", "bottleneck_m", "warnings",
}  # fmt: skip
NEAR = "world.least_distance_m=4"


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def told(capsys: pytest.CaptureFixture[str], *typed: str) -> dict[str, object]:
    code = main([*typed, "--json"])
    out = capsys.readouterr()
    assert code == 0, out.err
    assert out.out.count("\n") == 1
    return json.loads(out.out)  # type: ignore[no-any-return]


def test_a_mesh_is_told_in_one_line_of_json(capsys: pytest.CaptureFixture[str]) -> None:
    found = told(capsys, str(DATA / "flat.ply"), NEAR)
    assert found.keys() >= KEYS
    assert (found["kind"], found["points"], found["cells"]) == ("ply mesh", 0, None)
    assert found["ends_free"] is True
    assert np.allclose(found["bounds_m"], [[0, 0, 0], [8, 6, 2.5]], atol=0.3)  # type: ignore[arg-type]
    assert 0.35 <= found["bottleneck_m"] <= 0.60  # type: ignore[operator]  # the door is 1.2 m wide
    assert Image.open("flat.world.png").width == 1200


def test_the_cells_of_a_map_are_those_of_its_image(capsys: pytest.CaptureFixture[str]) -> None:
    found = told(capsys, str(DATA / "flat_map.yaml"), NEAR, "seed=3")
    image = np.array(Image.open(DATA / "flat_map.pgm"))
    assert found["cells"] == {
        "occupied": int((image < 90).sum()),
        "free": int((image > 205).sum()),
        "unmeasured": int(((image >= 90) & (image <= 205)).sum()),
    }


def test_start_and_target_are_those_of_a_flight_of_that_seed(capsys: pytest.CaptureFixture[str]) -> None:
    import uavexp

    found = told(capsys, str(DATA / "flat.ply"), NEAR, "seed=5")
    values = {"world": "file", "world.path": str(DATA / "flat.ply"), "world.least_distance_m": 4, "seed": 5}
    flown = uavexp.fly(**values, **{"mission.time_base_s": 0.1, "mission.time_per_path_spm": 0.0})
    assert found["start_m"] == flown.world.start_m.tolist()
    assert found["target_m"] == flown.world.target_m.tolist()


def test_what_cannot_be_flown_is_shown_all_the_same(capsys: pytest.CaptureFixture[str]) -> None:
    code = main(
        [str(DATA / "flat.ply"), "world.start_m=[0,0,0]", "world.target_m=[7,1,1.2]", "--out", "a.png"]
    )
    out = capsys.readouterr()
    assert code == 2
    assert "ply mesh" in out.out
    assert out.err.startswith("error: ")
    assert out.err.count("\n") == 1
    assert Path("a.png").exists()


@pytest.mark.parametrize(
    ("typed", "words"),
    [
        (("nowhere.ply",), "does not exist"),
        ((), "usage"),
        (("a.ply", "b.ply"), "one file is needed"),
        (("a.ply", "--what"), "unknown option --what"),
        (("a.ply", "--out", "a.pdf"), "name of a .png"),
        (("a.ply", "seed=0:3"), "one seed"),
        (("a.ply", "world.up=z"), "no parameter 'up'"),
    ],
)
def test_bad_input_is_one_line(
    typed: tuple[str, ...], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(typed) == 2
    assert words in capsys.readouterr().err
