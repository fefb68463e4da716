"""Metrics against curves whose length, speed, acceleration and jerk are known in closed form."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.logs import changed, empty_log, make_log, make_replan, make_world, still_curve
from uavexp.log import Contact, TrialLog
from uavexp.metrics.evaluate import evaluate
from uavexp.metrics.replanning import COUNTED
from uavexp.metrics.smoothness import derivative
from uavexp.types import Outcome

WORLD = make_world([])
RADIUS_M, RATE_RADPS, CLIMB_MPS = 2.0, 0.8, 0.3


def helix(times_s):
    angle = RATE_RADPS * times_s
    return np.stack([RADIUS_M * np.cos(angle), RADIUS_M * np.sin(angle), CLIMB_MPS * times_s], axis=1)


def helix_velocity(times_s):
    angle, speed = RATE_RADPS * times_s, RADIUS_M * RATE_RADPS
    return np.stack([-speed * np.sin(angle), speed * np.cos(angle), np.full(times_s.size, CLIMB_MPS)], axis=1)


def line(times_s):
    return np.outer(times_s, [0.6, 0.8, 0.0])


def line_velocity(times_s):
    return np.tile([0.6, 0.8, 0.0], (times_s.size, 1))


def polynomial_velocity(times_s):
    """v = (t, t², t³): ∫‖a‖² = T + 4T³/3 + 9T⁵/5 and ∫‖jerk‖² = 4T + 12T³."""
    return np.stack([times_s, times_s**2, times_s**3], axis=1)


class TestPath:
    def test_straight_line(self):
        values = evaluate(make_log(line, line_velocity), make_world([], shortest_m=8.0))
        assert values["path_length_m"] == pytest.approx(10.0, rel=1e-12)
        assert values["completion_time_s"] == pytest.approx(10.0, rel=1e-12)
        assert values["mean_speed_mps"] == pytest.approx(1.0, rel=1e-12)
        assert values["max_speed_mps"] == pytest.approx(1.0, rel=1e-12)
        assert values["shortest_path_m"] == 8.0
        assert values["detour"] == pytest.approx(1.25, rel=1e-12)

    def test_a_helix_is_as_long_as_its_unrolled_hypotenuse(self):
        values = evaluate(make_log(helix, helix_velocity), WORLD)
        speed_mps = math.hypot(RADIUS_M * RATE_RADPS, CLIMB_MPS)
        # a chord of angle δ is shorter than its arc by δ²/24
        assert values["path_length_m"] == pytest.approx(10.0 * speed_mps, rel=1e-5)
        assert values["max_speed_mps"] == pytest.approx(speed_mps, rel=1e-12)

    def test_mean_speed_counts_the_time_spent_hovering(self):
        def stops_halfway(times_s):
            return line(np.minimum(times_s, 5.0))

        values = evaluate(make_log(stops_halfway, line_velocity), WORLD)
        assert values["mean_speed_mps"] == pytest.approx(0.5, rel=1e-12)


class TestSuccessByPathLength:
    """SPL of a flight of 10 m where 8 m would do: 0.8, and 0 after a contact or when it did not arrive."""

    @staticmethod
    def spl(shortest_m, **fields):
        flown = {"outcome": Outcome.REACHED, **fields}
        return evaluate(make_log(line, line_velocity, **flown), make_world([], shortest_m=shortest_m)).get(
            "spl"
        )

    def test_is_the_shortest_over_the_flown_length(self):
        assert self.spl(8.0) == pytest.approx(0.8, rel=1e-12)

    def test_is_one_at_most(self):
        assert self.spl(12.0) == 1.0

    def test_is_nothing_without_success(self):
        assert self.spl(8.0, outcome=Outcome.TIMEOUT) == 0.0
        contact = Contact(start_s=1.0, end_s=1.1, position_m=np.zeros(3))
        assert self.spl(8.0, contacts=(contact,)) == 0.0

    def test_needs_a_shortest_path_and_a_target(self):
        assert math.isnan(self.spl(math.nan))
        assert self.spl(8.0, outcome=Outcome.EXPLORED, seen_share=0.9) is None


class TestSmoothness:
    def test_helix_has_the_centripetal_acceleration_and_its_jerk(self):
        values = evaluate(make_log(helix, helix_velocity), WORLD)
        acceleration, jerk = RADIUS_M * RATE_RADPS**2, RADIUS_M * RATE_RADPS**3
        assert values["acceleration_integral_m2ps3"] == pytest.approx(10.0 * acceleration**2, rel=1e-4)
        assert values["jerk_integral_m2ps5"] == pytest.approx(10.0 * jerk**2, rel=5e-3)

    def test_a_cubic_velocity_is_differentiated_exactly_up_to_both_ends(self):
        values = evaluate(make_log(still_curve(), polynomial_velocity, duration_s=2.0), WORLD)
        assert values["acceleration_integral_m2ps3"] == pytest.approx(
            2.0 + 4.0 * 2.0**3 / 3.0 + 9.0 * 2.0**5 / 5.0, rel=1e-4
        )
        assert values["jerk_integral_m2ps5"] == pytest.approx(4.0 * 2.0 + 12.0 * 2.0**3, rel=1e-4)

    @pytest.mark.parametrize("order", [1, 2])
    def test_agrees_with_scipys_savitzky_golay_filter(self, order):
        from scipy.signal import savgol_filter

        values = np.random.default_rng(1).normal(size=(200, 3))
        expected = savgol_filter(values, 25, 3, deriv=order, delta=0.01, axis=0, mode="interp")
        scale = np.abs(expected).max()
        np.testing.assert_allclose(derivative(values, 0.01, order), expected, atol=1e-9 * scale)

    def test_long_steps_have_a_window_of_five(self):
        from scipy.signal import savgol_filter

        values = np.random.default_rng(1).normal(size=(51, 3))
        expected = savgol_filter(values, 5, 3, deriv=1, delta=0.1, axis=0, mode="interp")
        np.testing.assert_allclose(derivative(values, 0.1, 1), expected, atol=1e-9 * np.abs(expected).max())

    def test_hovering_and_straight_flight_cost_nothing(self):
        values = evaluate(make_log(line, line_velocity), WORLD)
        assert values["acceleration_integral_m2ps3"] == pytest.approx(0.0, abs=1e-18)
        assert values["jerk_integral_m2ps5"] == pytest.approx(0.0, abs=1e-15)

    def test_the_references_own_acceleration_is_integrated_as_it_stands(self):
        log = make_log(line, line_velocity, reference_acceleration_mps2=np.full((1001, 3), 0.5))
        values = evaluate(log, WORLD)
        assert values["reference_acceleration_integral_m2ps3"] == pytest.approx(7.5, rel=1e-12)


class TestClearance:
    def test_smallest_true_and_mapped_clearance_over_all_rows(self):
        log = make_log(
            line,
            line_velocity,
            clearance_m=np.hypot(line(np.arange(1001) * 0.01)[:, 0] - 3.0, 0.25),  # past a post at 0.25 m
            esdf_clearance_m=np.append(np.full(100, 0.9), 0.4),
        )
        values = evaluate(log, WORLD)
        assert values["min_clearance_m"] == pytest.approx(0.25, abs=1e-12)
        assert values["min_clearance_esdf_m"] == 0.4
        # within sqrt(0.3² - 0.25²) of the post, at 0.6 m/s
        expected_s = 2.0 * math.sqrt(0.3**2 - 0.25**2) / 0.6
        assert values["safety_threshold_m"] == 0.30
        assert values["time_below_safety_s"] == pytest.approx(expected_s, abs=0.02)

    def test_time_below_grows_with_the_threshold(self):
        clearance_m = np.linspace(0.0, 1.0, 1001)
        log = make_log(line, line_velocity, clearance_m=clearance_m)
        times = [evaluate(log, WORLD, safety_threshold_m=m)["time_below_safety_s"] for m in (0.1, 0.3, 0.5)]
        assert times == pytest.approx([1.0, 3.0, 5.0], abs=0.011)

    def test_contacts_are_counted_and_timed(self):
        contacts = (
            Contact(start_s=1.0, end_s=1.5, position_m=np.zeros(3)),
            Contact(start_s=9.0, end_s=float("nan"), position_m=np.zeros(3)),  # lasts to the end
        )
        values = evaluate(make_log(line, line_velocity, contacts=contacts), WORLD)
        assert values["collision_count"] == 2
        assert values["contact_time_s"] == pytest.approx(1.5, rel=1e-12)


class TestSuccess:
    def test_arrival_is_told_in_truth_and_as_believed(self):
        world = make_world([], target_m=(6.0, 8.0, 0.0))  # the line's end after 10 s
        beside_m = np.array([0.0, 0.4, 0.3])
        log = make_log(line, line_velocity)
        drifted = changed(log, position_m=log.steps.position_m + beside_m)
        astray = changed(log, estimated_position_m=log.steps.position_m + beside_m)
        for flight, gap_m, believed in ((log, 0.0, 1.0), (drifted, 0.5, 1.0), (astray, 0.0, 0.0)):
            values = evaluate(flight, world)
            assert values["target_gap_m"] == pytest.approx(gap_m, abs=1e-12)
            assert values["believed_arrival"] == believed
        for touch_s, believed in ((9.6, 0.0), (9.8, 1.0)):  # at 1 m/s it is 0.3 m away after 9.7 s
            touch = Contact(start_s=touch_s, end_s=touch_s, position_m=np.zeros(3))
            assert evaluate(changed(log, contacts=(touch,)), world)["believed_arrival"] == believed
        exploring = evaluate(changed(log, seen_share=0.5), world)
        assert math.isnan(exploring["believed_arrival"])
        assert math.isnan(exploring["target_gap_m"])

    @pytest.mark.parametrize("outcome", list(Outcome))
    def test_success_is_arrival_without_contact(self, outcome):
        touch = (Contact(start_s=1.0, end_s=1.1, position_m=np.zeros(3)),)
        clean = evaluate(make_log(line, line_velocity, outcome=outcome), WORLD)
        touched = evaluate(make_log(line, line_velocity, outcome=outcome, contacts=touch), WORLD)
        assert clean["outcome"] == outcome.value
        assert clean["success"] is (outcome in (Outcome.REACHED, Outcome.EXPLORED, Outcome.INSPECTED))
        assert touched["success"] is False


class TestTracking:
    def test_a_constant_offset_is_the_error(self):
        reference_m = line(0.01 * np.arange(1001)) + np.array([0.03, 0.0, 0.04])
        values = evaluate(make_log(line, line_velocity, reference_position_m=reference_m), WORLD)
        assert values["tracking_error_m"] == pytest.approx(0.05, rel=1e-9)
        assert values["tracking_error_max_m"] == pytest.approx(0.05, rel=1e-9)

    def test_a_sine_has_the_rmse_of_its_amplitude_over_root_two(self):
        times_s = 0.01 * np.arange(1001)
        offset_m = np.zeros((1001, 3))
        offset_m[:, 1] = 0.2 * np.sin(2.0 * np.pi * times_s)
        values = evaluate(make_log(line, line_velocity, reference_position_m=line(times_s) + offset_m), WORLD)
        assert values["tracking_error_m"] == pytest.approx(0.2 / math.sqrt(2.0), rel=1e-3)
        assert values["tracking_error_max_m"] == pytest.approx(0.2, rel=1e-3)

    def test_the_estimates_error_is_no_part_of_tracking(self):
        estimated_m = line(0.01 * np.arange(1001)) + np.array([0.5, 0.0, 0.0])
        values = evaluate(make_log(line, line_velocity, estimated_position_m=estimated_m), WORLD)
        assert values["estimate_error_m"] == pytest.approx(0.5, rel=1e-9)
        assert values["tracking_error_m"] == 0.0


class TestReplans:
    REPLANS = (
        make_replan(0.0, "first"),
        make_replan(2.0, "map", path_change_m=0.5),
        make_replan(3.0, "goal", path_change_m=0.05),
        make_replan(4.0, "map", ok=False),
        make_replan(4.1, "retry", path_change_m=0.3),
        make_replan(5.0, "clock"),
        make_replan(9.98, "map"),  # would take effect after the end
    )

    def evaluate(self, *replans, **thresholds):
        return evaluate(make_log(line, line_velocity, replans=replans), WORLD, **thresholds)

    def test_counts_plans_that_took_effect_after_the_first(self):
        values = self.evaluate(*self.REPLANS)
        assert values["replans"] == 4
        assert values["replans_map"] == 1
        assert values["replans_goal"] == 1
        assert values["replans_clock"] == 1
        assert values["replans_other"] == 1
        assert sum(values[f"replans_{cause}"] for cause in COUNTED) == 4
        assert values["failed_plans"] == 1
        assert values["replans_per_m"] == pytest.approx(0.4, rel=1e-9)
        assert values["replans_per_s"] == pytest.approx(0.4, rel=1e-9)

    def test_a_first_plan_that_took_three_attempts_is_no_replan(self):
        values = self.evaluate(
            make_replan(0.0, "first", ok=False),
            make_replan(0.2, "retry", ok=False),
            make_replan(0.4, "retry"),
        )
        assert values["replans"] == 0
        assert values["failed_plans"] == 2

    def test_useful_replans_change_the_path(self):
        assert self.evaluate(*self.REPLANS)["useful_replans"] == 2
        assert self.evaluate(*self.REPLANS, useful_change_m=0.4)["useful_replans"] == 1

    def test_the_search_is_that_of_the_first_plan_found(self):
        asked = (make_replan(0.0, "first", ok=False, expansions=7), make_replan(0.2, "retry", expansions=9))
        way = np.array([[[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]])
        log = make_log(line, line_velocity, replans=asked)
        path_m = np.stack([way[0, 0], way[0].sum(axis=0)])
        found = replace(log.first_plan, breaks_s=np.array([0.2, 1.2]), coefficients=way, path_m=path_m)
        values = evaluate(replace(log, first_plan=found), WORLD)
        assert values["plan_iterations"] == 9

    def test_share_near_a_change_leaves_the_first_plan_out(self):
        values = self.evaluate(
            make_replan(0.0, "first", near_change=True),
            make_replan(1.0, "map", near_change=True),
            make_replan(2.0, "clock", near_change=True),
            make_replan(3.0, "goal"),
            make_replan(4.0, "clock"),
        )
        assert values["replans_near_change_share"] == 0.5

    def test_without_replans_the_share_does_not_exist(self):
        assert math.isnan(self.evaluate(make_replan(0.0, "first"))["replans_near_change_share"])


def moved(log: TrialLog, rotation, shift_m) -> TrialLog:
    """The same flight in a world turned and shifted."""
    turned = {
        name: getattr(log.steps, name) @ rotation.T + (shift_m if "position" in name else 0.0)
        for name in (
            "position_m",
            "velocity_mps",
            "estimated_position_m",
            "reference_position_m",
            "reference_acceleration_mps2",
        )
    }
    return changed(log, **turned)


def flight(**fields) -> TrialLog:
    rng = np.random.default_rng(3)
    return make_log(
        helix,
        helix_velocity,
        reference_position_m=helix(0.01 * np.arange(1001)) + rng.normal(scale=0.1, size=(1001, 3)),
        estimated_position_m=helix(0.01 * np.arange(1001)) + rng.normal(scale=0.1, size=(1001, 3)),
        reference_acceleration_mps2=rng.normal(size=(1001, 3)),
        clearance_m=rng.uniform(0.1, 1.0, 1001),
        **fields,
    )


def assert_same(one, other):
    assert one.keys() == other.keys()
    for name, value in one.items():
        assert other[name] == (
            pytest.approx(value, rel=1e-9, nan_ok=True) if isinstance(value, float) else value
        )


def test_metrics_do_not_depend_on_where_the_world_stands():
    angle = 0.7
    tilt = np.array([[1, 0, 0], [0, math.cos(0.4), -math.sin(0.4)], [0, math.sin(0.4), math.cos(0.4)]])
    turn = np.array(
        [[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1]]
    )
    log, turned, shift_m = flight(), turn @ tilt, np.array([5.0, -3.0, 2.0])
    elsewhere = replace(WORLD, target_m=turned @ WORLD.target_m + shift_m)
    assert_same(evaluate(log, WORLD), evaluate(moved(log, turned, shift_m), elsewhere))


def test_metrics_do_not_depend_on_when_the_flight_began():
    def at(begin_s):
        contact = Contact(start_s=begin_s + 2.0, end_s=begin_s + 2.5, position_m=np.zeros(3))
        replans = tuple(make_replan(begin_s + t, cause) for t, cause in ((0.0, "first"), (3.0, "map")))
        return evaluate(flight(begin_s=begin_s, contacts=(contact,), replans=replans), WORLD)

    assert_same(at(0.0), at(100.0))


@pytest.mark.parametrize("rows", [0, 1, 2, 5])
def test_a_log_cut_short_has_every_metric(rows):
    log = empty_log() if rows == 0 else make_log(line, line_velocity, duration_s=0.01 * (rows - 1))
    values = evaluate(log, WORLD)
    assert values.keys() == evaluate(make_log(line, line_velocity), WORLD).keys()
    assert values["path_length_m"] == pytest.approx(0.01 * max(rows - 1, 0))
    assert all(type(value) in (bool, int, float, str) for value in values.values())
    assert math.isnan(values["min_clearance_m"]) == (rows == 0)
