"""Start and target lie in measured free space inside the building, or are refused with a place that does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.folders import DATA
from uavexp.errors import WorldError
from uavexp.space import FREE, OUTSIDE
from uavexp.types import World
from uavexp.world.boxes import Boxes
from uavexp.world.file import File
from uavexp.world.survey import drawn_ends


def slam_map(folder: Path, shade: int = 205, rooms: bool = True) -> Path:
    """A room of 10 m by 6 m, measured, and another of 4 m by 3 m, in a map of 30 m by 20 m."""
    image = np.full((200, 300), shade, dtype=np.uint8)
    for left, low, wide, high in [(100, 60, 100, 60), (30, 120, 40, 30)][: 2 if rooms else 1]:
        image[low - 1 : low + high + 1, left - 1 : left + wide + 1] = 0
        image[low : low + high, left : left + wide] = 254
    (folder / "slam.pgm").write_bytes(b"P5\n300 200\n255\n" + image[::-1].tobytes())
    path = folder / "slam.yaml"
    path.write_text(
        "image: slam.pgm\nresolution: 0.1\norigin: [0.0, 0.0, 0.0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    return path


def obj(folder: Path, boxes: Boxes, shift_m: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Path:
    vertices, triangles = boxes.mesh()
    lines = ["v {:.6f} {:.6f} {:.6f}".format(*(v + np.array(shift_m))) for v in vertices.astype(float)]
    lines += ["f {} {} {}".format(*(t + 1)) for t in triangles]
    path = folder / "house.obj"
    path.write_text("\n".join(lines))
    return path


def house(*, yard: bool = False, floor_m: float = 0.0) -> Boxes:
    """Two rooms of 12 m by 8 m and 4 m by 8 m, not joined, and a yard around them."""
    boxes = Boxes()
    boxes.span((0.0, 0.0, floor_m), (16.0, 8.0, floor_m + 3.0))
    boxes.span((12.0, 0.0, floor_m), (12.2, 8.0, floor_m + 3.0))
    if yard:
        boxes.span((-8.0, -8.0, floor_m - 0.2), (20.0, 12.0, floor_m - 0.1))
    return boxes


def made(path: Path, seed: int = 0, **options: object) -> World:
    return File(path=str(path), **options).generate(np.random.default_rng(seed))  # type: ignore[arg-type]


@pytest.mark.parametrize("unknown", ["wall", "free"])
def test_nothing_starts_or_ends_where_a_map_was_never_measured(tmp_path: Path, unknown: str) -> None:
    file = File(path=str(slam_map(tmp_path)), unknown=unknown)  # type: ignore[arg-type]
    survey = file.survey()
    for seed in range(25):
        ends = np.array(drawn_ends(survey, None, 8.0, np.random.default_rng(seed)))
        assert (np.abs(ends[:, :2] - [15.0, 9.0]) <= [4.66, 2.66]).all()
        assert (ends[:, 2] == 1.2).all()
    notes = file.generate(np.random.default_rng(0)).notes
    assert any("87 % of the map was never measured" in note for note in notes)
    assert sum("1 other free part is not joined" in note for note in notes) == 1


def test_the_yard_is_no_place_to_start_unless_nothing_is_enclosed(tmp_path: Path) -> None:
    path = obj(tmp_path, house(yard=True))
    world = made(path)
    assert world.space.state_at(np.array([world.start_m, world.target_m, [-4.0, 4.0, 1.2]])).tolist() == [
        FREE,
        FREE,
        OUTSIDE,
    ]
    assert max(world.start_m[0], world.target_m[0]) < 12.0  # the larger room
    assert any("1 other free part is not joined with the largest" in note for note in world.notes)
    given = made(path, start_m=(-4.0, 4.0, 1.2), target_m=(8.0, -5.0, 1.2))
    assert given.start_m.tolist() == [-4.0, 4.0, 1.2]
    field = made(
        slam_map(tmp_path, shade=254, rooms=False), flight_bounds_m=((0.3, 0.3, 0.4), (8.0, 19.0, 2.1))
    )
    assert any("no walls enclose" in note for note in field.notes)


@pytest.mark.parametrize(
    ("start", "why"),
    [
        ((1.0, 1.0, 1.2), "never measured"),
        ((10.1, 9.0, 1.2), r"clearance is 0\.10 m"),
        ((9.95, 9.0, 1.2), "inside a solid"),
    ],
)
def test_a_given_end_that_is_not_free_is_refused_with_the_nearest_place_that_is(
    tmp_path: Path, start: tuple[float, float, float], why: str
) -> None:
    path = slam_map(tmp_path)
    with pytest.raises(WorldError, match=why) as refused:
        made(path, start_m=start, target_m=(18.0, 9.0, 1.2))
    near = tuple(float(x) for x in str(refused.value).rpartition("world.start_m=[")[2].rstrip("]").split(","))
    world = made(path, start_m=near, target_m=(18.0, 9.0, 1.2))
    assert world.space.is_inside(world.start_m[None]).all()


def test_drawn_ends_fly_above_the_floor_wherever_it_lies(tmp_path: Path) -> None:
    world = made(obj(tmp_path, house(floor_m=4.25)))
    assert world.start_m[2] == world.target_m[2] == pytest.approx(5.45)
    with pytest.raises(WorldError, match=r"most room is at world\.flight_height_m=5\.\d\d"):
        made(obj(tmp_path, house(floor_m=4.25)), flight_height_m=1.2)


def test_a_far_origin_is_taken_off_and_given_places_stay_the_files_own(tmp_path: Path) -> None:
    near = made(obj(tmp_path, house()), 3)
    far_m = (500_000.0, 4_649_776.0, 301.0)
    path = obj(tmp_path, house(), far_m)
    world = made(path, 3)
    assert any("far origin [500000,4649776,301] m" in note for note in world.notes)
    np.testing.assert_allclose(world.start_m, near.start_m, atol=1e-6)
    given = made(
        path,
        start_m=(500_001.0, 4_649_777.0, 302.2),
        target_m=(500_010.0, 4_649_780.0, 302.2),
        flight_bounds_m=((500_000.3, 4_649_776.3, 301.4), (500_011.0, 4_649_783.0, 303.0)),
    )
    np.testing.assert_allclose(given.start_m, [1.0, 1.0, 1.2], atol=1e-6)
    with pytest.raises(WorldError, match=r"start_m \[500001,4649777,310\] lies outside"):
        made(path, start_m=(500_001.0, 4_649_777.0, 310.0), target_m=(500_010.0, 4_649_780.0, 302.2))


def test_a_door_is_passed_at_exactly_half_its_width(tmp_path: Path) -> None:
    boxes = Boxes()
    boxes.shell((10.0, 6.0, 2.6))
    boxes.span((5.0, 0.0, 0.0), (5.15, 2.137, 2.6))
    boxes.span((5.0, 2.887, 0.0), (5.15, 6.0, 2.6))  # a door of 0.75 m
    ends = {"start_m": (1.0, 3.0, 1.2), "target_m": (9.0, 3.0, 1.2)}
    path = obj(tmp_path, boxes)
    made(path, clearance_m=0.37, **ends)
    assert made(path, clearance_m=0.375, **ends).difficulty.narrowest_gap_m == pytest.approx(0.75, abs=0.01)
    with pytest.raises(WorldError, match=r"joined at 0\.37\d m: world\.clearance_m=0\.37"):
        made(path, clearance_m=0.38, **ends)


def test_the_test_flat_is_one_part() -> None:
    assert made(DATA / "flat.ply", least_distance_m=4.0).notes == ()
