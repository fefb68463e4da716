"""What is uncertain of a prediction, and where it turns, is kept by every planner and by the trigger."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.unit.planner.movers.test_moving import (
    NOW_S,
    PERSON,
    TIMELESS,
    least_gap_m,
    obstacles,
    plan_by,
    request,
    tracks,
)
from uavexp.arrays import Float
from uavexp.check.hall import LIMITS
from uavexp.mission.give_way import rooms_m
from uavexp.planner.mpc.regions import mover_planes
from uavexp.trigger.risk import approaches
from uavexp.types import SWERVE_STEP_S, PlanStatus, Tracks

PLANNERS = ("min_acc", "improved_astar", "bspline_mpc", *TIMELESS)
GROWTH_M = 0.25
BESIDE = tracks(((3.2, 3.2, 0.9), (0.0, 0.0, 0.0), PERSON))  # 0.27 m of room for the body on the straight way
AHEAD_S = SWERVE_STEP_S * np.arange(1.0, 11.0)


def unsure(found: Tracks) -> Tracks:
    """The same with centres of this standard deviation."""
    covariance = np.diag([GROWTH_M**2] * 3 + [0.0] * 3)
    return replace(found, covariance=np.tile(covariance, (len(found), 1, 1)))


def turning(place: tuple[float, float, float], speed_mps: float, rate_radps: float) -> Tracks:
    """A mover that sets out along x and turns."""
    there = speed_mps / rate_radps * np.stack(
        [np.sin(rate_radps * AHEAD_S), 1.0 - np.cos(rate_radps * AHEAD_S), 0.0 * AHEAD_S], axis=1
    )  # fmt: skip
    straight = AHEAD_S[:, None] * np.array([speed_mps, 0.0, 0.0])
    return replace(tracks((place, (speed_mps, 0.0, 0.0), PERSON)), swerve_m=(there - straight)[None])


@pytest.mark.parametrize("option", PLANNERS)
def test_every_planner_keeps_away_by_the_growth_as_well(option: str) -> None:
    sure, doubtful = (
        plan_by(option, request(found, velocity=(1.5, 0.0, 0.0))) for found in (BESIDE, unsure(BESIDE))
    )
    assert doubtful.status is PlanStatus.OK
    gap_m = least_gap_m(doubtful, BESIDE)
    assert gap_m >= 0.5 + GROWTH_M - 0.02 or doubtful.reason
    if option == "bspline_mpc":  # the others keep farther away anyhow
        assert least_gap_m(sure, BESIDE) < 0.5 + GROWTH_M - 0.05


@pytest.mark.parametrize("option", PLANNERS)
def test_every_planner_keeps_away_from_a_predicted_turn(option: str) -> None:
    """It would pass in front of the vehicle; going straight on it would not."""
    found = turning((2.2, 5.4, 0.9), 1.2, -1.2)
    asked = request(found, velocity=(1.5, 0.0, 0.0))
    told, untold = (
        plan_by(option, replace(asked, tracks=one))
        for one in (found, replace(found, swerve_m=np.zeros((0, 0, 3))))
    )
    assert told.status is PlanStatus.OK
    assert least_gap_m(told, found) >= 0.5 - 0.03 or told.reason
    assert least_gap_m(told, found) > least_gap_m(untold, found) + 0.05


@pytest.mark.parametrize("doubt", [0.0, GROWTH_M])
def test_half_spaces_of_the_horizon_touch_the_grown_box(doubt: float) -> None:
    """In front of a face the bound is the face, the body, the margin and the growth."""
    found = tracks(((2.0, 0.0, 1.0), (0.0, 0.0, 0.0), PERSON), sigma_m=doubt)
    table = obstacles(found).table(NOW_S)
    step, normal, bound = mover_planes(np.array([[1.0, 0.0, 1.0]]), np.zeros((1, 3)), np.array([0.5]), table)
    assert step.tolist() == [0]
    np.testing.assert_allclose(normal, [[-1.0, 0.0, 0.0]], atol=1e-12)
    np.testing.assert_allclose(bound, [-(2.0 - 0.3 - 0.2 - 0.3 - doubt)], atol=1e-12)


def test_clearance_is_that_of_the_swerved_box_and_a_later_table_says_the_same() -> None:
    found = turning((2.0, 0.0, 0.0), 1.0, 1.3)
    moving = obstacles(found)
    times_s = NOW_S + np.array([0.0, 0.13, 0.4, 1.1, 1.9])
    points = np.array([[2.5, 1.4, 0.2], [0.0, 0.0, 0.0], [3.5, 0.5, 0.0], [2.1, 2.0, 0.3], [4.0, 4.0, 0.0]])
    centres = found.predicted_m(times_s)[0]
    apart = np.abs(points - centres) - np.array(PERSON)
    outside = np.linalg.norm(np.maximum(apart, 0.0), axis=1) + np.minimum(apart.max(axis=1), 0.0)
    np.testing.assert_allclose(moving.clearance_m(points, times_s), outside - 0.5, atol=1e-9)
    later_s = NOW_S + 0.6  # three steps of the path
    step, normal, bound = mover_planes(
        points[4:], np.zeros((1, 3)), np.array([times_s[4] - later_s]), moving.table(later_s)
    )
    assert len(step) in (0, 1)
    for unit, edge in zip(normal, bound, strict=True):
        support = np.abs(unit) @ np.array(PERSON) + 0.5
        assert edge == pytest.approx(unit @ centres[4] + support)


def test_beyond_the_last_place_a_path_goes_on_straight() -> None:
    found = turning((0.0, 0.0, 0.0), 1.0, 0.8)
    last, before = found.predicted_m(NOW_S + np.array([AHEAD_S[-1], AHEAD_S[-2]]))[0]
    far = found.predicted_m(np.array([NOW_S + AHEAD_S[-1] + 0.3]))[0, 0]
    np.testing.assert_allclose(far, last + 1.5 * (last - before), atol=1e-9)


def approach(found: Tracks, path_m: Float, speed_mps: Float, times_s: Float) -> Float:
    return approaches(
        path_m, speed_mps, times_s - NOW_S, found.position_m, found.velocity_mps, found.half_size_m, True,
        found.swerved_m(times_s),
    )  # fmt: skip


def test_the_risk_is_that_of_the_predicted_path() -> None:
    """The vehicle stands where the turn leads to, or ahead where it does not."""
    found = turning((0.0, 0.0, 1.0), 1.0, 1.2)
    times_s = NOW_S + np.arange(0.0, 1.2, 0.02)
    there = found.predicted_m(times_s[-1:])[0, 0]
    still = np.zeros((len(times_s), 3))
    met = approach(found, np.tile(there, (len(times_s), 1)), still, times_s)[0]
    missed = approach(found, np.tile([1.2, -0.5, 1.0], (len(times_s), 1)), still, times_s)[0]
    assert met[0] < -0.25
    assert met[1] == pytest.approx(1.0, abs=0.03)  # it walks at 1 m/s all along
    assert missed[0] > 0.1


def test_room_for_a_stay_is_that_beside_the_predicted_path() -> None:
    found = turning((0.0, 0.0, 1.0), 1.0, 1.2)
    never = np.array([np.inf])
    there, beside = found.predicted_m(np.array([NOW_S + 1.5]))[0], np.array([[1.6, -0.9, 1.0]])
    on_it = rooms_m(found, never, there[0], there, LIMITS, False)[0]
    off_it = rooms_m(found, never, beside[0], beside, LIMITS, False)[0]
    straight = replace(found, swerve_m=np.zeros((0, 0, 3)))
    assert on_it < -0.3
    assert off_it > rooms_m(straight, never, beside[0], beside, LIMITS, False)[0] + 0.05
