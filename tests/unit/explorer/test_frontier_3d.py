"""Places show what they are chosen for, ways to them were seen, and looking in vain comes to an end."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from uavexp.arrays import Bool, Float, Int
from uavexp.check.fields import empty, field_from
from uavexp.check.hall import LIMITS, hovering, observe
from uavexp.explorer.frontier_3d import Frontier3d
from uavexp.explorer.volume.route import Ways
from uavexp.field import UNKNOWN, DistanceField
from uavexp.types import Goal, Observation

SIZE_M = (8.0, 6.0, 5.6)
BOUNDS_M = np.array([[0.4, 0.4, 0.4], [7.6, 5.6, 5.2]])
START_M = (1.5, 3.0, 1.2)
ABOVE_M = np.array([1.5, 3.0, 4.2])


def storeys(known_above: float, hatch: bool = True) -> DistanceField:
    """Two storeys with a hatch in the deck between, the upper one seen up to this height over the deck."""
    grid, unknown = empty(SIZE_M), empty(SIZE_M)
    grid[[0, -1]], grid[:, [0, -1]], grid[:, :, [0, -1]] = True, True, True
    grid[:, :, 27] = True
    if hatch:
        grid[45:63, 22:40, 27] = False
    unknown[:, :, 28 + round(known_above / 0.1) :] = True
    if hatch and known_above == 0.0:  # what is in the hatch was seen
        unknown[45:63, 22:40, 28:30] = False
    return field_from(grid & ~unknown, unknown=unknown, max_distance_m=2.0)


def at(
    field: DistanceField, position_m: tuple[float, float, float], time_s: float = 0.0, *,
    yaw_rad: float = 0.0, target_m: Float | None = None,
) -> Observation:  # fmt: skip
    return replace(
        observe(field, time_s=time_s),
        state=hovering(position_m, yaw_rad),
        target_m=target_m,
        flight_bounds_m=BOUNDS_M,
        trajectory=None,
    )


def begun(**parameters: float) -> Frontier3d:
    explorer = Frontier3d(**parameters)
    explorer.reset(1.2, LIMITS)
    return explorer


def chosen(explorer: Frontier3d, seen: Observation) -> Goal:
    goal = explorer.select(seen, fresh=True)
    assert goal is not None
    return goal


def in_sight(field: DistanceField, eye_m: Float, cells_m: Float, near_m: float = 0.3) -> Bool:
    """Whether the lines to points (N, 3), but for their last part, lead through what was seen and is free."""
    found = []
    for cell_m in cells_m:
        away_m = float(np.linalg.norm(cell_m - eye_m))
        line = eye_m + np.linspace(0.0, max(away_m - near_m, 0.0), 60)[:, None] * (cell_m - eye_m) / away_m
        found.append(bool(field.observed(line).all() and (field.distance_m(line) > -0.05).all()))
    return np.array(found)


@pytest.mark.parametrize("with_target", [True, False])
def test_a_level_camera_looks_into_a_hatch_from_beside_it(with_target: bool) -> None:
    field, explorer = storeys(0.0), begun()
    goal = chosen(explorer, at(field, START_M, target_m=ABOVE_M if with_target else None))
    choice = explorer._choice
    assert choice is not None
    assert len(choice.cells)
    cells_m = explorer._space.cells.centre_m(choice.cells) if explorer._space else np.zeros((0, 3))
    ahead = cells_m - choice.place_m
    depth = ahead[:, 0] * math.cos(choice.yaw_rad) + ahead[:, 1] * math.sin(choice.yaw_rad)
    left = ahead[:, 1] * math.cos(choice.yaw_rad) - ahead[:, 0] * math.sin(choice.yaw_rad)
    assert (depth > 0.0).all()
    assert (np.abs(left) <= depth * math.tan(math.radians(45.0)) + 1e-9).all()
    assert (np.abs(ahead[:, 2]) <= depth * math.tan(math.radians(36.8)) + 1e-9).all()
    assert in_sight(field, choice.place_m, cells_m).all()
    assert field.distance_m(goal.position_m[None])[0] >= explorer.min_clearance_m - 1e-6


def test_the_leg_to_a_place_is_straight_through_what_was_seen() -> None:
    field, explorer = storeys(1.5), begun()
    seen = at(field, START_M, target_m=ABOVE_M)
    goal = chosen(explorer, seen)
    choice = explorer._choice
    assert choice is not None
    line = np.linspace(seen.state.position_m, goal.position_m, 50)
    assert field.observed(line).all()
    assert (field.distance_m(line) > explorer.narrow_clearance_m).all()
    assert not goal.is_target
    assert choice.place_m[2] > 2.8  # the upper storey is looked at from within


def test_the_target_is_the_goal_of_the_last_leg_once_seen_cells_lead_there() -> None:
    field, explorer = storeys(3.0), begun()
    below = chosen(explorer, at(field, START_M, target_m=ABOVE_M))
    assert not below.is_target  # the deck is between
    near = chosen(begun(), at(field, (2.5, 3.0, 4.2), target_m=ABOVE_M))
    assert near.is_target
    np.testing.assert_array_equal(near.position_m, ABOVE_M)


def test_a_closed_deck_leaves_nothing_to_look_at_but_the_target_as_last_resort() -> None:
    field = storeys(0.0, hatch=False)
    assert begun().select(at(field, START_M)) is None
    goal = begun().select(at(field, START_M, target_m=ABOVE_M))
    assert goal is not None
    assert goal.is_target
    assert Frontier3d(unknown="conservative").unknown == "conservative"
    careful = begun(unknown="conservative")
    assert careful.select(at(field, START_M, target_m=ABOVE_M)) is None


def test_looking_in_vain_comes_to_an_end() -> None:
    """The map never changes: every place is flown to, looked from, and given up."""
    field, explorer = storeys(0.0), begun()
    position_m, yaw_rad, visits = START_M, 0.0, 0
    for tick in range(2000):
        goal = explorer.select(at(field, position_m, 0.2 * tick, yaw_rad=yaw_rad))
        if goal is None:
            break
        visits += not np.allclose(goal.position_m, position_m)
        position_m = tuple(goal.position_m)
        yaw_rad = yaw_rad if math.isnan(goal.yaw_rad) else goal.yaw_rad
    assert goal is None
    assert visits >= 1
    assert len(field.state[field.state == UNKNOWN])


def test_places_to_which_no_plan_leads_are_given_up_too() -> None:
    field, explorer = storeys(0.0), begun()
    for tick in range(500):
        goal = explorer.select(at(field, START_M, 0.2 * tick), fresh=True)
        if goal is None:
            return
        explorer.reject(goal.position_m, 0.2 * tick)
    pytest.fail("it never gives up")


def test_a_sensor_that_sees_up_looks_into_the_hatch_from_below() -> None:
    field = storeys(0.0)
    under = (5.4, 3.1, 1.2)
    lidar = begun(horizontal_fov_deg=360.0, lowest_deg=-20.0, highest_deg=89.0)
    goal = chosen(lidar, at(field, under))
    assert math.isnan(goal.yaw_rad)
    assert math.hypot(goal.position_m[0] - under[0], goal.position_m[1] - under[1]) < 0.6
    camera = begun()
    goal = chosen(camera, at(field, under))
    assert math.hypot(goal.position_m[0] - under[0], goal.position_m[1] - under[1]) > 0.6


def test_what_is_kept_between_choices_follows_the_map() -> None:
    """The unknown recedes upwards: the goal is that of an explorer that begins now."""
    final = storeys(2.0)
    state, changed = final.state.copy(), np.zeros((10, 8), dtype=np.int32)
    field = replace(final, state=state, changed=changed)
    kept = begun(hysteresis_m=0.0)
    for height in (28, 32, 36, 40, 48):
        state[:] = final.state
        state[:, :, height:] = UNKNOWN
        changed += 1
        goal = kept.select(at(field, START_M, 0.2 * height, target_m=ABOVE_M), fresh=True)
        kept._choice = None
        anew = begun(hysteresis_m=0.0).select(at(field, START_M, target_m=ABOVE_M), fresh=True)
        assert (goal is None) == (anew is None)
        if goal is not None and anew is not None:
            assert goal.score == pytest.approx(anew.score, abs=0.5)


def test_a_start_of_which_not_all_around_was_seen_is_left() -> None:
    """An exploration used to end there after two seconds."""
    whole = storeys(0.0)
    state = whole.state.copy()
    x, y, z = np.meshgrid(*(0.05 + 0.1 * np.arange(n) for n in state.shape), indexing="ij")
    away_m = np.sqrt((x - START_M[0]) ** 2 + (y - START_M[1]) ** 2 + (z - START_M[2]) ** 2)
    state[(away_m > 0.3) & (away_m < 0.38)] = UNKNOWN
    goal = begun().select(at(replace(whole, state=state), START_M))
    assert goal is not None


def gallery() -> DistanceField:
    """20 m long, the last two at both ends not seen."""
    size_m = (20.0, 4.0, 2.4)
    grid, unknown = empty(size_m), empty(size_m)
    grid[[0, -1]], grid[:, [0, -1]], grid[:, :, [0, -1]] = True, True, True
    unknown[:20], unknown[-20:] = True, True
    return field_from(grid & ~unknown, unknown=unknown, max_distance_m=2.0)


def goes_east(explorer: Frontier3d, field: DistanceField, time_s: float) -> bool:
    """From the middle of the gallery."""
    bounds_m = np.array([[0.4, 0.4, 0.4], [19.6, 3.6, 2.0]])
    seen = replace(at(field, (10.0, 2.0, 1.2), time_s), flight_bounds_m=bounds_m)
    return bool(chosen(explorer, seen).position_m[0] > 10.0)


@pytest.fixture
def biases(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """By how much the next tours think of the east as farther, m; the last one for all after it."""
    biases: list[float] = []

    def fickle(ways: Ways, places: Int, first_m: Float, there_m: Float) -> Int:
        bias_m = biases.pop(0) if len(biases) > 1 else biases[0]
        return np.argsort(first_m + bias_m * (ways.cells.centre_m(places)[:, 0] > 10.0))

    monkeypatch.setattr(Ways, "tour", fickle)
    return biases


def test_between_two_places_it_goes_to_and_fro_ever_less(biases: list[float]) -> None:
    """A tour that thinks of the other end of a gallery as 8 m nearer each time is not followed for ever."""
    field, explorer = gallery(), begun()
    biases.extend([-8.0, 8.0] * 6)
    goals = [goes_east(explorer, field, float(tick)) for tick in range(12)]
    assert (np.flatnonzero(np.diff(goals)) + 1).tolist() == [1, 2, 3]  # 1.5, 3 and 6 m do not keep it, 12 do


def test_it_stays_by_a_hundred_metres_at_most(biases: list[float]) -> None:
    field, explorer = gallery(), begun()
    biases.extend([-200.0, 200.0] * 6)
    assert np.diff([goes_east(explorer, field, float(tick)) for tick in range(12)]).all()


@pytest.mark.parametrize("since", ["looked at", "no longer open", "a new trial", "nothing"])
def test_once_a_goal_was_seen_the_next_is_as_easy_to_leave_as_the_first(
    since: str, biases: list[float]
) -> None:
    field, explorer = gallery(), begun()
    biases.extend([-20.0, 20.0, -20.0, 20.0, 0.0])
    for tick in range(4):  # left for another thrice: 12 m keep it
        goes_east(explorer, field, float(tick))
    if since == "a new trial":
        explorer.reset(1.2, LIMITS)
    choice = explorer._choice
    assert choice is None or choice.place_m[0] < 10.0
    if since == "looked at":
        for time_s in (3.2, 3.4, 3.6, 3.8, 4.0):
            explorer.select(
                replace(
                    at(field, tuple(choice.place_m), time_s, yaw_rad=choice.yaw_rad),
                    flight_bounds_m=np.array([[0.4, 0.4, 0.4], [19.6, 3.6, 2.0]]),
                )
            )
    elif since == "no longer open":
        explorer._space.cells.looked[choice.cells] = explorer.looks
    biases[:] = [-8.0, 8.0, -8.0]
    goals = [goes_east(explorer, field, 5.0 + tick) for tick in range(3)]
    assert np.diff(goals).all() == (since != "nothing")
