"""The replanning policies against brute-force readings of their definitions."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from uavexp.check.hall import LIMITS, STRAIGHT, change, goal_at, observe, room
from uavexp.errors import ConfigError
from uavexp.field import DistanceField
from uavexp.map_change import changed_near, columns_near, map_near
from uavexp.trajectory import evaluate, sample_times
from uavexp.trigger.mcr import Mcr
from uavexp.trigger.ssp import Ssp
from uavexp.trigger.tbr import Tbr
from uavexp.types import Decision


def decide(policy: Mcr, before: DistanceField, after: DistanceField, **kwargs: object) -> Decision:
    policy.reset(LIMITS)
    policy.planned(STRAIGHT, before)
    return policy.decide(replace(observe(after, change(before, after)), **kwargs))


LITERAL = {
    "judge": "region",
    "since": "update",
    "goal_since": "update",
    "extent": "whole",
    "first_sight": "all",
    "sign": "both",
}


def mcr(**values: object) -> Mcr:
    """The policy with a horizon that holds the obstacles of these tests, 2 s ahead."""
    return Mcr(**{"horizon_s": 2.5, **values})


def test_changed_near_is_the_equation_by_brute_force() -> None:
    rng = np.random.default_rng(0)
    shape = np.array([9, 7, 5])
    voxel = np.sort(rng.choice(int(shape.prod()), 200, replace=False)).astype(np.int32)
    old, new = rng.uniform(0, 1, 200).astype(np.float32), rng.uniform(0, 1, 200).astype(np.float32)
    origin, points = np.array([-1.0, 2.0, 0.3]), rng.uniform(0, 1, (6, 3)) * [2, 2, 1] + [-1.0, 2.0, 0.3]
    for both in (False, True):
        near, largest = changed_near(voxel, old, new, shape, origin, 0.2, points, 0.5, 0.3, both)
        centres = origin + 0.2 * (np.stack(np.unravel_index(voxel, shape), axis=1) + 0.5)
        inside = (np.linalg.norm(centres[:, None] - points[None], axis=2) < 0.5).any(axis=1)
        drop = old.astype(float) - new.astype(float)
        size = np.abs(drop) if both else drop
        np.testing.assert_array_equal(near, voxel[inside & (size > 0.3)])
        assert largest == pytest.approx(size[inside].max())


def test_columns_near_hold_every_voxel_in_reach_and_few_others() -> None:
    field, rng = room(), np.random.default_rng(0)
    centres = field.voxel_centres_m(np.arange(field.state.size)).reshape(*field.state.shape, 3)
    for radius_m in (0.3, 0.95, 2.0):
        points_m = rng.uniform([-1.0, -1.0, 0.0], [8.0, 5.0, 2.0], (4, 3))  # outside of the map, too
        column = columns_near(field, points_m, radius_m)
        away_m = centres[..., None, :] - points_m
        inside = (np.linalg.norm(away_m, axis=-1) < radius_m).any(axis=(2, 3))
        assert set(np.flatnonzero(inside)) <= set(column)
        beside_m = np.abs(away_m[:, :, 0, :, :2]).max(axis=-1).min(axis=-1)
        assert (beside_m.reshape(-1)[column] < radius_m + 0.2).all()
        assert (np.diff(column) > 0).all()
        np.testing.assert_array_equal(map_near(field, column).state, field.state.reshape(70 * 40, 20)[column])


def test_changes_since_the_plan_are_those_of_the_whole_map_near_it() -> None:
    before, after = room(), room(((3.0, 3.2, 1.0), (3.2, 3.4, 1.2)), ((6.8, 0.0, 0.0), (7.0, 0.2, 2.0)))
    policy = mcr(judge="region", extent="whole", first_sight="all")
    voxel = np.flatnonzero(before.distance != after.distance).astype(np.int32)
    old, new = before.distance.ravel()[voxel], after.distance.ravel()[voxel]
    points_m = evaluate(STRAIGHT, sample_times(STRAIGHT, 1.0, 0.05))[0]
    shape = np.array(after.state.shape)
    expected, _ = changed_near(voxel, old, new, shape, after.origin_m, 0.1, points_m, 2.0, 0.15, False)
    assert 0 < len(expected) < len(voxel)
    np.testing.assert_array_equal(decide(policy, before, after).voxel, expected)


def test_literal_fires_on_any_voxel_in_the_tube_and_on_none_outside() -> None:
    free = room()
    beside = room(((3.0, 3.2, 1.0), (3.2, 3.4, 1.2)))  # 1.15 m from the path
    assert decide(mcr(**LITERAL), free, beside).cause == "map"
    assert not decide(mcr(**LITERAL, monitor_radius_m=0.5, delta_map_m=1.3), free, beside).replan


def test_path_rule_ignores_a_change_that_leaves_the_plan_valid() -> None:
    free = room()
    beside, on_it = room(((3.0, 3.2, 1.0), (3.2, 3.4, 1.2))), room(((3.0, 2.3, 1.0), (3.2, 2.5, 1.2)))
    assert not decide(mcr(), free, beside).replan
    fired = decide(mcr(), free, on_it)
    assert fired.replan
    assert fired.cause == "map"
    assert len(fired.voxel) > 0
    assert fired.score > 1.0


def test_path_rule_waits_until_the_violation_is_near() -> None:
    free, ahead = room(), room(((4.9, 2.0, 1.0), (5.1, 2.1, 1.2)))  # reached at about t = 5.5 s
    assert not decide(Mcr(horizon_s=2.0), free, ahead, time_s=1.5).replan
    assert decide(Mcr(horizon_s=2.0), free, ahead, time_s=4.0).replan
    assert decide(Mcr(horizon_s=5.0), free, ahead, time_s=1.5).replan


def test_a_small_drop_to_where_the_body_would_touch_is_enough() -> None:
    """0.25 m to 0.15 m: less than delta_map, but the body circle is 0.226 m."""
    near, nearer = room(((2.0, 2.3, 1.0), (3.0, 2.5, 1.2))), room(((2.0, 2.2, 1.0), (3.0, 2.5, 1.2)))
    assert decide(mcr(), near, nearer).replan
    assert not decide(mcr(), nearer, nearer).replan  # as planned


def test_only_the_remaining_trajectory_counts_unless_whole() -> None:
    free, behind = room(), room(((1.0, 2.0, 1.0), (1.2, 2.1, 1.2)))
    assert not decide(mcr(), free, behind, time_s=3.0).replan
    assert decide(mcr(extent="whole"), free, behind, time_s=3.0).replan


def test_changes_accumulate_since_the_plan_but_not_between_updates() -> None:
    """Two steps of 0.1 m are a drop of 0.2 m since the plan, and of 0.1 m since the update."""
    steps = [room(((2.0, y, 1.0), (3.0, y + 0.1, 1.1))) for y in (2.7, 2.6, 2.5)]
    for since, expected in (("plan", True), ("update", False)):
        policy = mcr(since=since, valid_clearance_m=0.6)
        policy.reset(LIMITS)
        policy.planned(STRAIGHT, steps[0])
        fired = [policy.decide(observe(b, change(a, b))).replan for a, b in pairwise(steps)]
        assert any(fired) is expected


def test_growing_clearance_is_no_contraction() -> None:
    near, free = room(((3.0, 2.3, 1.0), (3.2, 2.5, 1.2))), room()
    assert not decide(mcr(**{**LITERAL, "sign": "contraction"}), near, free).replan
    assert decide(mcr(**LITERAL), near, free).replan


@pytest.mark.parametrize(("first_sight", "expected"), [("none", False), ("occupied", True), ("all", True)])
def test_first_sights_count_as_configured(first_sight: str, expected: bool) -> None:
    free, wall = room(), room(((3.0, 2.0, 1.0), (3.2, 2.2, 1.2)))
    policy = mcr(**{**LITERAL, "first_sight": first_sight})
    policy.reset(LIMITS)
    policy.planned(STRAIGHT, free)
    assert policy.decide(observe(wall, change(free, wall, first_seen=True))).replan is expected


def test_first_seen_free_space_never_fires_the_default() -> None:
    free = room()
    update = replace(
        change(free, free),
        voxel=np.arange(100, dtype=np.int32),
        old_distance_m=np.full(100, 2.0, dtype=np.float32),
        new_distance_m=np.full(100, 0.5, dtype=np.float32),
        first_seen=np.ones(100, dtype=bool),
        occupied=np.zeros(100, dtype=bool),
    )
    for policy in (mcr(), mcr(judge="region", since="update")):
        policy.reset(LIMITS)
        policy.planned(STRAIGHT, free)
        assert not policy.decide(observe(free, update)).replan


def test_goal_drift_is_measured_against_the_flown_goal_or_the_previous_one() -> None:
    free = room()
    none = change(free, free)
    assert decide(mcr(), free, free, goal=goal_at(3.0), best_goal=goal_at(3.29)).replan is False
    drifted = decide(mcr(), free, free, goal=goal_at(3.0), best_goal=goal_at(3.31))
    assert drifted.cause == "goal"
    literal = mcr(**LITERAL)
    literal.reset(LIMITS)
    literal.planned(STRAIGHT, free)
    fired = [
        literal.decide(observe(free, none, goal=goal_at(0.0), best=goal_at(x))).replan
        for x in (3.0, 3.2, 3.6, 3.6)
    ]
    assert fired == [False, False, True, False]


def test_firing_is_monotone_in_the_thresholds() -> None:
    rng = np.random.default_rng(1)
    free = room()
    for _ in range(20):
        y = rng.uniform(2.2, 3.0)
        after = room(((3.0, y, 1.0), (3.2, y + 0.1, 1.2)))
        fired = [
            decide(mcr(delta_map_m=d, valid_clearance_m=0.8), free, after).replan
            for d in (0.05, 0.3, 0.9, 1.5)
        ]
        assert fired == sorted(fired, reverse=True)
        fired = [decide(mcr(valid_clearance_m=c), free, after).replan for c in (0.2, 0.4, 0.6, 0.9)]
        assert fired == sorted(fired)


def test_no_replan_within_the_least_interval() -> None:
    free, on_it = room(), room(((3.0, 2.0, 1.0), (3.2, 2.2, 1.2)))
    assert not decide(mcr(min_interval_s=0.6), free, on_it, time_s=1.5).replan
    assert decide(mcr(min_interval_s=0.4), free, on_it, time_s=1.5).replan


@pytest.mark.parametrize("interval_s", [0.5, 1.0, 0.7, 5.0])
def test_clock_fires_once_per_interval(interval_s: float) -> None:
    free = room()
    policy = Tbr(interval_s=interval_s)
    policy.reset(LIMITS)
    ticks = np.arange(301) * 0.1
    fired = [policy.decide(observe(free, change(free, free), time_s=t)).replan for t in ticks]
    assert sum(fired) == int(30.0 / interval_s + 1e-9)
    assert not fired[0]


def test_single_shot_never_replans() -> None:
    free, blocked = room(), room(((3.0, 2.0, 1.0), (3.2, 2.2, 1.2)))
    policy = Ssp()
    policy.reset(LIMITS)
    policy.planned(STRAIGHT, free)
    assert not policy.decide(observe(blocked, change(free, blocked), best=goal_at(9.0))).replan


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        ({"delta_map_m": -0.1}, "delta_map_m must be > 0"),
        ({"delta_goal_m": float("nan")}, "delta_goal_m must be > 0"),
        ({"monitor_radius_m": float("inf")}, "monitor_radius_m must be > 0 and finite"),
        ({"min_changed_voxels": 0}, "min_changed_voxels must be >= 1"),
        ({"judge": "corridor"}, "judge must be path | region, got 'corridor'"),
    ],
)
def test_bad_values_are_refused_by_name(bad: dict[str, object], words: str) -> None:
    with pytest.raises(ConfigError, match=words.replace("|", r"\|")):
        Mcr(**bad)
