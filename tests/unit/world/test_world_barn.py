"""The worlds of BARN are the published ones: against Gazebo's files, maps made of them, and by distance."""

from __future__ import annotations

import csv
import re

import numpy as np
import pytest

from tests.folders import SHARED
from uavexp.errors import ConfigError
from uavexp.scene import Scene
from uavexp.world.barn import Barn
from uavexp.world.barn_layouts import COUNT, layout, name_of, number_of
from uavexp.world.widest import bottleneck_m

BARN, GAZEBO = SHARED / "barn", SHARED / "gazebo" / "barn" / "static"
needs_barn = pytest.mark.skipif(not BARN.is_dir(), reason="../shared/data/barn is absent")
POSE = re.compile(r"<model name='unit_cylinder_\d+'>\s*<static>1</static>\s*<pose frame=''>(\S+) (\S+) ")


def index() -> list[dict[str, str]]:
    with (BARN / "index.csv").open() as file:
        return list(csv.DictReader(file))


@needs_barn
@pytest.mark.parametrize("number", [0, 108, 252])
def test_cylinders_stand_where_gazebos_stand(number: int) -> None:
    published = np.array(POSE.findall((GAZEBO / f"world_{number}.world").read_text()), dtype=np.float64)
    ours = layout(number).centres_m
    assert {tuple(row) for row in ours.round(4)} == {tuple(row) for row in published.round(4)}


@needs_barn
def test_every_world_has_its_count_and_its_reference_path() -> None:
    rows = index()
    assert [int(row["world"]) for row in rows] == list(range(COUNT))
    for number, row in enumerate(rows):
        assert len(layout(number).centres_m) == int(row["cylinders"])
        assert layout(number).reference_path_m == float(row["reference_path_m"])


@needs_barn
def test_every_map_made_of_the_published_world_is_black_at_our_cylinders_alone() -> None:
    for number in range(COUNT):
        data = (BARN / f"barn_{number:03d}.pgm").read_bytes()
        black = np.frombuffer(data[-280 * 90 :], dtype=np.uint8).reshape(280, 90)[::-1] < 100
        centres = np.argwhere(black[1::3, 1::3])[:, ::-1] * 0.15 + 0.075 + [-4.5, 0.0]  # 3 by 3 cells
        np.testing.assert_allclose(layout(number).centres_m, centres, atol=1e-9)


@pytest.mark.parametrize("number", [0, 250])
def test_a_cylinder_is_round_to_six_millimetres_and_reaches_from_floor_to_ceiling(number: int) -> None:
    world = Barn(number=number).generate(np.random.default_rng(0))
    scene, rng = Scene(world), np.random.default_rng(1)
    low, high = world.flight_bounds_m
    points = rng.uniform(low, high, (4000, 3))
    points[:, 2] = rng.uniform(0.8, 1.7, 4000)  # nearer to cylinders than to floor and ceiling, or cut at 0.8
    exact = np.linalg.norm(points[:, None, :2] - layout(number).centres_m[None], axis=2).min(axis=1) - 0.075
    outside = exact > 0.0063  # of the octagon, too
    found = np.minimum(scene.distance_m(points[outside]), 0.8)
    gap = np.minimum(exact[outside], 0.8) - found
    assert gap.min() > -1e-5
    assert gap.max() < 0.0063


def test_all_air_is_inside_and_cylinders_are_not() -> None:
    world = Barn(number=250).generate(np.random.default_rng(0))
    ends = np.stack([world.start_m, world.target_m])
    assert world.space.is_inside(ends).all()
    assert world.space.is_inside(world.shortest_path).all()
    centres = np.column_stack([layout(250).centres_m, np.full(len(layout(250).centres_m), 1.2)])
    assert not world.space.is_inside(centres).any()


@needs_barn
@pytest.mark.parametrize("number", [8, 60, 252])
def test_the_bottleneck_is_that_of_the_published_map(number: int) -> None:
    world = Barn(number=number).generate(np.random.default_rng(0))
    widest = bottleneck_m(Scene(world), world.flight_bounds_m, world.start_m, world.target_m, 1.3)
    assert widest == pytest.approx(
        float(index()[number]["bottleneck_clearance_m"]), abs=0.04
    )  # cells of 0.05 m


def test_a_number_is_a_world_and_without_one_the_seed_draws_it() -> None:
    first, second = (Barn(number=7).generate(np.random.default_rng(seed)) for seed in (0, 1))
    assert first.digest == second.digest
    assert first.start_m.tolist() == [-2.25, 3.0, 1.2]
    assert first.target_m.tolist() == [-2.25, 13.0, 1.2]
    drawn = {Barn().generate(np.random.default_rng(seed)).name for seed in range(3)}
    assert len(drawn) == 3


def test_a_name_tells_the_number() -> None:
    assert [number_of(name_of(number)) for number in (0, 42, 299)] == [0, 42, 299]
    assert [number_of(name) for name in ("rooms", "barn", "barn_x", "synthetic")] == [None] * 4


@pytest.mark.parametrize(("name", "value"), [("number", 300), ("number", -1), ("flight_height_m", 0.2)])
def test_impossible_parameters_are_refused(name: str, value: float) -> None:
    with pytest.raises(ConfigError, match=name):
        Barn(**{name: value})
