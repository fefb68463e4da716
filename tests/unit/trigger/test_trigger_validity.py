"""The questions that policies share, against dense sampling, counting and closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavexp.braking import with_stop
from uavexp.check.fields import box, empty, field_from
from uavexp.check.hall import LIMITS, STRAIGHT, goal_at, observe, room
from uavexp.path_clearance import clearance_ahead_m
from uavexp.recorder import remaining_clearance_m
from uavexp.trajectory import Trajectory, evaluate
from uavexp.trigger.distance import flown_m
from uavexp.trigger.validity import comes_near, ends_within, goal_time_s, is_flown, is_older, unknown_count

PATHS = st.lists(st.floats(-0.5, 2.0), min_size=1, max_size=12).map(np.array)
FLOWN = with_stop(STRAIGHT, LIMITS)  # as the pilot flies it: 1 m/s at x = 5.5 m, then to rest


def circle(radius_m: float, rate_radps: float, duration_s: float) -> Trajectory:
    """An arc from t = 2 s on, as quintic Taylor pieces."""
    breaks_s = 2.0 + np.linspace(0.0, duration_s, 81)
    orders = np.arange(8)
    factorial = np.array([math.factorial(int(n)) for n in orders])
    angle = rate_radps * (breaks_s[:-1, None] - 2.0) + 0.5 * math.pi * orders
    scale = radius_m * rate_radps**orders / factorial
    arc = [scale * np.cos(angle), scale * np.sin(angle), np.zeros_like(angle)]
    return Trajectory(breaks_s=breaks_s, coefficients=np.stack(arc, axis=-1), at_rest=False)


class TestClearanceAhead:
    FIELD = room(((3.0, 1.5, 0.5), (3.4, 1.8, 1.5)), ((5.0, 2.4, 0.5), (5.2, 3.0, 1.5)))

    @pytest.mark.parametrize(("now_s", "horizon_s"), [(1.0, math.inf), (2.37, 1.2), (5.9, 0.5), (0.0, 3.0)])
    def test_its_least_value_is_that_of_dense_samples(self, now_s: float, horizon_s: float) -> None:
        ahead_m = clearance_ahead_m(FLOWN, self.FIELD, now_s, horizon_s)
        begin_s = max(now_s, FLOWN.start_s)
        dense_s = np.linspace(begin_s, min(begin_s + horizon_s, FLOWN.end_s), 5001)
        dense_m = self.FIELD.distance_m(evaluate(FLOWN, dense_s)[0])
        assert ahead_m[[0, -1]] == pytest.approx(dense_m[[0, -1]])
        # 1 m/s and a sample every 0.05 s: no point is further than 2.5 cm from one
        assert dense_m.min() <= ahead_m.min() + 1e-9 <= dense_m.min() + 0.025 + 1e-9

    def test_the_stop_behind_the_goal_belongs_to_it(self) -> None:
        end_m = evaluate(FLOWN, np.array([FLOWN.end_s]))[0]
        assert end_m[0, 0] > 5.6
        assert clearance_ahead_m(FLOWN, self.FIELD, 5.9)[-1] == self.FIELD.distance_m(end_m)[0]

    @pytest.mark.parametrize("now_s", [FLOWN.end_s, 99.0])
    def test_after_the_end_there_is_the_end(self, now_s: float) -> None:
        assert len(clearance_ahead_m(FLOWN, self.FIELD, now_s)) == 1


class TestRecorded:
    """What the log keeps of it: the same for every policy."""

    FIELD = TestClearanceAhead.FIELD

    def test_the_least_distance_of_the_rest_of_the_flown_trajectory(self) -> None:
        observation = observe(self.FIELD, time_s=3.2, trajectory=FLOWN)
        assert remaining_clearance_m(observation) == clearance_ahead_m(FLOWN, self.FIELD, 3.2).min()

    def test_nothing_when_nothing_is_flown(self) -> None:
        assert np.isnan(remaining_clearance_m(replace(observe(self.FIELD), trajectory=None)))
        assert np.isnan(remaining_clearance_m(observe(self.FIELD, time_s=FLOWN.end_s, trajectory=FLOWN)))


class TestComesNear:
    @pytest.mark.parametrize(
        ("clearance_m", "expected"),
        [
            ([1.0, 0.5, 0.3], False),
            ([1.0, 0.29, 0.8], True),
            ([0.2, 0.25, 0.35, 0.9], False),  # on its way out
            ([0.2, 0.18, 0.35, 0.9], False),  # no nearer than the map is exact to
            ([0.2, 0.1, 0.35, 0.9], True),  # nearer still
            ([0.2, 0.5, 0.25], True),  # out, and in again
            ([-0.1, 0.1, 0.5], False),
            ([0.2, 0.2, 0.2], False),
        ],
    )
    def test_a_way_out_is_allowed_an_approach_is_not(self, clearance_m: list[float], expected: bool) -> None:
        assert comes_near(np.array(clearance_m), 0.3) is expected

    @given(PATHS, st.floats(0.01, 1.0), st.floats(0.0, 1.0))
    def test_from_a_clear_start_it_is_the_least_distance(
        self, clearance_m: np.ndarray, limit_m: float, more_m: float
    ) -> None:
        clearance_m[0] = limit_m
        assert comes_near(clearance_m, limit_m) is bool((clearance_m < limit_m).any())
        assert comes_near(clearance_m + more_m, limit_m) <= comes_near(clearance_m, limit_m)

    @given(PATHS)
    def test_without_a_limit_nothing_is_near(self, clearance_m: np.ndarray) -> None:
        assert not comes_near(clearance_m, 0.0)


class TestTimes:
    def test_a_plan_is_flown_from_its_start_on(self) -> None:
        assert not is_flown(None, 1.0)
        assert not is_flown(STRAIGHT, 0.99)
        assert is_flown(STRAIGHT, 1.0)

    def test_age_is_exact_to_a_step_whatever_the_sums_of_steps(self) -> None:
        for step in range(1000):
            late = Trajectory(
                breaks_s=np.array([step * 0.01 + 0.03, 99.0]),
                coefficients=STRAIGHT.coefficients,
                at_rest=True,
            )
            assert is_older(late, (step + 3 + 150) * 0.01, 1.5)
            assert not is_older(late, (step + 3 + 149) * 0.01, 1.5)

    def test_the_goal_is_reached_where_the_stop_begins(self) -> None:
        assert FLOWN.end_s > 6.3
        assert goal_time_s(FLOWN, goal_at(5.5).position_m) == 6.0
        assert goal_time_s(STRAIGHT, goal_at(5.5).position_m) == 6.0

    def test_arrival_is_before_the_goal_and_holds_until_somebody_replans(self) -> None:
        times_s = np.arange(100, 800) * 0.01
        arrived = [ends_within(FLOWN, goal_at(5.5), float(t), 0.5) for t in times_s]
        np.testing.assert_array_equal(arrived, times_s > 5.5 + 1e-6)

    def test_nobody_arrives_at_the_target_or_without_a_goal(self) -> None:
        assert not ends_within(FLOWN, goal_at(5.5, is_target=True), 9.0, 0.5)
        assert not ends_within(FLOWN, None, 9.0, 0.5)


def test_flown_distance_is_the_length_of_the_arc() -> None:
    arc = circle(2.0, 0.5, 4.0)
    for now_s in (2.0, 2.9, 5.13, 6.0, 9.0):
        assert flown_m(arc, now_s) == pytest.approx(2.0 * 0.5 * (min(now_s, 6.0) - 2.0), rel=1e-5)


@pytest.mark.parametrize("seed", range(5))
def test_unknown_voxels_are_counted_in_the_ball_and_inside_the_grid(seed: int) -> None:
    rng = np.random.default_rng(seed)
    grid = empty((3.0, 2.0, 1.5))
    box(grid, (1.0, 1.0, 0.0), (1.5, 1.5, 1.5))
    origin_m = rng.normal(size=3)
    field = field_from(grid, origin_m=origin_m, unknown=~grid & (rng.random(grid.shape) < 0.4))
    for centre_m in origin_m + rng.uniform(-1.0, 3.5, (10, 3)):
        unknown = np.flatnonzero(field.state == 0)
        inside = np.linalg.norm(field.voxel_centres_m(unknown) - centre_m, axis=1) <= 0.8
        assert unknown_count(field, centre_m, 0.8) == inside.sum()
