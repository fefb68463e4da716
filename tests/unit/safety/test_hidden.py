"""Speed before what is hidden: a corner, a wall with somebody behind, and the closed form of a stop."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.safety.test_committed import asked, straight
from uavexp.check.fields import box, empty, field_from
from uavexp.check.hall import LIMITS
from uavexp.field import DistanceField
from uavexp.safety.committed import Committed
from uavexp.safety.hidden import PERSON_M, walks_m
from uavexp.safety.speed_profile import room_before_person_m, speed_before_person_mps
from uavexp.trajectory import Trajectory

SIZE_M = (10.0, 8.0, 2.0)
RULES = Committed(person_mps=1.2)
Y_M = 2.05
FROM_M, AT_M = 3.55, 5.2  # where the vehicle is, and a place before the door


def hall(*, door_m: tuple[float, float] | None = (5.0, 6.5)) -> DistanceField:
    """A corridor along x, y from 0 to 3 m, whose left wall has a door in it to a room; all of it was seen."""
    grid = empty(SIZE_M)
    for low, high in [(0.0, door_m[0]), (door_m[1], SIZE_M[0])] if door_m else [(0.0, SIZE_M[0])]:
        box(grid, (low, 3.0, 0.0), (high, 3.2, 2.0))
    return field_from(grid, max_distance_m=2.0)


def along(field: DistanceField, eye_x_m: float, x_m: list[float], y_m: float = Y_M) -> list[float]:
    points = np.array([[x, y_m, 1.05] for x in x_m])
    return walks_m(field, np.array([eye_x_m, Y_M, 1.05]), points, 4.0).tolist()


def test_behind_a_wall_without_a_door_nobody_comes_through() -> None:
    assert along(hall(door_m=None), 1.0, [2.0, 5.0, 8.0]) == pytest.approx([4.0, 4.0, 4.0], abs=0.3)


def test_the_way_is_from_the_edge_of_what_is_hidden_behind_the_corner() -> None:
    """From x = 2.05 the line of sight past the jamb (5, 3) reaches y = 3.4 at x = 6.2."""
    field = hall()
    near, far = along(field, 2.05, [5.5, 8.0])
    assert near == pytest.approx(3.2 + 0.25 - Y_M, abs=0.35)  # straight from behind the wall, a person wide
    assert np.hypot(8.0 - 6.2, 3.3 - Y_M) < far < 3.0  # the other jamb is in the way
    opened = along(field, 5.75, [5.75])[0]  # before the door one sees into the room
    assert opened > near + 0.3


def test_a_place_never_seen_is_hidden() -> None:
    unknown = empty(SIZE_M)
    unknown[60:] = True
    field = field_from(empty(SIZE_M), unknown=unknown)
    assert along(field, 1.0, [3.0, 5.0]) == pytest.approx([3.0, 1.0], abs=0.15)


@given(
    speed=st.floats(0.05, 5.0),
    person=st.floats(0.0, 2.0),
    brakes=st.floats(0.5, 5.0),
    late=st.floats(0.0, 1.0),
)
def test_the_speed_is_that_from_which_the_two_just_do_not_meet(
    speed: float, person: float, brakes: float, late: float
) -> None:
    """Both walked step by step until the vehicle stands."""
    times = np.linspace(0.0, late + speed / brakes, 2001)
    now = np.where(times < late, speed, np.maximum(speed - brakes * (times - late), 0.0))
    way = float(np.trapezoid(now, times)) + person * times[-1]
    assert room_before_person_m(speed, person, brakes, late) == pytest.approx(way, rel=1e-4)
    bound = speed_before_person_mps(np.array([way, way + 0.5, -1.0]), person, brakes, late)
    assert bound[0] == pytest.approx(speed, rel=1e-3)
    assert bound[1] > speed
    assert bound[2] == pytest.approx(0.0, abs=1e-9)


def speed_mps(plan: Trajectory, field: DistanceField, rules: Committed) -> float:
    """In front of the door, as it may be flown."""
    pace = asked(plan, field, rules).pace
    return 2.0 * float(np.interp((AT_M - FROM_M) / 2.0, pace.own_s, pace.rate)) if len(pace.rate) else 2.0


def test_it_passes_a_door_slowly_enough_to_stop_and_an_open_wall_as_planned() -> None:
    plan = straight(2.0, from_m=FROM_M, y_m=Y_M)
    past, off = speed_mps(plan, hall(door_m=None), RULES), speed_mps(plan, hall(), Committed())
    assert [past, off] == pytest.approx([2.0, 2.0], abs=0.02)
    walk_m = along(hall(), FROM_M, [AT_M])[0] - LIMITS.body_radius_m - PERSON_M
    slow = speed_mps(plan, hall(), RULES)
    bound = speed_before_person_mps(np.array([walk_m]), 1.2, LIMITS.max_acceleration_mps2, RULES.reaction_s)[
        0
    ]
    assert slow <= max(bound, RULES.creep_mps) + 0.05
    assert slow > 0.0
    assert speed_mps(plan, hall(), replace(RULES, person_mps=0.5)) > slow + 0.1


def test_the_plan_is_never_refused_for_somebody_who_may_come() -> None:
    """He may come while it is fast already: then it slows as it can, and goes on."""
    assert not asked(straight(2.4, from_m=4.6, y_m=Y_M), hall(), RULES).refused
