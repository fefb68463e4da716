"""Looking at who will be met: whom, how far the yaw leaves the way, and when it does not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.unit.pilot.test_holding import START, make, room, see
from tests.unit.planner.movers.test_moving import PERSON, tracks
from uavexp.arrays import Float
from uavexp.check.hall import LIMITS
from uavexp.pilot.following import follow
from uavexp.pilot.glance import towards_encounter_rad
from uavexp.trajectory import Trajectory
from uavexp.trigger.ssp import Ssp
from uavexp.types import Observation

NOW_S = 3.0
AS_PLANNED = (np.zeros(0), np.zeros(0), np.zeros(0))
LEFT, RIGHT = ((3.0, 2.5, 1.2), (0.0, -1.2, 0.0), PERSON), ((4.0, -2.5, 1.2), (0.0, 1.0, 0.0), PERSON)
FAR = ((9.0, 9.0, 1.2), (1.0, 0.0, 0.0), PERSON)


def along_x(speed_mps: float = 1.5) -> Trajectory:
    """From the origin, from `NOW_S` on."""
    return Trajectory(
        breaks_s=NOW_S + np.array([0.0, 6.0]),
        coefficients=np.array([[[0.0, 0.0, 1.2], [speed_mps, 0.0, 0.0]]]),
        at_rest=False,
    )


def met(*movers: tuple) -> Observation:
    seen = see(room(), NOW_S, make(Ssp()).reference(0.0, 0.01))
    state = replace(seen.state, position_m=np.array([0.0, 0.0, 1.2]))
    return replace(seen, state=state, tracks=tracks(*movers))


@pytest.mark.parametrize(
    ("movers", "bearing_rad"),
    [
        ((), math.nan),
        ((FAR,), math.nan),
        ((LEFT,), math.atan2(2.5, 3.0)),
        ((RIGHT,), math.atan2(-2.5, 4.0)),
        ((FAR, RIGHT, LEFT), math.atan2(2.5, 3.0)),
    ],
    ids=["nobody", "far", "left", "right", "the sooner"],
)
def test_it_looks_at_whom_it_will_meet_first(movers: tuple, bearing_rad: float) -> None:
    assert towards_encounter_rad(met(*movers), along_x()) == pytest.approx(bearing_rad, nan_ok=True)


def yaws(glance_rad: float, most_rad: float, wanted_rad: float = math.nan, speed_mps: float = 1.5) -> Float:
    plan, times_s = along_x(speed_mps), NOW_S + 0.01 * np.arange(200)
    rows = follow(
        plan.breaks_s, plan.coefficients, AS_PLANNED, times_s, NOW_S, 0.8, wanted_rad, 0.0,
        LIMITS.max_body_rate_radps, 0.01, glance_rad, most_rad,
    )  # fmt: skip
    return rows[:, 9]


def test_the_yaw_leaves_the_way_by_no_more_than_it_may() -> None:
    assert yaws(math.nan, 0.6)[-1] == pytest.approx(0.0)
    assert yaws(0.4, 0.6)[-1] == pytest.approx(0.4, abs=0.01)
    assert yaws(2.0, 0.6)[-1] == pytest.approx(0.6, abs=0.01)
    assert yaws(-2.0, 0.6)[-1] == pytest.approx(-0.6, abs=0.01)
    assert yaws(2.0, 0.6, wanted_rad=1.0)[-1] == pytest.approx(1.0, abs=0.01), "a viewpoint's yaw goes first"


def test_a_slow_vehicle_turns_to_who_comes_from_behind() -> None:
    assert yaws(2.0, 0.6, speed_mps=0.2)[-1] == pytest.approx(2.0, abs=0.05)
    assert yaws(3.0, 0.6, speed_mps=0.5)[-1] == pytest.approx(0.5 * math.pi, abs=0.05)


@pytest.mark.parametrize("glance_rad", [0.0, 0.5])
def test_a_pilot_that_may_glance_does(glance_rad: float) -> None:
    pilot = make(Ssp())
    pilot.rules = replace(pilot.rules, glance_rad=glance_rad)
    seen = see(room(), NOW_S, pilot.reference(0.0, 0.01))
    ahead = (tuple(START + np.array([1.2, 0.8, 0.0])), (0.0, -0.5, 0.0), PERSON)
    pilot.decide(replace(seen, tracks=tracks(ahead)))
    assert math.isnan(pilot.steering.glance_rad) == (glance_rad == 0.0)
