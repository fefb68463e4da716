"""The static spline, the horizon and what joins them, against closed forms and independent oracles."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import BSpline

from uavexp.arrays import Float
from uavexp.check.fields import bounds, box, empty, field_from
from uavexp.errors import ConfigError
from uavexp.planner.bspline_mpc import BsplineMpc
from uavexp.planner.movers.moving import MovingObstacles
from uavexp.planner.mpc.horizon import HorizonModel, Rollout, Surroundings, horizon_model, roll_out, track
from uavexp.planner.mpc.horizon import to_trajectory as motion_trajectory
from uavexp.planner.mpc.regions import static_planes
from uavexp.planner.mpc.rejoin import blend, rest_of, state_at
from uavexp.planner.shape.static_step import Cost, local_model, merit
from uavexp.planner.spline.uniform import make_uniform, pin_ends, power_matrix, to_trajectory
from uavexp.trajectory import evaluate
from uavexp.types import Goal, Limits, PlanRequest, PlanStatus, Tracks

LIMITS = Limits(
    max_speed_mps=2.5, max_acceleration_mps2=2.5, max_body_rate_radps=2.0, body_size_m=(0.32, 0.32, 0.12)
)
PERSON_M = np.array([0.25, 0.25, 0.9])


def planner(**changes: Any) -> BsplineMpc:
    made = BsplineMpc(**changes)
    made.reset(LIMITS, np.random.default_rng(0))
    return made


def hall(*blocks: tuple[tuple[float, ...], tuple[float, ...]]) -> Any:
    grid = empty((12.0, 6.0, 2.4))
    for low, high in blocks:
        box(grid, low, high)
    return grid


def ask(grid: Any, **changes: Any) -> PlanRequest:
    values: dict[str, Any] = {
        "time_s": 3.0,
        "position_m": np.array([1.0, 3.0, 1.2]),
        "velocity_mps": np.zeros(3),
        "acceleration_mps2": np.zeros(3),
        "goal": Goal(position_m=np.array([11.0, 3.0, 1.2]), is_target=True, score=0.0),
        "field": field_from(grid),
        "flight_bounds_m": bounds(grid),
    }
    return PlanRequest(**(values | changes))


def later(request: PlanRequest, result: Any, after_s: float = 0.1) -> PlanRequest:
    moment = request.time_s + after_s
    p, v, a = evaluate(result.trajectory, np.array([moment]))
    return replace(request, time_s=moment, position_m=p[0], velocity_mps=v[0], acceleration_mps2=a[0])


def people(time_s: float, *seen: tuple[tuple[float, float], tuple[float, float]]) -> Tracks:
    """People at (x, y) with velocity (vx, vy), exactly known."""
    return Tracks(
        time_s=time_s,
        identity=np.arange(len(seen)),
        position_m=np.array([[*place, 0.9] for place, _ in seen]),
        velocity_mps=np.array([[*velocity, 0.0] for _, velocity in seen]),
        covariance=np.zeros((len(seen), 6, 6)),
        half_size_m=np.tile(PERSON_M, (len(seen), 1)),
    )


# the spline


@pytest.mark.parametrize("order", [4, 5, 6])
def test_spline_is_scipys(order: int) -> None:
    degree, count, h = order - 1, 2 * order + 3, 0.4
    control = np.random.default_rng(order).normal(size=(count, 3))
    trajectory = to_trajectory(power_matrix(degree), control, h, 5.0, True)
    knots = 5.0 + h * (np.arange(count + degree + 1.0) - degree)
    times = np.linspace(5.0, trajectory.end_s, 50)
    position, velocity, acceleration = evaluate(trajectory, times)
    oracle = BSpline(knots, control, degree)
    np.testing.assert_allclose(position, oracle(times), atol=1e-12)
    np.testing.assert_allclose(velocity, oracle(times, nu=1), atol=1e-10)
    np.testing.assert_allclose(acceleration[1:-1], oracle(times, nu=2)[1:-1], atol=1e-9)


@pytest.mark.parametrize(("name", "derivative"), [("effort", 2), ("jerk", 3)])
def test_energies_are_integrals_of_squares(name: str, derivative: int) -> None:
    degree, count = 4, 12
    control = np.random.default_rng(1).normal(size=count)
    spline = BSpline(np.arange(count + degree + 1.0) - degree, control, degree)
    exact = sum(
        quad(lambda t: float(spline(t, nu=derivative)) ** 2, m, m + 1.0)[0] for m in range(count - degree)
    )
    energy = getattr(make_uniform(degree, count), name)
    assert control @ energy @ control == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize("order", [4, 5, 6])
def test_first_and_last_points_say_how_it_begins_and_ends(order: int) -> None:
    degree, rng = order - 1, np.random.default_rng(order)
    control, start, end = rng.normal(size=(14, 3)), rng.normal(size=(3, 3)), rng.normal(size=(3, 3))
    inner = control[degree:-degree].copy()
    basis = make_uniform(degree, 14)
    pin_ends(basis, control, 0.3, start, end)
    np.testing.assert_array_equal(control[degree:-degree], inner)  # N - 2 (k - 1) stay free
    trajectory = to_trajectory(basis.power, control, 0.3, 0.0, True)
    np.testing.assert_allclose(state_at(trajectory, 0.0), start, atol=1e-9)
    np.testing.assert_allclose(state_at(trajectory, trajectory.end_s), end, atol=1e-8)


def test_a_stop_is_repeated_points() -> None:
    control, here, there = np.zeros((12, 3)), np.array([1.0, 2.0, 3.0]), np.array([4.0, 0.0, 1.0])
    rest = np.zeros((2, 3))
    pin_ends(make_uniform(3, 12), control, 0.3, np.vstack([here, rest]), np.vstack([there, rest]))
    np.testing.assert_allclose(control[:3], np.tile(here, (3, 1)), atol=1e-12)
    np.testing.assert_allclose(control[-3:], np.tile(there, (3, 1)), atol=1e-12)


def test_gradient_is_the_slope_of_the_cost() -> None:
    """Away from obstacles, where the model of their cost is exact, and within the limits."""
    grid, rng = hall(), np.random.default_rng(3)
    path = np.linspace([2.0, 3.0, 1.2], [8.0, 3.0, 1.2], 50)
    cost = Cost(
        basis=make_uniform(3, 12),
        effort_weight=1.3,
        jerk_weight=0.2,
        obstacle_weight=60.0,
        tether=5.0,
        field=field_from(grid),
        safe_m=0.75,
        hard_m=0.31,
        limits=(1e3, 1e3),
        bounds=bounds(grid),
    )
    control = np.linspace([2.0, 3.0, 1.2], [8.0, 3.0, 1.2], 12) + 0.1 * rng.normal(size=(12, 3))
    tied = path[:36]
    _, gradient = local_model(cost, control, 0.5, tied)
    for variable in (0, 4, 17):
        moved = [control.copy(), control.copy()]
        moved[0].reshape(-1)[9 + variable] += 1e-5
        moved[1].reshape(-1)[9 + variable] -= 1e-5
        up, down = (merit(cost, trial, 0.5, tied) for trial in moved)
        assert gradient[variable] == pytest.approx((up - down) / 2e-5, rel=1e-5, abs=1e-5)


# the horizon


def small_horizon() -> HorizonModel:
    return horizon_model(20, 0.1, 0.3, 5.0, 0.01)


def open_scene(tracks: Tracks | None = None, margin_m: float = 0.0) -> Surroundings:
    grid = empty((40.0, 40.0, 4.0), voxel_m=0.2)
    moving = MovingObstacles(
        tracks=tracks or Tracks.none(), body_radius_m=LIMITS.body_radius_m, margin_m=margin_m, horizon_s=9.0
    )
    field = field_from(grid, voxel_m=0.2, origin_m=(-20.0, -20.0, -1.0))
    return Surroundings(field, 0.3, moving.table(0.0), np.array([[-20.0, -20.0, -1.0], [20.0, 20.0, 3.0]]))


def straight(model: HorizonModel, speed_mps: float) -> Rollout:
    times = model.step_s * np.arange(1.0, model.steps + 1.0)
    velocity = np.array([speed_mps, 0.0, 0.0])
    place = np.array([0.0, 0.0, 1.0]) + times[:, None] * velocity
    return Rollout(place, np.tile(velocity, (model.steps, 1)), np.zeros((model.steps, 3)))


def test_casadi_rolls_out_what_is_flown() -> None:
    model, rng = small_horizon(), np.random.default_rng(0)
    start, inputs = rng.normal(size=(3, 3)), rng.normal(size=(20, 3))
    motion = roll_out(model, start, inputs)
    trajectory = motion_trajectory(model, start, motion, 20, 7.0)
    times = 7.0 + 0.1 * np.arange(1.0, 21.0)
    flown = evaluate(trajectory, np.nextafter(times, 0.0))
    for predicted, sampled in zip(motion, flown, strict=True):
        np.testing.assert_allclose(sampled, predicted, atol=1e-9)
    acceleration = evaluate(trajectory, np.linspace(7.0, 9.0, 2001))[2]
    assert np.abs(np.diff(acceleration, axis=0)).max() < 0.06  # continuous: first-order hold


def test_matrices_are_those_of_equation_3a() -> None:
    model, rng = small_horizon(), np.random.default_rng(1)
    start, wanted, inputs = rng.normal(size=3), rng.normal(size=(2, 20)), rng.normal(size=(2, 20))

    def cost(u: Float) -> float:
        place = model.place @ u + model.place_start @ start
        speed = model.speed @ u + model.speed_start @ start
        off = (place - wanted[0]) ** 2 + 0.3 * (speed - wanted[1]) ** 2
        off[-1] *= 5.0
        return float(off.sum() + 0.01 * (u**2).sum())

    def model_cost(u: Float) -> float:
        gradient = model.gradient @ np.concatenate([start, wanted[0], wanted[1]])
        return float(0.5 * u @ model.hessian @ u + gradient @ u)

    apart = cost(inputs[0]) - cost(inputs[1])
    assert model_cost(inputs[0]) - model_cost(inputs[1]) == pytest.approx(apart, rel=1e-9)


def test_nothing_to_do_on_the_reference() -> None:
    model = small_horizon()
    wanted = straight(model, 1.5)
    start = np.array([[0.0, 0.0, 1.0], [1.5, 0.0, 0.0], [0.0, 0.0, 0.0]])
    answer = track(model, start, wanted, wanted, open_scene(), LIMITS, 2)
    assert answer.motion is not None
    np.testing.assert_allclose(answer.motion.acceleration, 0.0, atol=1e-7)
    assert answer.slack_m == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("place", [(6.0, 0.3), (6.0, -0.3), (6.0, 0.0)])
def test_keeps_out_of_who_comes_towards_it(place: tuple[float, float]) -> None:
    model, tracks = small_horizon(), people(0.0, (place, (-1.0, 0.0)))
    wanted = straight(model, 1.5)
    start = np.array([[0.0, 0.0, 1.0], [1.5, 0.0, 0.0], [0.0, 0.0, 0.0]])
    answer = track(model, start, wanted, wanted, open_scene(tracks, 0.3), LIMITS, 3)
    assert answer.motion is not None
    assert answer.slack_m < 1e-6
    times = 0.1 * np.arange(1.0, 21.0)
    room = MovingObstacles(tracks=tracks, body_radius_m=LIMITS.body_radius_m, margin_m=0.3, horizon_s=9.0)
    assert room.clearance_m(answer.motion.place, times).min() > -1e-6
    assert np.linalg.norm(answer.motion.velocity, axis=1).max() <= 2.5


@pytest.mark.parametrize("rate_radps", [2.0, 0.8])
def test_the_thrust_never_turns_faster_than_it_may(rate_radps: float) -> None:
    """Somebody 1 m ahead makes the horizon do all it may; its jerk is that of a turning thrust vector."""
    limits = replace(LIMITS, max_body_rate_radps=rate_radps)
    model, tracks = small_horizon(), people(0.0, ((1.6, 0.1), (-1.0, 0.0)))
    wanted = straight(model, 1.5)
    start = np.array([[0.0, 0.0, 1.0], [1.5, 0.0, 0.0], [0.8, 0.0, 0.0]])
    answer = track(model, start, wanted, wanted, open_scene(tracks, 0.3), limits, 2)
    assert answer.motion is not None
    inputs = np.concatenate([start[2:], answer.motion.acceleration])
    jerk = np.abs(np.diff(inputs, axis=0)) / model.step_s
    assert jerk.max() == pytest.approx(9.81 * rate_radps, rel=1e-6)


def test_plans_that_follow_ask_for_a_share_of_the_body_rate() -> None:
    """Braking and side steps may ask for all of it, and the way back to the spline is not flown yet."""
    request = ask(hall(), tracks=people(3.0, ((3.4, 3.2), (-0.6, 0.0))))
    for share in (1.0, 0.3):
        made, most, following = planner(turn_share=share), 0.0, request
        for _ in range(8):
            result = made.plan(following)
            assert result.trajectory is not None
            if not result.reason.endswith("first"):
                most = max(most, 6.0 * float(np.abs(result.trajectory.coefficients[0, 3]).max()))
            following = later(following, result)
        assert 0.0 < most <= share * 9.81 * LIMITS.max_body_rate_radps * (1.0 + 1e-6)
        if share == 1.0:
            assert most > 0.3 * 9.81 * LIMITS.max_body_rate_radps


def test_gives_way_as_deep_as_it_must() -> None:
    """A mover that is on the vehicle already: the slack of the first step is how deep that is."""
    tracks = people(0.0, ((0.0, 0.0), (0.0, 0.0)))
    model = small_horizon()
    wanted, start = straight(model, 0.0), np.zeros((3, 3))
    start[0, 2] = 1.0
    answer = track(model, start, wanted, wanted, open_scene(tracks), LIMITS, 2)
    assert answer.slack_m == pytest.approx(0.25 + LIMITS.body_radius_m, abs=0.02)


def test_static_planes_of_a_wall_are_exact() -> None:
    grid = empty((6.0, 4.0, 2.0))
    box(grid, (3.0, 0.0, 0.0), (6.0, 4.0, 2.0))
    field = field_from(grid)
    places = np.array([[2.5, 2.0, 1.0], [2.8, 1.0, 1.0]])
    _, normal, bound = static_planes(places, field.distance, field.origin_m, field.voxel_size_m, 0.3)
    assert len(normal) > 0
    np.testing.assert_allclose(normal, np.tile([-1.0, 0.0, 0.0], (len(normal), 1)), atol=1e-6)
    np.testing.assert_allclose(bound, -(3.0 - 0.3), atol=1e-5)  # x <= 2.7


# what joins them


def test_blend_meets_both_ends() -> None:
    ends = np.random.default_rng(2).normal(size=(2, 3, 3))
    way = blend(ends[0], ends[1], 4.0, 1.7)
    np.testing.assert_allclose(state_at(way, 4.0), ends[0], atol=1e-12)
    np.testing.assert_allclose(state_at(way, 5.7), ends[1], atol=1e-9)


@pytest.mark.parametrize("from_s", [2.0, 2.05, 2.4, 3.39])
def test_rest_is_the_same_curve_later(from_s: float) -> None:
    control = np.random.default_rng(4).normal(size=(10, 3))
    whole = to_trajectory(power_matrix(3), control, 0.2, 2.0, True)
    rest = rest_of(whole, from_s, 50.0)
    assert rest is not None
    times = np.linspace(0.0, whole.end_s - from_s, 40)[:-1]
    for left, right in zip(evaluate(rest, 50.0 + times), evaluate(whole, from_s + times), strict=True):
        np.testing.assert_allclose(left, right, atol=1e-7)
    assert rest_of(whole, whole.end_s, 0.0) is None


# the planner


@pytest.mark.parametrize("order", [4, 5, 6])
def test_every_order_flies_around_a_pillar(order: int) -> None:
    grid = hall(((5.0, 1.6, 0.0), (6.0, 4.0, 2.4)))
    request = ask(grid)
    result = planner(order=order).plan(request)
    assert result.trajectory is not None, result.reason
    times = np.linspace(3.0, result.trajectory.end_s, 1000)
    assert request.field.distance_m(evaluate(result.trajectory, times)[0]).min() >= 0.26
    np.testing.assert_allclose(state_at(result.trajectory, times[-1])[0], request.goal.position_m, atol=1e-9)


def test_stop_at_ends_stops_at_both_ends() -> None:
    goal = Goal(position_m=np.array([10.0, 3.0, 1.2]), is_target=False, score=0.0)
    request = ask(hall(), velocity_mps=np.array([1.0, 0.0, 0.0]), goal=goal)
    smooth, stops = planner().plan(request).trajectory, planner(stop_at_ends=True).plan(request).trajectory
    assert smooth is not None
    assert stops is not None
    early = np.linspace(3.0, 4.5, 400)
    slowest = [np.linalg.norm(evaluate(t, early)[1], axis=1).min() for t in (smooth, stops)]
    assert slowest[0] > 0.9
    assert slowest[1] < 0.3  # the spline stops, the horizon follows it smoothly
    assert np.linalg.norm(state_at(smooth, smooth.end_s)[1]) > 0.4
    np.testing.assert_allclose(state_at(stops, stops.end_s)[1], 0.0, atol=1e-9)


def test_spline_is_kept_while_it_holds() -> None:
    grid, made = hall(), planner()
    request = ask(grid)
    first = made.plan(request)
    assert first.expansions > 0
    second = later(request, first)
    assert made.plan(second).expansions == 0
    box(grid, (5.0, 1.6, 0.0), (6.0, 4.0, 2.4))  # seen now, in the way
    blocked = replace(second, field=field_from(grid))
    assert made.plan(blocked).expansions > 0
    elsewhere = Goal(position_m=np.array([11.0, 4.0, 1.2]), is_target=True, score=0.0)
    assert made.plan(replace(blocked, goal=elsewhere)).expansions > 0
    made.reset(LIMITS, np.random.default_rng(0))
    assert made.plan(blocked).expansions > 0  # nothing leaks into another trial


def test_replans_at_10_hz_pass_a_crossing_person() -> None:
    grid, made, start_s = hall(), planner(), 3.0
    seen = ((5.0, 0.5), (0.0, 0.9))  # would be met half way
    request = ask(grid, tracks=people(start_s, seen))
    room, arrived = np.inf, False
    exact = MovingObstacles(
        tracks=people(start_s, seen), body_radius_m=LIMITS.body_radius_m, margin_m=0.0, horizon_s=99.0
    )
    for _ in range(80):
        result = made.plan(request)
        assert result.trajectory is not None
        flown = request.time_s + np.linspace(0.0, 0.1, 5)
        room = min(room, exact.clearance_m(evaluate(result.trajectory, flown)[0], flown).min())
        request = later(request, result)
        place = np.array(seen[0]) + (request.time_s - start_s) * np.array(seen[1])
        request = replace(request, tracks=people(request.time_s, ((place[0], place[1]), seen[1])))
        arrived = bool(np.linalg.norm(request.position_m - request.goal.position_m) < 0.3)
        if arrived:
            break
    assert arrived
    assert room > 0.3  # of 0.5 m


def test_no_way_out_is_counted_and_never_worse_than_going_on() -> None:
    """Four people close in on a hovering vehicle from all sides."""
    grid, made = hall(), planner()
    around = [
        ((3.0 + 1.2 * x, 3.0 + 1.2 * y), (-1.0 * x, -1.0 * y)) for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1))
    ]
    request = ask(grid, position_m=np.array([3.0, 3.0, 1.2]), tracks=people(3.0, *around))
    result = made.plan(request)
    assert result.trajectory is not None
    assert made.slackened == 1
    assert made.braked == 1
    assert result.reason in ("brakes first", "steps aside first")
    alone = planner(mover_horizon_s=0.0).plan(request)
    assert alone.trajectory is not None
    moving = MovingObstacles(
        tracks=request.tracks, body_radius_m=LIMITS.body_radius_m, margin_m=0.0, horizon_s=2.0
    )
    times = 3.0 + np.arange(0.0, 2.0, 0.05)
    rooms = [
        moving.clearance_m(evaluate(t, times)[0], times).min() for t in (result.trajectory, alone.trajectory)
    ]
    assert rooms[0] >= rooms[1]


def test_same_requests_same_bytes() -> None:
    grid = hall(((5.0, 1.6, 0.0), (6.0, 4.0, 2.4)))
    tracks = people(3.0, ((5.0, 0.5), (0.0, 0.9)), ((8.0, 5.0), (-0.5, -0.7)))
    plans = []
    for _ in range(2):
        made, request = planner(), ask(grid, tracks=tracks)
        for _ in range(4):
            result = made.plan(request)
            request = later(request, result)
        assert result.trajectory is not None
        plans.append(result.trajectory.coefficients.tobytes())
    assert plans[0] == plans[1]


def test_bad_input_is_a_status() -> None:
    made, grid = planner(), hall()
    nothing = made.plan(ask(grid, velocity_mps=np.array([np.nan, 0.0, 0.0])))
    assert nothing.status is PlanStatus.LIMITS
    assert "finite" in nothing.reason
    fast = made.plan(ask(grid, velocity_mps=np.array([9.0, 0.0, 0.0])))
    assert fast.trajectory is None
    assert fast.reason
    with pytest.raises(RuntimeError, match="reset"):
        BsplineMpc().plan(ask(grid))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("order", 3),
        ("horizon_steps", 1),
        ("horizon_iterations", 0),
        ("final_iterations", 1.5),
        ("unknown", "no"),
        ("turn_share", 0.0),
    ],
)
def test_parameters_are_checked(name: str, value: Any) -> None:
    with pytest.raises(ConfigError, match=name):
        BsplineMpc(**{name: value})
