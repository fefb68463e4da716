"""Movers: where they may be, how they go on, and what is refused."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from tests.logs import make_world
from uavexp.bodies import present
from uavexp.errors import ConfigError, UavexpError, WorldError
from uavexp.movers.mixed import Mixed
from uavexp.movers.recorded import Recorded
from uavexp.scene import Scene
from uavexp.seeding import Stream, generator
from uavexp.types import Limits, Shape
from uavexp.world.boxes import Boxes

LIMITS = Limits(
    max_speed_mps=2.5, max_acceleration_mps2=2.5, max_body_rate_radps=2.0, body_size_m=(0.32, 0.32, 0.12)
)
SIZE_M = (12.0, 9.0, 3.0)
PILLARS = [
    ((4.0, 3.0, 0.0), (4.6, 3.6, 3.0)),
    ((8.0, 5.0, 0.0), (8.5, 6.5, 3.0)),
    ((3.0, 7.0, 0.0), (6.0, 7.2, 3.0)),
]


@pytest.fixture(scope="module")
def room():
    made = Boxes()
    made.shell(SIZE_M)
    for low, high in PILLARS:
        made.span(low, high)
    vertices, triangles = made.mesh()
    world = make_world(
        [([0, 0, 0], [1, 1, 1])], size_m=SIZE_M, start_m=(1.0, 4.5, 1.2), target_m=(11.0, 4.5, 1.2)
    )
    world = dataclasses.replace(world, vertices_m=vertices, triangles=triangles)
    return world, Scene(world)


def begin(movers, room, seed=3):
    movers.reset(*room, LIMITS, generator(seed, Stream.MOVERS))
    return movers


def positions(movers, seconds=20.0):
    return np.stack([movers.at(0.01 * k).position_m for k in range(round(100 * seconds))])


ONE_KIND = {
    "linear": {"linear_share": 1.0, "circular_share": 0.0},
    "circular": {"linear_share": 0.0, "circular_share": 1.0},
    "accelerated": {"linear_share": 0.0, "circular_share": 0.0},
}


@pytest.mark.parametrize("kind", ONE_KIND)
def test_movers_stay_out_of_walls_and_inside_the_flight_area(kind, room):
    world, scene = room
    movers = begin(Mixed(**ONE_KIND[kind]), room)
    for k in range(0, 3000, 7):
        bodies = movers.at(0.01 * k)
        for centre, half in zip(bodies.position_m, bodies.half_size_m, strict=True):
            assert not scene.touches_fixed(centre, np.eye(3), 2.0 * half)
            assert (centre[:2] - half[:2] >= world.flight_bounds_m[0, :2] - 1e-9).all()
            assert (centre[:2] + half[:2] <= world.flight_bounds_m[1, :2] + 1e-9).all()


@pytest.mark.parametrize("kind", ONE_KIND)
def test_velocity_is_the_derivative_of_the_position_and_never_too_fast(kind, room):
    movers = begin(Mixed(**ONE_KIND[kind]), room)
    bodies = [movers.at(0.01 * k) for k in range(2000)]
    position = np.stack([b.position_m for b in bodies])
    velocity = np.stack([b.velocity_mps for b in bodies])
    speed = np.linalg.norm(velocity, axis=2)
    assert speed.max() <= 1.5 + 1e-9
    assert np.linalg.norm(np.diff(position, axis=0), axis=2).max() <= 0.015 + 1e-9
    error = np.abs(np.diff(position, axis=0) / 0.01 - velocity[:-1]).max(axis=2)
    assert (error < 0.03).mean() > 0.98  # but for the rows in which they rebound
    if kind == "linear":  # damped: never faster than before, and slower after some rebound
        assert np.diff(speed, axis=0).max() < 1e-9
        assert (speed[-1] < 0.95 * speed[0]).any()
    if kind == "circular":
        np.testing.assert_allclose(speed, np.broadcast_to(speed[0], speed.shape), rtol=1e-6)
    if kind == "accelerated":
        assert (speed.max(axis=0) > 1.02 * speed.min(axis=0)).all()


def test_circles_are_circles(room):
    position = positions(begin(Mixed(**ONE_KIND["circular"]), room), 40.0)
    for b in range(position.shape[1]):
        xy = position[:, b, :2]
        solution = np.linalg.lstsq(np.c_[2.0 * xy, np.ones(len(xy))], (xy**2).sum(axis=1), rcond=None)[0]
        radius = np.sqrt(solution[2] + solution[:2] @ solution[:2])
        np.testing.assert_allclose(np.linalg.norm(xy - solution[:2], axis=1), radius, atol=1e-6)
        assert 0.6 <= radius <= 2.0


def test_none_starts_near_the_start_nor_in_another(room):
    world, _ = room
    for seed in range(20):
        bodies = begin(Mixed(count=6), room, seed).at(0.0)
        away = np.linalg.norm(bodies.position_m[:, :2] - world.start_m[:2], axis=1)
        assert (away - np.linalg.norm(bodies.half_size_m[:, :2], axis=1) > 1.25 + 0.75).all()
        for a in range(6):
            for b in range(a):
                gap = (
                    np.abs(bodies.position_m[a] - bodies.position_m[b])
                    - bodies.half_size_m[a]
                    - bodies.half_size_m[b]
                )
                assert gap.max() > 0.0


def test_people_and_boxes_stand_on_the_floor_and_all_kinds_come(room):
    bodies = begin(Mixed(count=12, start_margin_m=0.2), room).at(0.0)
    stands = bodies.shape != Shape.SPHERE
    feet = (bodies.position_m - bodies.half_size_m)[stands, 2]
    np.testing.assert_allclose(feet, 0.02, atol=1e-5)
    people = bodies.shape == Shape.CYLINDER
    np.testing.assert_allclose(2.0 * bodies.half_size_m[people, 2], 1.7)
    assert set(bodies.shape.tolist()) == {0, 1, 2}


def test_motion_is_a_function_of_time_alone_and_of_the_seed(room):
    forward = positions(begin(Mixed(), room, 5), 25.0)
    movers = begin(Mixed(), room, 5)
    for k in (2400, 3, 1500, 0):
        np.testing.assert_array_equal(movers.at(0.01 * k).position_m, forward[k])
    assert not np.array_equal(begin(Mixed(), room, 6).at(0.0).position_m, forward[0])
    between = movers.at(0.015)
    np.testing.assert_allclose(between.position_m, 0.5 * (forward[1] + forward[2]), atol=1e-4)


@pytest.mark.parametrize(
    "wrong",
    [
        {"count": 0},
        {"speed_mps": (1.0, 0.5)},
        {"speed_mps": (0.0, 1.0)},
        {"box_width_m": (0.3,)},
        {"restitution": 1.1},
        {"linear_share": 0.9},
        {"person_share": -0.1},
        {"person_height_m": float("nan")},
        {"start_margin_m": -1.0},
    ],
    ids=str,
)
def test_bad_parameters_are_refused_by_name(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        Mixed(**wrong)


def test_movers_faster_than_the_vehicle_are_refused(room):
    with pytest.raises(ConfigError, match=r"at most the vehicle's 2\.5 m/s, got 2\.6"):
        begin(Mixed(speed_mps=(0.5, 2.6)), room)


def test_more_movers_than_there_is_room_for_are_refused_in_one_line(room):
    with pytest.raises(WorldError, match=r"no room for number \d+ of 200"):
        begin(Mixed(count=200, box_width_m=(1.0, 1.0), sphere_share=0.0, person_share=0.0), room)


# --- recorded -------------------------------------------------------------------------------------


def recording(tmp_path: Path, *lines: str, header: str = "t_s,id,x_m,y_m") -> str:
    file = tmp_path / "people.csv"
    file.write_text("\n".join([header, *lines]) + "\n")
    return str(file)


def walk(identity: str, *, first_s=0.0, seconds=30.0, x_m=0.0, y_m=0.0, vx=0.0, vy=0.0, every_s=0.4):
    times = np.arange(0.0, seconds, every_s)
    return [f"{first_s + t:.3f},{identity},{x_m + vx * t:.4f},{y_m + vy * t:.4f}" for t in times]


CORNERS = ["0.0,a,0.0,0.0", "0.4,a,0.1,0.0", "0.0,b,5.0,5.0", "0.4,b,5.0,5.1"]  # the area of a recording


def test_people_walk_as_recorded_between_and_at_the_samples(tmp_path, room):
    lines = walk("w", x_m=2.0, y_m=1.0, vx=0.2, vy=0.1)
    movers = begin(
        Recorded(path=recording(tmp_path, *lines), quarter_turns=0, begin_s=0.0, duration_s=25.0), room
    )
    there = positions(movers, 20.0)[:, 0]
    assert present(there).mean() > 0.5
    inside = present(there[1:]) & present(there[:-1])
    np.testing.assert_allclose(
        np.diff(there, axis=0)[inside] / 0.01, np.tile([0.2, 0.1, 0.0], (inside.sum(), 1)), atol=1e-6
    )
    bodies = movers.at(0.0)
    assert bodies.shape.tolist() == [Shape.CYLINDER]
    np.testing.assert_allclose(bodies.half_size_m, [[0.25, 0.25, 0.85]])


@pytest.mark.parametrize("turns", [0, 1, 2, 3])
def test_a_turn_and_a_shift_keep_all_distances(tmp_path, room, turns):
    lines = [*walk("p", x_m=0.0), *walk("q", x_m=1.0, y_m=2.0)]
    movers = begin(
        Recorded(path=recording(tmp_path, *lines), quarter_turns=turns, begin_s=0.0, settled_s=0.0),
        room,
        seed=1,
    )
    bodies = movers.at(5.0)
    here = bodies.position_m[present(bodies.position_m)]
    assert len(here) == 2
    assert np.linalg.norm(here[0] - here[1]) == pytest.approx(np.sqrt(5.0))


def test_a_long_gap_makes_a_person_absent_and_a_short_one_does_not(tmp_path, room):
    early, late = walk("g", seconds=4.1), walk("g", first_s=8.0, seconds=4.1)
    for gap_s, expected in ((1.0, False), (5.0, True)):
        path = recording(tmp_path, *early, *late)
        movers = begin(
            Recorded(path=path, begin_s=0.0, quarter_turns=0, longest_gap_s=gap_s, settled_s=0.0), room
        )
        person = present(positions(movers, 12.0))[:, 0]
        assert person[100]
        assert person[600] == expected
        assert person[1000]


def test_people_are_absent_where_there_is_no_room(tmp_path, room):
    _, scene = room
    lines = [line for n in range(12) for line in walk(f"p{n}", x_m=0.9 * n, y_m=0.0, vy=0.25)]
    movers = begin(Recorded(path=recording(tmp_path, *lines), quarter_turns=0, begin_s=0.0), room)
    seen = 0
    for k in range(0, 2900, 10):
        bodies = movers.at(0.01 * k)
        for centre, half in zip(bodies.position_m, bodies.half_size_m, strict=True):
            if present(centre):
                seen += 1
                assert not scene.touches_fixed(centre, np.eye(3), 2.0 * half - 0.03)
    assert seen > 500
    assert not present(positions(movers, 29.0)).all()


def test_nobody_is_near_the_start_at_first_nor_too_fast(tmp_path, room):
    world, _ = room
    lines = [
        *walk("still", x_m=0.0),
        *walk("fast", x_m=1.0, vx=2.7, seconds=3.0),
        *walk("far", x_m=9.0, y_m=6.0),
        *walk("late", first_s=4.0, x_m=4.0, y_m=2.0),
        *walk("later", first_s=5.0, x_m=6.0, y_m=4.5),
    ]
    for seed in range(10):
        movers = begin(Recorded(path=recording(tmp_path, *lines), begin_s=0.0), room, seed)
        for k in range(0, 300, 10):
            bodies = movers.at(0.01 * k)
            here = bodies.position_m[present(bodies.position_m)]
            assert (np.linalg.norm(here[:, :2] - world.start_m[:2], axis=1) - 0.25 > 1.25 + 0.75).all()
            assert np.linalg.norm(bodies.velocity_mps, axis=1).max() < 2.5


def test_the_recording_begins_anew_after_its_duration(tmp_path, room):
    lines = [*walk("w", x_m=0.0, vx=0.1), *walk("v", x_m=4.0, y_m=3.0)]
    movers = begin(Recorded(path=recording(tmp_path, *lines), begin_s=0.0, duration_s=10.0), room)
    np.testing.assert_array_equal(movers.at(3.2).position_m, movers.at(13.2).position_m)
    assert movers.at(13.2).time_s == 13.2


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        (
            ["0.0,a,0.0,0.0", "0.0,a,1.0,1.0"],
            r"people.csv:3: person a is at 0 s in another place than in line 2",
        ),
        (["0.0,a,0.0,0.0", "0.4,a,nan,1.0"], r"people.csv:3: x_m must be a finite number, got 'nan'"),
        (["0.0,a,0.0,0.0", "inf,a,0.0,1.0"], r"people.csv:3: t_s must be a finite number"),
        (["0.0,a,0.0,left"], r"people.csv:2: y_m must be a finite number, got 'left'"),
        (["0.0,a,0.0"], r"people.csv:2: 4 columns are needed, got 3"),
        ([], r"no rows"),
    ],
)
def test_bad_tracks_are_refused_with_file_and_line(tmp_path, room, lines, says):
    with pytest.raises(WorldError, match=says):
        begin(Recorded(path=recording(tmp_path, *lines)), room)


def test_bad_files_and_missing_people_are_refused(tmp_path, room):
    with pytest.raises(WorldError, match="y_m missing"):
        begin(Recorded(path=recording(tmp_path, "0,a,0", header="t_s,id,x_m")), room)
    with pytest.raises(WorldError, match="cannot be read"):
        begin(Recorded(path=str(tmp_path / "none.csv")), room)
    with pytest.raises(WorldError, match="nobody of"):
        begin(Recorded(path=recording(tmp_path, *CORNERS), begin_s=1000.0), room)
    with pytest.raises(ConfigError, match="path must be the name of a file of tracks"):
        Recorded(path="")


@pytest.mark.parametrize(
    "wrong",
    [{"scale": 0.0}, {"duration_s": 1e9}, {"quarter_turns": 4}, {"longest_gap_s": float("nan")}],
    ids=str,
)
def test_bad_recorded_parameters_are_refused_by_name(wrong):
    with pytest.raises(UavexpError, match=next(iter(wrong))):
        Recorded(path="people.csv", **wrong)
