"""The visit: each viewpoint once, in order; blocked ones put off, then given up; clear ends."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.inspections import START_M, building
from tests.logs import make_world
from tests.unit.trigger.test_trigger import LIMITS, change, observe
from uavexp.config.composition import Composer
from uavexp.config.overrides import parse_settings
from uavexp.errors import ConfigError, WorldError
from uavexp.field import OCCUPIED, DistanceField
from uavexp.geometry import quaternion_from_yaw
from uavexp.inspection.inspection_plan import nearest_order
from uavexp.inspection.travel import travel_matrix
from uavexp.inspection.view_angle import blocked_viewpoints, cell_weights, choose_yaw
from uavexp.mission.base import Flown
from uavexp.mission.inspect import Inspect
from uavexp.mission.more_stops import live_grid
from uavexp.mission.tour_guide import TourGuide
from uavexp.scene import Scene
from uavexp.types import Goal, Observation, Outcome, State, World

HALL = building()
ABOVE_M = START_M + np.array([0.0, 0.0, 0.9])
BOUNDS_M = np.array([[-0.35, -0.35, -0.35], [6.35, 4.35, 2.95]])


def hall() -> World:
    return replace(
        make_world([]),
        vertices_m=HALL.vertices_m,
        triangles=HALL.triangles,
        bounds_m=BOUNDS_M,
        flight_bounds_m=HALL.flight_bounds_m,
        start_m=START_M,
    )


def begun(**values: Any) -> tuple[Inspect, TourGuide]:
    mission = Inspect(blocks=0, **values)
    world = mission.prepare(hall(), np.random.default_rng(0))
    mission.reset(world, Scene(world), LIMITS)
    guide = mission.guide(None)  # type: ignore[arg-type]  # not asked for
    assert isinstance(guide, TourGuide)
    return mission, guide


def state(position_m: np.ndarray, yaw_rad: float = 0.0) -> State:
    return State(
        position_m=position_m,
        velocity_mps=np.zeros(3),
        quaternion_wxyz=quaternion_from_yaw(yaw_rad),
        body_rate_radps=np.zeros(3),
    )


def flown(*times_s: float) -> Flown:
    """On the spot, at the start."""
    count = len(times_s)
    place_m = np.tile(START_M, (count, 1))
    return Flown(np.array(times_s), place_m, np.tile(quaternion_from_yaw(0.0), (count, 1)), place_m)


def seen_at(time_s: float, here: State, field: DistanceField = HALL.field) -> Observation:
    observation = observe(field, change(field, field), time_s=time_s)
    return replace(observation, state=here, flight_bounds_m=HALL.flight_bounds_m, time_s=time_s)


def with_balls(places_m: np.ndarray) -> DistanceField:
    """The hall's field with a ball of 0.25 m at each of the places (N, 3)."""
    live = HALL.field
    distance, state = live.distance.copy(), live.state.copy()
    centres = live.voxel_centres_m(np.arange(live.distance.size))
    for place in places_m:
        ball = (np.linalg.norm(centres - place, axis=1) < 0.25).reshape(live.distance.shape)
        state[ball] = OCCUPIED
        distance[ball] = -0.05
    return replace(live, distance=distance, state=state)


def visit(guide: TourGuide, field: DistanceField = HALL.field, limit: int = 4000) -> list[Goal]:
    """Fly as if by magic: be at each goal at once, with the yaw that is asked for."""
    here, goals = state(START_M), []
    for step in range(limit):
        goal = guide.select(seen_at(0.2 * step, here, field))
        if guide.finished:
            return goals
        if goal is not None:
            if not goals or not np.array_equal(goals[-1].position_m, goal.position_m):
                goals.append(goal)
            here = state(goal.position_m, goal.yaw_rad if np.isfinite(goal.yaw_rad) else 0.0)
    raise AssertionError("the visit does not end")


@pytest.mark.parametrize("adaptation", [True, False])
def test_every_viewpoint_is_visited_in_the_order_planned(adaptation: bool) -> None:
    _, guide = begun(view_adaptation=adaptation, rounds=0)
    goals = visit(guide)
    order = guide.plan.order
    wanted = guide.plan.viewpoints.position_m[order]
    wanted = wanted[np.concatenate([[True], np.any(np.diff(wanted, axis=0) != 0.0, axis=1)])]
    np.testing.assert_array_equal([goal.position_m for goal in goals], wanted)
    assert (np.diff(guide.visited_s[order]) >= 0.0).all()
    assert np.isfinite(guide.visited_s).all()
    assert guide.plan.surface.area_m2[guide.scanned & guide.plan.coverable].sum() >= 0.98 * (
        guide.plan.surface.area_m2[guide.plan.coverable].sum()
    )


def test_between_viewpoints_the_vehicle_looks_ahead_unless_it_may_look_anywhere() -> None:
    far = seen_at(0.0, state(ABOVE_M))
    for look, finite in (("ahead", False), ("adaptive", True)):
        goal = begun(look=look)[1].select(far)
        assert goal is not None
        assert np.isfinite(goal.yaw_rad) == finite


def test_a_goal_without_a_plan_is_tried_once_more_and_then_given_up() -> None:
    _, guide = begun(rounds=0)
    first = int(guide.plan.order[0])
    place = guide.plan.viewpoints.position_m[first]
    here = state(ABOVE_M)
    assert np.array_equal(guide.select(seen_at(0.0, here)).position_m, place)
    guide.reject(place, 0.0)
    assert not np.array_equal(guide.select(seen_at(0.0, here), fresh=True).position_m, place)
    visited = visit(guide)
    assert np.array_equal(visited[-1].position_m, place)  # last of all, and now reached
    assert np.isfinite(guide.visited_s).all()


def test_all_goals_rejected_twice_end_the_inspection() -> None:
    _, guide = begun(rounds=0)
    here = state(ABOVE_M)
    for step in range(4 * len(guide.plan.viewpoints)):
        goal = guide.select(seen_at(5.0 * step, here))
        if goal is None:
            break
        guide.reject(goal.position_m, 5.0 * step)
    assert guide.finished
    assert np.isinf(guide.visited_s).all()


def test_viewpoints_that_the_live_map_blocks_are_left_out() -> None:
    _, guide = begun(rounds=0)
    places = guide.plan.viewpoints.position_m
    near = np.linalg.norm(places - places[guide.plan.order[1]], axis=1) < 0.5
    goals = visit(guide, with_balls(places[near]))
    assert np.isinf(guide.visited_s[near]).all()
    assert np.isfinite(guide.visited_s[~near]).all()
    assert not any((goal.position_m == places[near]).all(axis=1).any() for goal in goals)


def test_all_blocked_viewpoints_gain_weight_not_only_the_next() -> None:
    """The view is that of algorithm 2 with every viewpoint on which the live map shows an obstacle."""
    _, guide = begun(rounds=0, occluded_weight=50.0, look="adaptive")
    plan, first = guide.plan, guide.plan.order[0]
    live = with_balls(plan.viewpoints.position_m[plan.order[-3:]])
    blocked = blocked_viewpoints(live, plan.viewpoints, 0.3)
    assert not blocked[first], "the next one is free"
    assert blocked[plan.order[-3:]].all()

    def best(here: Observation, blocked: np.ndarray) -> float:
        weight = cell_weights(plan.surface, plan.views, blocked, guide.scanned, guide.weights)
        nominal_rad, place_m = float(plan.viewpoints.yaw_rad[first]), here.state.position_m
        return choose_yaw(live_grid(live), guide.camera, plan.surface, weight, place_m, nominal_rad).yaw_rad

    differs = 0
    for time_s, x_m in enumerate((1.0, 1.5, 2.0, 2.5)):
        here = seen_at(float(time_s), state(np.array([x_m, 3.2, 1.3])), live)
        chosen = guide.select(here)
        assert chosen is not None
        assert chosen.yaw_rad == best(here, blocked)
        differs += chosen.yaw_rad != best(here, np.zeros_like(blocked))
    assert differs, "and it matters here"


def test_what_counts_as_blocked_is_what_no_plan_led_to_and_what_is_shown_but_not_what_was_visited() -> None:
    _, guide = begun(rounds=0)
    first, second, third = guide.plan.order[:3]
    places = guide.plan.viewpoints.position_m
    here = seen_at(0.0, state(START_M), with_balls(places[[second, third]]))
    assert guide.select(here) is not None
    guide.reject(places[first], 0.0)
    guide.visited_s[second] = 0.0
    assert guide._blocked_now(here)[[first, second, third]].tolist() == [True, False, True]


def test_the_mission_ends_with_the_visit_and_reports_what_was_seen() -> None:
    mission, guide = begun()
    assert mission.outcome(flown(0.0, 0.1), seen_at(0.0, state(START_M))) is None
    visit(guide)
    assert mission.outcome(flown(9.0, 9.1), seen_at(9.0, state(START_M))) == (0, Outcome.INSPECTED)
    findings = mission.findings()
    assert np.isfinite(findings.cell_seen_s).any()
    assert findings.cell_visible[np.isfinite(findings.cell_seen_s)].all()
    assert len(findings.cell_m) == len(findings.cell_seen_s) == len(findings.cell_visible)
    assert np.array_equal(findings.true_cell_seen_s, findings.cell_seen_s), "the map is the truth"
    assert np.array_equal(findings.true_cell_visible, findings.cell_visible)
    assert len(findings.viewpoint_m) == len(findings.viewpoint_yaw_rad) == len(findings.viewpoint_visited_s)


def test_nearest_neighbours_are_the_nearest() -> None:
    _, guide = begun(tour="nearest_neighbour", largest_outlier=1)
    plan = guide.plan
    order = nearest_order(plan.start_travel_m, travel_matrix(plan.lattice, plan.viewpoints.position_m))
    assert sorted(order) == list(range(len(plan.viewpoints)))
    legs = [plan.start_travel_m, *plan.travel_m[order[:-1]]]
    for n, (leg, stop) in enumerate(zip(legs, order, strict=True)):
        assert leg[stop] == min(leg[left] for left in order[n:])


def test_a_vehicle_that_fits_nowhere_gets_a_clear_end() -> None:
    with pytest.raises(WorldError, match="no viewpoint is within reach"):
        begun(clearance_m=1.9)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"blocks": -1}, "blocks must be 0 to 100"),
        ({"block_width_m": (0.8, 0.3)}, "block_width_m must be"),
        ({"gone_share": 1.5}, "gone_share must be 0 to 1"),
        ({"tour": "random"}, "tour must be lin_kernighan"),
        ({"look": "back"}, "look must be ahead"),
        ({"overlap": 1.0}, "overlap must be"),
        ({"occluded_weight": 0.5}, "weights must rise"),
        ({"range_m": 0.1}, "min_range_m must be"),
        ({"dwell_s": 0.0}, "dwell_s must be > 0"),
    ],
)
def test_impossible_parameters_are_refused(values: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        Inspect(**values)


@pytest.mark.parametrize(
    ("typed", "world"),
    [
        ("mission=inspect", "facility"),
        ("strategy=inspect", "facility"),
        ("mission=inspect world=rooms", "rooms"),
        ("mission=goto", "warehouse"),
    ],
)
def test_an_inspection_is_flown_in_the_facility_unless_told_otherwise(typed: str, world: str) -> None:
    command = Composer().command(parse_settings(typed.split()))
    assert command.cells[0].options["world"] == world
