"""What every generated family promises, checked through the scene, not the generator's lattice."""

import functools
import importlib

import numpy as np
import pytest

from uavexp.errors import ConfigError, WorldError
from uavexp.scene import Scene
from uavexp.seeding import Stream, generator
from uavexp.types import World
from uavexp.world.corridors import Corridors
from uavexp.world.facility import Facility
from uavexp.world.random_columns import RandomColumns
from uavexp.world.rooms import Rooms
from uavexp.world.tunnel import Tunnel
from uavexp.world.warehouse import Warehouse

FAMILIES = (Warehouse, Corridors, Rooms, RandomColumns, Facility, Tunnel)


def draw(family: type, seed: int, **parameters: object) -> World:
    return family(**parameters).generate(generator(seed, Stream.WORLD))


usual = functools.cache(draw)  # by family and seed


@pytest.fixture(scope="module", params=[(f, s) for f in FAMILIES for s in range(4)], ids=str)
def drawn(request: pytest.FixtureRequest) -> World:
    return usual(*request.param)


def test_start_and_target_are_joined_with_the_clearance(drawn: World) -> None:
    scene, path = Scene(drawn), drawn.shortest_path
    np.testing.assert_array_equal(path[[0, -1]], [drawn.start_m, drawn.target_m])
    count = np.maximum(2, np.linalg.norm(np.diff(path, axis=0), axis=1) / 0.005).astype(int)
    points = np.concatenate([np.linspace(a, b, n) for a, b, n in zip(path, path[1:], count, strict=False)])
    assert scene.distance_m(points).min() >= 0.45 - 1e-5
    assert (points >= drawn.flight_bounds_m[0]).all()
    assert (points <= drawn.flight_bounds_m[1]).all()


def test_the_task_crosses_the_world_at_the_flight_height(drawn: World) -> None:
    extent = np.diff(drawn.flight_bounds_m, axis=0)[0, :2]
    straight = np.linalg.norm(drawn.target_m - drawn.start_m)
    assert drawn.start_m[2] == drawn.target_m[2] == 1.2
    assert straight >= 0.7 * np.hypot(*extent)
    assert drawn.difficulty.straight_line_m == pytest.approx(straight)
    assert drawn.difficulty.shortest_path_m >= straight - 1e-9
    bearing = np.arctan2(*(drawn.target_m - drawn.start_m)[1::-1])
    assert drawn.start_yaw_rad == pytest.approx(bearing)


def test_the_world_is_closed_and_inside_the_map(drawn: World) -> None:
    assert (drawn.vertices_m >= drawn.bounds_m[0]).all()
    assert (drawn.vertices_m <= drawn.bounds_m[1]).all()
    direction = np.random.default_rng(0).normal(size=(3000, 3))
    rays = np.hstack([np.broadcast_to(drawn.start_m, direction.shape), direction])
    t, _ = Scene(drawn).cast(rays.astype(np.float32))
    assert np.isfinite(t).all()


def test_every_gap_on_the_path_lets_the_clearance_through(drawn: World) -> None:
    assert drawn.difficulty.narrowest_gap_m >= 2.0 * 0.45 - 1e-4
    assert 0.0 < drawn.difficulty.clutter_density < 0.7


@pytest.mark.parametrize("family", FAMILIES)
def test_the_same_seed_gives_the_same_world_and_another_seed_another(family: type) -> None:
    one, again, other = usual(family, 0), draw(family, 0), usual(family, 1)
    assert one.digest == again.digest
    assert one.vertices_m.tobytes() == again.vertices_m.tobytes()
    assert one.shortest_path.tobytes() == again.shortest_path.tobytes()
    assert one.difficulty == again.difficulty
    assert one.digest != other.digest


@pytest.mark.parametrize("family", FAMILIES)
def test_size_is_the_inner_size(family: type) -> None:
    world = draw(family, 0, size_m=[18, 12, 3.2])
    np.testing.assert_allclose(world.flight_bounds_m, [[0.3, 0.3, 0.4], [17.7, 11.7, 2.8]])
    straight_up = np.array([[*world.start_m, 0.0, 0.0, 1.0]], dtype=np.float32)
    top = world.start_m[2] + Scene(world).cast(straight_up)[0][0]
    assert top <= 3.2 + 1e-5


@pytest.mark.parametrize(
    ("family", "name", "sparse", "dense"),
    [
        (RandomColumns, "density_per_m2", 0.05, 0.5),
        (Warehouse, "clutter_per_m2", 0.0, 0.15),
        (Corridors, "loop_share", 1.0, 0.0),
        (Rooms, "furniture_per_m2", 0.0, 0.4),
    ],
)
def test_clutter_grows_with_the_density_parameter(
    family: type, name: str, sparse: float, dense: float
) -> None:
    def mean(value: float) -> float:
        return float(
            np.mean([draw(family, seed, **{name: value}).difficulty.clutter_density for seed in range(3)])
        )

    assert mean(dense) > mean(sparse) + 0.005


def test_sight_from_start_to_target_is_usually_blocked() -> None:
    blocked = 0
    for family in FAMILIES:
        for seed in range(3):
            world = usual(family, seed)
            ray = np.hstack([world.start_m, world.target_m - world.start_m])[None]
            blocked += int(Scene(world).cast(ray.astype(np.float32))[0][0] < 1.0)
    assert blocked >= 9  # of 12


@pytest.mark.parametrize(
    ("family", "parameters", "advice"),
    [
        (RandomColumns, {"density_per_m2": 5.0, "gap_m": 0.0, "size_m": [8.0, 6.0, 3.0]}, "density_per_m2"),
        (Warehouse, {"aisle_m": 0.92, "clutter_per_m2": 1.0}, "aisle_m"),
        (Rooms, {"door_height_m": 1.3}, "door_width_m"),
        (Corridors, {"doorway_share": 1.0, "doorway_width_m": 0.5, "loop_share": 0.0}, "doorway_width_m"),
    ],
)
def test_what_cannot_be_joined_is_an_error_that_names_the_parameter(
    family: type, parameters: dict[str, float], advice: str
) -> None:
    with pytest.raises(WorldError, match=advice) as error:
        draw(family, 0, **parameters)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize(
    "parameters",
    [
        {"size_m": [26.0, 16.0]},
        {"size_m": [26.0, -16.0, 3.0]},
        {"size_m": [26.0, float("nan"), 3.0]},
        {"size_m": [1.0, 16.0, 3.0]},
        {"size_m": [1e6, 16.0, 3.0]},
        {"size_m": [26.0, 16.0, 1e7]},
        {"flight_height_m": 2.9},
        {"flight_height_m": float("nan")},
        {"clearance_m": 0.0},
        {"clearance_m": float("inf")},
    ],
    ids=str,
)
def test_impossible_common_parameters_are_refused(family: type, parameters: dict[str, object]) -> None:
    with pytest.raises(ConfigError, match=r"size_m|flight_height_m|clearance_m|aisle_m|corridor_m|door"):
        family(**parameters)


@pytest.mark.parametrize(
    ("option", "name", "value"),
    [
        ("warehouse", "aisle_m", 0.5),
        ("warehouse", "load_share", 1.5),
        ("warehouse", "clutter_per_m2", -0.1),
        ("warehouse", "cross_aisles", -1),
        ("corridors", "corridor_m", 0.5),
        ("corridors", "loop_share", -0.1),
        ("corridors", "clutter_per_passage", float("nan")),
        ("rooms", "room_m", 1.0),
        ("rooms", "door_width_m", 0.5),
        ("rooms", "table_share", 2.0),
        ("random_columns", "width_m", [1.0, 0.5]),
        ("random_columns", "row", 0),
        ("random_columns", "density_per_m2", float("nan")),
    ],
)
def test_impossible_family_parameters_are_refused(option: str, name: str, value: object) -> None:
    module = importlib.import_module(f"uavexp.world.{option}")
    family = getattr(module, "".join(part.capitalize() for part in option.split("_")))
    with pytest.raises(ConfigError, match=name):
        family(**{name: value})
