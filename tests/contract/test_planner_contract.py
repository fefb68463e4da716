"""What every planner promises (DESIGN.md), for every option of conf/planner found by glob."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from hydra.utils import get_class
from omegaconf import OmegaConf

from tests.components import CONF, numbers, options
from uavexp.arrays import Bool, Float
from uavexp.check.fields import bounds, box, empty, field_from, warehouse
from uavexp.errors import ConfigError
from uavexp.field import DistanceField
from uavexp.planner.base import Planner
from uavexp.trajectory import Trajectory, evaluate
from uavexp.types import Goal, Limits, PlanRequest, PlanResult, PlanStatus

LIMITS = Limits(
    max_speed_mps=2.5, max_acceleration_mps2=2.5, max_body_rate_radps=2.0, body_size_m=(0.32, 0.32, 0.12)
)
BODY_RADIUS_M = LIMITS.body_radius_m

pytestmark = pytest.mark.parametrize("option", options("planner"))


def described(option: str) -> dict[str, Any]:
    """The option's yaml, with what it takes from the root of the configuration."""
    whole = OmegaConf.merge(
        OmegaConf.load(CONF / "config.yaml"), {"planner": OmegaConf.load(CONF / "planner" / f"{option}.yaml")}
    )
    values = OmegaConf.to_container(whole.planner, resolve=True)
    assert isinstance(values, dict)
    return {str(name): value for name, value in values.items()}


def build(option: str, **changes: Any) -> Any:
    values = described(option)
    return get_class(values.pop("_target_"))(**(values | changes))


def planner(option: str) -> Planner:
    made: Planner = build(option)
    made.reset(LIMITS, np.random.default_rng(7))
    return made


def ask(field: DistanceField, grid: Bool, start: Float, goal: Float, **state: Any) -> PlanRequest:
    return PlanRequest(
        time_s=12.34,
        position_m=start,
        velocity_mps=state.get("velocity", np.zeros(3)),
        acceleration_mps2=state.get("acceleration", np.zeros(3)),
        goal=Goal(position_m=goal, is_target=state.get("target", True), score=0.0),
        field=field,
        flight_bounds_m=bounds(grid, field.voxel_size_m, tuple(field.origin_m)),
    )


def warehouse_requests(seed: int, count: int) -> list[PlanRequest]:
    """Requests of 4 to 12 m among shelves, half of them at speed with room to stop."""
    grid = warehouse(seed)
    field, rng = field_from(grid), np.random.default_rng(seed)
    requests: list[PlanRequest] = []
    while len(requests) < count:
        ends = rng.uniform([1.0, 1.0, 1.1], [25.0, 15.0, 1.6], (2, 3))
        if not 4.0 < np.linalg.norm(ends[1] - ends[0]) < 12.0 or field.distance_m(ends).min() < 0.4:
            continue
        angle, speed = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.0, 2.3)
        along = np.array([np.cos(angle), np.sin(angle), 0.0])
        ahead = field.distance_m(ends[0] + np.arange(0.0, 3.0, 0.1)[:, None] * along)
        room = 0.1 * int(np.argmin(ahead > 0.3)) if (ahead <= 0.3).any() else 3.0
        speed = min(speed, 0.8 * np.sqrt(2.0 * LIMITS.max_acceleration_mps2 * max(room - 0.3, 0.0)))
        requests.append(
            ask(field, grid, ends[0], ends[1], velocity=speed * along, target=bool(rng.integers(2)))
            if len(requests) % 2
            else ask(field, grid, ends[0], ends[1], target=bool(rng.integers(2)))
        )
    return requests


def sampled(trajectory: Trajectory) -> tuple[Float, Float, Float]:
    times = np.append(np.arange(trajectory.start_s, trajectory.end_s, 1e-3), trajectory.end_s)
    return evaluate(trajectory, times)


def check_contract(request: PlanRequest, result: PlanResult) -> None:
    trajectory = result.trajectory
    assert trajectory is not None
    assert trajectory.start_s == request.time_s
    position, velocity, acceleration = sampled(trajectory)
    np.testing.assert_allclose(position[0], request.position_m, atol=1e-9)
    np.testing.assert_allclose(velocity[0], request.velocity_mps, atol=1e-9)
    np.testing.assert_allclose(acceleration[0], request.acceleration_mps2, atol=1e-8)
    np.testing.assert_allclose(position[-1], request.goal.position_m, atol=1e-9)
    assert trajectory.at_rest == request.goal.is_target
    if trajectory.at_rest:
        np.testing.assert_allclose(velocity[-1], 0.0, atol=1e-9)
    assert np.linalg.norm(velocity, axis=1).max() <= LIMITS.max_speed_mps * (1.0 + 1e-6)
    assert np.linalg.norm(acceleration, axis=1).max() <= LIMITS.max_acceleration_mps2 * (1.0 + 1e-6)
    assert np.abs(np.diff(acceleration, axis=0)).max() < 0.15  # no jump between two milliseconds
    assert request.field.distance_m(position).min() > BODY_RADIUS_M
    assert (position >= request.flight_bounds_m[0]).all()
    assert (position <= request.flight_bounds_m[1]).all()


def test_yaml_names_every_parameter_with_its_default_and_a_comment(option: str) -> None:
    values = described(option)
    target = values.pop("_target_")
    assert target.rpartition(".")[0] == f"uavexp.planner.{option}"
    assert values == {f.name: f.default for f in dataclasses.fields(get_class(target)) if f.init}
    lines = (CONF / "planner" / f"{option}.yaml").read_text().splitlines()
    assert all("#" in line for line in lines if line and not line.startswith("_target_"))


def test_bad_numbers_are_refused(option: str) -> None:
    for name in numbers(build(option)):
        for value in (float("nan"), float("inf"), -1.0):
            with pytest.raises(ConfigError, match=name):
                build(option, **{name: value})


@pytest.mark.parametrize("seed", range(3))
def test_contract_among_shelves(option: str, seed: int) -> None:
    made = planner(option)
    answers = [(request, made.plan(request)) for request in warehouse_requests(seed, 16)]
    planned = [(request, result) for request, result in answers if result.status is PlanStatus.OK]
    assert len(planned) >= 14  # every one of them can be flown, braking first if need be
    for request, result in planned:
        check_contract(request, result)
    for _, result in answers:
        assert (result.trajectory is None) == (result.status is not PlanStatus.OK)
        assert result.status is PlanStatus.OK or result.reason


def test_replans_follow_on_smoothly(option: str) -> None:
    made = planner(option)
    request = warehouse_requests(3, 1)[0]
    for _ in range(6):
        result = made.plan(request)
        assert result.trajectory is not None, result.reason
        check_contract(request, result)
        moment = result.trajectory.start_s + 0.13 * result.trajectory.duration_s
        p, v, a = evaluate(result.trajectory, np.array([moment]))
        request = PlanRequest(
            time_s=moment,
            position_m=p[0],
            velocity_mps=v[0],
            acceleration_mps2=a[0],
            goal=request.goal,
            field=request.field,
            flight_bounds_m=request.flight_bounds_m,
        )


def same(a: Trajectory | None, b: Trajectory | None) -> bool:
    if a is None or b is None:
        return a is b
    return (
        a.breaks_s.tobytes() == b.breaks_s.tobytes() and a.coefficients.tobytes() == b.coefficients.tobytes()
    )


def test_same_rng_same_plan_whatever_was_asked_before(option: str) -> None:
    requests = warehouse_requests(4, 6)
    used = planner(option)
    for request in requests:
        used.plan(request)
    for request in requests:
        again, fresh = used.plan(request), planner(option).plan(request)
        assert same(again.trajectory, fresh.trajectory)
        assert (again.status, again.iterations, again.expansions) == (
            fresh.status,
            fresh.iterations,
            fresh.expansions,
        )


def obstacle_course() -> tuple[Bool, Float, Float]:
    """A hall with two pillars that leave one best way; start and goal."""
    grid = empty((9.0, 6.0, 2.4))
    box(grid, (2.5, 0.0, 0.0), (3.1, 3.7, 2.4))
    box(grid, (5.5, 2.2, 0.0), (6.1, 6.0, 2.4))
    return grid, np.array([1.05, 2.05, 1.25]), np.array([7.75, 3.85, 1.25])


def test_moves_along_with_a_shifted_world(option: str) -> None:
    grid, start, goal = obstacle_course()
    velocity, shift = np.array([0.6, -0.3, 0.0]), np.array([3.0, -7.0, 0.5])
    here = planner(option).plan(ask(field_from(grid), grid, start, goal, velocity=velocity))
    moved = ask(field_from(grid, origin_m=shift), grid, start + shift, goal + shift, velocity=velocity)
    there = planner(option).plan(moved)
    assert here.trajectory is not None
    assert there.trajectory is not None
    assert there.trajectory.duration_s == pytest.approx(here.trajectory.duration_s, rel=0.01)
    times = 12.34 + np.linspace(0.0, here.trajectory.duration_s, 100)
    apart = evaluate(there.trajectory, times)[0] - shift - evaluate(here.trajectory, times)[0]
    assert np.abs(apart).max() < 0.05


def test_turns_along_with_a_turned_world(option: str) -> None:
    grid, start, goal = obstacle_course()
    velocity = np.array([0.6, -0.3, 0.0])
    here = planner(option).plan(ask(field_from(grid), grid, start, goal, velocity=velocity))
    turned_grid = np.ascontiguousarray(np.rot90(grid))  # (x, y) -> (width - y, x)

    def turn(point: Float) -> Float:
        return np.array([6.0 - point[1], point[0], point[2]])

    turned = ask(
        field_from(turned_grid), turned_grid, turn(start), turn(goal), velocity=np.array([0.3, 0.6, 0.0])
    )
    there = planner(option).plan(turned)
    assert here.trajectory is not None
    assert there.trajectory is not None
    assert there.trajectory.duration_s == pytest.approx(here.trajectory.duration_s, rel=0.03)
    times = 12.34 + np.linspace(0.0, here.trajectory.duration_s, 100)
    expected = np.array([turn(p) for p in evaluate(here.trajectory, times)[0]])
    assert np.abs(evaluate(there.trajectory, times)[0] - expected).max() < 0.15


def test_hopeless_requests_have_a_status(option: str) -> None:
    grid = empty((6.0, 4.0, 2.0))
    box(grid, (2.9, 0.0, 0.0), (3.1, 4.0, 2.0))
    field, made = field_from(grid), planner(option)
    here, wall, beyond = np.array([1.0, 2.0, 1.0]), np.array([3.0, 2.0, 1.0]), np.array([5.0, 2.0, 1.0])
    assert made.plan(ask(field, grid, wall, here)).status is PlanStatus.START_BLOCKED
    assert made.plan(ask(field, grid, here, wall)).status is PlanStatus.GOAL_BLOCKED
    assert made.plan(ask(field, grid, here, beyond)).status is PlanStatus.NO_PATH
    towards = made.plan(ask(field, grid, here, np.array([1.0, 3.0, 1.0]), velocity=np.array([2.4, 0.0, 0.0])))
    assert towards.status is PlanStatus.OK
    late = np.array([2.2, 2.0, 1.0])
    hit = made.plan(ask(field, grid, late, here, velocity=np.array([2.4, 0.0, 0.0])))
    assert hit.status is PlanStatus.NOT_CLEAR
