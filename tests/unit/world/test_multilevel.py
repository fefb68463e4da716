"""The hall of several storeys, and voxels of the true geometry."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from uavexp.errors import ConfigError, WorldError
from uavexp.scene import Scene
from uavexp.seeding import Stream, generator
from uavexp.types import World
from uavexp.world.boxes import Boxes
from uavexp.world.multilevel import Multilevel
from uavexp.world.voxel_model import inflate, voxel_model


def draw(seed: int, **parameters: object) -> World:
    return Multilevel(**parameters).generate(generator(seed, Stream.WORLD))  # type: ignore[arg-type]


@pytest.fixture(scope="module", params=range(3))
def drawn(request: pytest.FixtureRequest) -> World:
    return draw(request.param)


def test_start_and_target_are_joined_with_the_clearance(drawn: World) -> None:
    path = drawn.shortest_path
    np.testing.assert_array_equal(path[[0, -1]], [drawn.start_m, drawn.target_m])
    points = np.concatenate([np.linspace(a, b, 200) for a, b in pairwise(path)])
    assert Scene(drawn).distance_m(points).min() >= 0.4 - 1e-5
    assert ((points >= drawn.flight_bounds_m[0]) & (points <= drawn.flight_bounds_m[1])).all()


def test_the_task_leads_from_the_lowest_to_the_highest_storey(drawn: World) -> None:
    decks = Multilevel().deck_heights_m()
    assert drawn.start_m[2] == pytest.approx(decks[0] + 1.1)
    assert drawn.target_m[2] == pytest.approx(decks[3] + 1.1)
    assert np.linalg.norm((drawn.target_m - drawn.start_m)[:2]) > 6.0
    assert drawn.difficulty.detour > 1.05


def test_every_deck_closes_the_hall_but_for_its_hatches(drawn: World) -> None:
    scene, shape = Scene(drawn), (120, 60)
    x, y = (np.linspace(0.05, size - 0.05, n) for size, n in zip((12.78, 6.06), shape, strict=True))
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    for top in Multilevel().deck_heights_m()[1:]:
        rays = np.zeros((len(grid), 6), dtype=np.float32)
        rays[:, :2], rays[:, 2], rays[:, 5] = grid, top + 0.01, -1.0
        open_share = np.mean(scene.cast(rays)[0] > 0.1)
        hatch = 2 * 1.6 * (6.06 - 2 * 0.8) / 3.0 / (12.78 * 6.06)  # two of them, an aisle wide
        assert 0.5 * hatch < open_share <= 1.05 * hatch


def test_the_world_is_closed_and_inside_the_map(drawn: World) -> None:
    assert (drawn.vertices_m >= drawn.bounds_m[0]).all()
    assert (drawn.vertices_m <= drawn.bounds_m[1]).all()
    direction = np.random.default_rng(0).normal(size=(2000, 3))
    rays = np.hstack([np.broadcast_to(drawn.start_m, direction.shape), direction])
    assert np.isfinite(Scene(drawn).cast(rays.astype(np.float32))[0]).all()


def test_a_seed_is_a_world() -> None:
    assert draw(5).digest == draw(5).digest != draw(6).digest


@pytest.mark.parametrize(
    "parameters",
    [
        {"storeys": 1},
        {"racks": 9},
        {"hatches": 0},
        {"hatch_m": 0.5},
        {"load_share": 1.2},
        {"flight_height_m": 1.9},
        {"shelf_pitch_m": 0.01},
        {"size_m": [12.0, 6.0]},
        {"rack_depth_m": float("nan")},
    ],
    ids=str,
)
def test_impossible_parameters_are_refused(parameters: dict[str, object]) -> None:
    name = next(iter(parameters))
    with pytest.raises(ConfigError, match=name):
        Multilevel(**parameters)  # type: ignore[arg-type]


def test_what_cannot_be_joined_is_an_error_that_names_the_parameter() -> None:
    with pytest.raises(WorldError, match="hatch_m"):
        draw(0, hatch_m=0.801, hatches=1, storeys=2, racks=1, size_m=[6.0, 4.0, 4.4])


def box_world(base: World) -> World:
    """A room of 2 x 1.5 x 1 m with one box in it."""
    boxes = Boxes()
    boxes.shell((2.0, 1.5, 1.0))
    boxes.span((0.63, 0.33, 0.0), (1.17, 0.87, 0.57))
    vertices, triangles = boxes.mesh()
    return replace(
        base,
        vertices_m=vertices,
        triangles=triangles,
        bounds_m=np.array([[0.0, 0.0, 0.0], [2.0, 1.5, 1.0]]),
        start_m=np.array([0.25, 0.25, 0.75]),
    )


def test_voxels_of_a_box_are_those_that_it_enters(drawn: World) -> None:
    occupied, origin = voxel_model(box_world(drawn), 0.1)
    assert occupied.shape == (20, 15, 10)
    np.testing.assert_array_equal(origin, 0.0)
    expected = np.zeros_like(occupied)
    expected[6:12, 3:9, 0:6] = True
    inner = (slice(1, -1),) * 3  # walls lie on the outermost faces
    np.testing.assert_array_equal(occupied[inner], expected[inner])


def test_voxels_agree_with_the_distance_to_the_surface(drawn: World) -> None:
    occupied, origin = voxel_model(drawn, 0.15)
    scene = Scene(drawn)
    cells = np.random.default_rng(1).integers(0, occupied.shape, (4000, 3))
    distance = scene.distance_m(origin + (cells + 0.5) * 0.15)
    state = occupied[tuple(cells.T)]
    assert state[distance < 0.07].all()  # a surface nearer than half an edge is inside
    free = distance > 0.5 * np.sqrt(3.0) * 0.15 + 0.001
    corner = drawn.flight_bounds_m
    centre = origin + (cells + 0.5) * 0.15
    in_air = free & ((centre > corner[0]) & (centre < corner[1])).all(axis=1)
    assert not state[in_air].all()
    assert occupied.mean() < 0.6


def test_inflation_is_the_exact_distance(drawn: World) -> None:
    occupied = np.random.default_rng(0).random((20, 18, 16)) > 0.99
    for radius in (1.0, 2.5, 4.0):
        np.testing.assert_array_equal(inflate(occupied, radius), distance_transform_edt(~occupied) < radius)


def test_voxels_that_are_too_many_or_none_are_refused(drawn: World) -> None:
    for size in (0.0, 1e-4, 50.0):
        with pytest.raises(ConfigError, match="voxel_size_m"):
            voxel_model(drawn, size)
