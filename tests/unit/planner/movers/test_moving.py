"""Movers as obstacles in space and time: clearances against closed forms, plans that keep them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.components import build
from uavexp.arrays import Float
from uavexp.check.fields import bounds, box, empty, field_from
from uavexp.check.hall import LIMITS
from uavexp.planner.movers.escape import stops
from uavexp.planner.movers.moving import MovingObstacles, clearance_after
from uavexp.trajectory import evaluate
from uavexp.types import Goal, PlanRequest, PlanResult, PlanStatus, Tracks

SIZE_M = (14.0, 8.0, 3.0)
NOW_S = 3.0


def tracks(*movers: tuple[Any, Any, Any], sigma_m: float = 0.0, sigma_mps: float = 0.0) -> Tracks:
    """Movers as (position, velocity, half size)."""
    covariance = np.diag([sigma_m**2] * 3 + [sigma_mps**2] * 3)
    return Tracks(
        time_s=NOW_S,
        identity=np.arange(len(movers)),
        position_m=np.array([mover[0] for mover in movers], dtype=np.float64).reshape(-1, 3),
        velocity_mps=np.array([mover[1] for mover in movers], dtype=np.float64).reshape(-1, 3),
        covariance=np.tile(covariance, (len(movers), 1, 1)),
        half_size_m=np.array([mover[2] for mover in movers], dtype=np.float64).reshape(-1, 3),
    )


def obstacles(found: Tracks, **changes: Any) -> MovingObstacles:
    return MovingObstacles(
        **({"tracks": found, "body_radius_m": 0.2, "margin_m": 0.3, "horizon_s": 2.0} | changes)
    )


PERSON = (0.3, 0.3, 0.9)
coordinate = st.floats(-3.0, 3.0)


def test_before_a_wall_a_mover_stays_and_grows_by_what_its_speed_allows() -> None:
    """At 1 m/s from x = 1 its side, 0.3 m on, is 0.15 m before the wall at x = 3 after 1.55 s."""
    grid = empty((6.0, 4.0, 3.0))
    box(grid, (3.0, 0.0, 0.0), (3.2, 4.0, 3.0))
    found = tracks(((1.0, 2.0, 1.0), (1.0, 0.0, 0.0), PERSON))
    moving = obstacles(found, field=field_from(grid, max_distance_m=2.0), horizon_s=5.0)
    turn_s = moving.table(NOW_S)[0, 15]
    assert turn_s == pytest.approx(1.55, abs=0.15)
    beside_m, ahead_s = np.array([[1.0, 0.0, 1.0]]), np.array([1.0, turn_s, turn_s + 0.4, turn_s + 2.0])
    rooms_m = moving.clearance_m(np.tile(beside_m, (4, 1)), NOW_S + ahead_s)
    straight = obstacles(found, horizon_s=5.0).clearance_m(np.tile(beside_m, (4, 1)), NOW_S + ahead_s)
    assert np.allclose(rooms_m[:2], straight[:2]), "until then as without the wall"
    assert rooms_m[2] == pytest.approx(rooms_m[1] - 0.4), "then it may come nearer at 1 m/s"
    assert rooms_m[3] == pytest.approx(rooms_m[1] - 0.6), "up to a cap"
    later = moving.table(NOW_S + turn_s + 0.4)[0]
    assert clearance_after(later[None], *beside_m[0], 0.0) == pytest.approx(rooms_m[2])


@settings(deadline=None)
@given(
    point=st.tuples(coordinate, coordinate, coordinate),
    velocity=st.tuples(coordinate, coordinate, coordinate),
    ahead_s=st.floats(0.0, 2.0),
)
def test_clearance_is_the_distance_to_the_box_where_it_will_be(
    point: tuple[float, float, float], velocity: tuple[float, float, float], ahead_s: float
) -> None:
    moving = obstacles(tracks(((1.0, -0.5, 0.2), velocity, PERSON)))
    centre = np.array([1.0, -0.5, 0.2]) + ahead_s * np.array(velocity)
    apart = np.abs(np.array(point) - centre) - np.array(PERSON)
    exact = np.linalg.norm(np.maximum(apart, 0.0)) + min(apart.max(), 0.0)
    (clearance,) = moving.clearance_m(np.array([point]), np.array([NOW_S + ahead_s]))
    assert clearance == pytest.approx(exact - 0.5, abs=1e-9)


def test_clearance_rides_with_the_mover() -> None:
    """Seen from the mover's frame a certain mover stands: same offset, same clearance at all times."""
    moving = obstacles(tracks(((0, 0, 0), (1.0, 0.5, -0.2), PERSON)))
    times_s = NOW_S + np.linspace(0.0, 2.0, 21)
    points_m = np.array([1.0, 0.4, 0.1]) + (times_s - NOW_S)[:, None] * np.array([1.0, 0.5, -0.2])
    assert np.ptp(moving.clearance_m(points_m, times_s)) < 1e-12


def test_nothing_is_asked_beyond_the_horizon_or_without_movers() -> None:
    moving = obstacles(tracks(((0, 0, 0), (0, 0, 0), PERSON)), horizon_s=1.0)
    near = moving.clearance_m(np.zeros((2, 3)), NOW_S + np.array([1.0, 1.01]))
    assert near[0] < 0.0
    assert np.isinf(near[1])
    assert np.isinf(obstacles(tracks()).clearance_m(np.zeros((1, 3)), np.array([NOW_S]))).all()


def test_uncertainty_takes_clearance_away_up_to_the_cap() -> None:
    """One sigma of the centre, sqrt(0.1² + (0.2 t)²), and never more than 0.3 m."""
    sure, unsure = (
        obstacles(tracks(((0, 0, 0), (0, 0, 0), PERSON), sigma_m=s, sigma_mps=2.0 * s)) for s in (0.0, 0.1)
    )
    ahead_s = np.array([0.0, 1.0, 2.0])
    points_m = np.tile([2.0, 0.0, 0.0], (3, 1))
    taken = sure.clearance_m(points_m, NOW_S + ahead_s) - unsure.clearance_m(points_m, NOW_S + ahead_s)
    assert np.allclose(taken, np.minimum(np.hypot(0.1, 0.2 * ahead_s), 0.3), atol=1e-12)


def test_a_table_from_a_later_time_says_the_same() -> None:
    moving = obstacles(tracks(((0, 0, 0), (1.0, 0.3, 0.0), PERSON), sigma_m=0.05, sigma_mps=0.1))
    now, later = moving.table(NOW_S), moving.table(NOW_S + 0.7)
    for ahead_s in (0.7, 1.2, 1.99, 2.1):
        here = clearance_after(now, 1.0, 1.0, 0.0, ahead_s)
        assert clearance_after(later, 1.0, 1.0, 0.0, ahead_s - 0.7) == pytest.approx(here, abs=1e-12)


def request(
    found: Tracks,
    start: tuple[float, float, float] = (1.0, 4.0, 1.2),
    velocity: Any = (0.0, 0.0, 0.0),
    walls: Any = (),
) -> PlanRequest:
    grid = empty(SIZE_M)
    for low, high in walls:
        box(grid, low, high)
    return PlanRequest(
        time_s=NOW_S,
        position_m=np.array(start),
        velocity_mps=np.array(velocity, dtype=np.float64),
        acceleration_mps2=np.zeros(3),
        goal=Goal(position_m=np.array([12.0, 4.0, 1.2]), is_target=True, score=0.0),
        field=field_from(grid, max_distance_m=2.0),
        flight_bounds_m=bounds(grid) + np.array([[0.3], [-0.3]]),
        tracks=found,
    )


def plan(asked: PlanRequest, **parameters: Any) -> PlanResult:
    planner = build("planner", "min_acc", unknown="optimistic", **parameters)
    planner.reset(LIMITS, np.random.default_rng(0))
    return planner.plan(asked)


def least_gap_m(result: PlanResult, found: Tracks, horizon_s: float = 2.0) -> float:
    """Distance of the body's circle from the movers' boxes along a plan, an oracle of its own."""
    times_s = NOW_S + np.linspace(0.0, horizon_s, 401)
    points_m = evaluate(result.trajectory, times_s)[0]
    apart_m = np.abs(points_m[None] - found.predicted_m(times_s)) - found.half_size_m[:, None]
    outside_m = np.linalg.norm(np.maximum(apart_m, 0.0), axis=2)
    return float(outside_m.min()) - LIMITS.body_radius_m


CROSSING = tracks(((3.4, 2.4, 0.9), (0.0, 1.0, 0.0), PERSON))
OPPOSING = tracks(((5.0, 4.05, 0.9), (-1.0, 0.0, 0.0), PERSON))
SEVERAL = tracks(
    ((3.4, 2.4, 0.9), (0.0, 1.0, 0.0), PERSON),
    ((5.0, 5.2, 0.9), (-0.8, -0.3, 0.0), PERSON),
    ((2.6, 5.5, 1.2), (0.2, -0.6, 0.0), (0.3, 0.3, 0.3)),
)


@pytest.mark.parametrize("found", [CROSSING, OPPOSING, SEVERAL], ids=["crossing", "opposing", "several"])
@pytest.mark.parametrize("velocity", [(0.0, 0.0, 0.0), (1.5, 0.0, 0.0)], ids=["standing", "moving"])
def test_a_plan_keeps_its_margin_from_movers_at_their_own_times(found: Tracks, velocity: Any) -> None:
    blind = plan(request(found, velocity=velocity), mover_horizon_s=0.0)
    result = plan(request(found, velocity=velocity))
    assert result.status is PlanStatus.OK
    assert result.reason == ""
    assert least_gap_m(result, found) >= 0.5 - 0.02
    if found is not SEVERAL:
        assert least_gap_m(blind, found) < 0.4, "without looking it would have come too near"
    position, speed, _ = evaluate(result.trajectory, np.array([NOW_S, result.trajectory.end_s]))
    assert np.allclose(position, [[1.0, 4.0, 1.2], [12.0, 4.0, 1.2]], atol=1e-6)
    assert np.allclose(speed[0], velocity, atol=1e-6)


TIMELESS = ("bspline_qp", "df_bitstar", "bitstar", "rrtstar")


def plan_by(option: str, asked: PlanRequest, **parameters: Any) -> PlanResult:
    if option in ("bitstar", "rrtstar"):
        pytest.importorskip("ompl")
        parameters["find"] = build("planner.find", f"ompl_{option}", max_iterations=500)
    planner = build("planner", option, unknown="optimistic", **parameters)
    planner.reset(LIMITS, np.random.default_rng(0))
    return planner.plan(asked)


@pytest.mark.parametrize("option", TIMELESS)
@pytest.mark.parametrize("found", [CROSSING, OPPOSING], ids=["crossing", "opposing"])
def test_planners_that_know_no_time_keep_the_margin_too(option: str, found: Tracks) -> None:
    asked = request(found, velocity=(1.5, 0.0, 0.0))
    blind, result = plan_by(option, asked, mover_horizon_s=0.0), plan_by(option, asked)
    assert result.status is PlanStatus.OK
    assert least_gap_m(blind, found) < 0.5 - 0.02, "without looking it would have come too near"
    assert least_gap_m(result, found) >= 0.5 - 0.02 or result.reason.endswith("first")
    assert least_gap_m(result, found) > 0.1
    position = evaluate(result.trajectory, np.array([NOW_S, result.trajectory.end_s]))[0]
    assert np.allclose(position, [[1.0, 4.0, 1.2], [12.0, 4.0, 1.2]], atol=1e-6)


@pytest.mark.parametrize("option", TIMELESS)
def test_movers_far_away_change_nothing(option: str) -> None:
    far = tracks(((12.0, 1.0, 0.9), (0.0, 0.0, 0.0), PERSON))
    alone, with_them = plan_by(option, request(tracks())), plan_by(option, request(far))
    assert np.array_equal(alone.trajectory.coefficients, with_them.trajectory.coefficients)


def test_a_mover_that_is_gone_when_the_vehicle_comes_is_no_obstacle() -> None:
    """It stands on the straight line now and leaves at 1.5 m/s: the plan hardly bends."""
    leaving = tracks(((3.5, 4.0, 0.9), (0.0, 1.5, 0.0), PERSON))
    free, passed = plan(request(tracks())), plan(request(leaving))
    points = [evaluate(one.trajectory, np.linspace(NOW_S, NOW_S + 6.0, 100))[0] for one in (free, passed)]
    assert passed.status is PlanStatus.OK
    assert np.abs(points[0] - points[1]).max() < 0.6


def test_without_movers_every_number_is_as_if_there_were_no_such_thing() -> None:
    here, off = plan(request(tracks())), plan(request(CROSSING), mover_horizon_s=0.0)
    assert np.array_equal(here.trajectory.coefficients, off.trajectory.coefficients)
    far = tracks(((12.0, 1.0, 0.9), (0.0, 0.0, 0.0), PERSON))
    assert np.allclose(plan(request(far)).trajectory.coefficients, here.trajectory.coefficients)


def test_in_a_corridor_it_passes_closer_or_steps_aside_and_never_touches() -> None:
    """A corridor 1.7 m wide, and somebody in its middle who comes: the margin cannot be kept."""
    walls = [((0.0, 0.0, 0.0), (14.0, 3.15, 3.0)), ((0.0, 4.85, 0.0), (14.0, 8.0, 3.0))]
    comes = tracks(((3.6, 4.2, 0.9), (-1.0, 0.0, 0.0), PERSON))
    result = plan(request(comes, walls=walls))
    assert result.status is PlanStatus.OK
    assert result.reason in ("passes movers closely", "steps aside first", "brakes first")
    assert least_gap_m(result, comes) > 0.0


def test_a_vehicle_that_stands_in_the_way_steps_aside() -> None:
    """Somebody walks at it and will be there in 1.2 s."""
    comes = tracks(((3.0, 4.0, 0.9), (-1.2, 0.0, 0.0), PERSON))
    result = plan(request(comes))
    assert result.status is PlanStatus.OK
    assert least_gap_m(result, comes) > 0.1


@pytest.mark.parametrize("velocity", [(0.0, 0.0, 0.0), (2.4, 0.0, 0.0), (-1.0, 1.0, 0.5)])
def test_every_way_to_stop_keeps_the_limits_and_ends_at_rest(velocity: tuple[float, float, float]) -> None:
    asked = replace(request(tracks(), velocity=velocity), acceleration_mps2=np.array([0.0, 0.5, 0.0]))
    for way in stops(asked, LIMITS):
        times_s = np.linspace(NOW_S, way.end_s, 400)
        position, speed, acceleration = evaluate(way, times_s)
        assert np.allclose(position[0], asked.position_m)
        assert np.allclose(speed[0], velocity)
        assert np.allclose(acceleration[0], asked.acceleration_mps2)
        assert np.linalg.norm(acceleration, axis=1).max() <= LIMITS.max_acceleration_mps2 + 1e-6
        assert np.linalg.norm(speed, axis=1).max() <= LIMITS.max_speed_mps + 0.05
        assert np.linalg.norm(speed[-1]) < 1e-6
        assert np.linalg.norm(np.diff(position, axis=0), axis=1).max() < 0.05, "no jump"


def test_a_stamped_map_closes_what_is_met_and_nothing_else() -> None:
    """The mover crosses the line at x = 3.4 when the vehicle gets there; far away nothing changes."""
    asked = request(CROSSING, velocity=(1.2, 0.0, 0.0))
    moving = obstacles(CROSSING, horizon_s=2.5)
    stamped = moving.stamped(asked, speed_mps=1.2, acceleration_mps2=2.5, least_m=0.3, safe_m=0.75)
    line: Float = np.array([[3.4, 4.0, 1.2], [3.4, 2.4, 1.2], [10.0, 4.0, 1.2]])
    changed = asked.field.distance_m(line) - stamped.distance_m(line)
    assert stamped.distance_m(line)[0] < 0.3
    assert changed[2] == 0.0
    assert (stamped.distance <= asked.field.distance).all()
    assert np.shares_memory(stamped.state, asked.field.state)
