"""How long a blocked trajectory is flown on: the metrics, on logs made by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.logs import make_log, make_replan, make_world, still_curve
from uavexp.log import Contact
from uavexp.metrics.evaluate import evaluate
from uavexp.metrics.replanning import answers, request_delays

WORLD = make_world([])


class TestBlocked:
    """The trajectory ahead below the body's radius, at 10 Hz for 10 s."""

    def delays(self, *blocked, requests=(), contacts=(), **fields):
        """Metrics of a flight blocked from the first to before the last tick of each pair."""
        remaining_m = np.full(101, 0.5)
        for first, clear in blocked:
            remaining_m[first:clear] = 0.2
        log = make_log(
            still_curve(),
            still_curve(),
            remaining_clearance_m=remaining_m,
            replans=tuple(make_replan(0.01 * round(100 * t), "map", ok=ok) for t, ok in requests),
            contacts=tuple(Contact(start_s=t, end_s=t + 0.2, position_m=np.zeros(3)) for t in contacts),
            **fields,
        )
        values = evaluate(log, WORLD)
        return [values[f"blocked_{name}"] for name in ("episodes", "delay_s", "unanswered", "cleared")]

    def test_never_blocked(self):
        assert self.delays(requests=[(2.0, True)]) == [0, pytest.approx(math.nan, nan_ok=True), 0, 0]

    def test_an_answer_in_the_same_update_has_no_delay(self):
        assert self.delays((20, 21), requests=[(2.0, True)]) == [1, 0.0, 0, 0]

    def test_the_delay_runs_from_the_first_blocked_update_to_the_request(self):
        assert self.delays((20, 29), requests=[(2.8, True)]) == [1, pytest.approx(0.8), 0, 0]

    def test_the_first_of_several_requests_answers(self):
        many = [(1.0, True), (2.3, False), (2.6, True), (5.0, True)]
        assert self.delays((20, 29), requests=many) == [1, pytest.approx(0.3), 0, 0]

    def test_episodes_are_averaged(self):
        twice = self.delays((20, 25), (50, 60), requests=[(2.1, True), (5.5, True)])
        assert twice == [2, pytest.approx(0.3), 0, 0]

    def test_a_request_when_it_is_clear_again_is_no_answer(self):
        assert self.delays((20, 29), requests=[(1.9, True), (2.9, True)])[2:] == [0, 1]

    def test_a_contact_before_any_request_leaves_it_unanswered(self):
        assert self.delays((20, 60), contacts=[3.0], requests=[(3.5, True)])[2:] == [1, 0]
        assert self.delays((20, 60), contacts=[3.0], requests=[(2.5, True)])[1:3] == [pytest.approx(0.5), 0]

    def test_a_flight_that_ends_blocked_is_unanswered(self):
        assert self.delays((90, 101))[2:] == [1, 0]

    def test_blocked_begins_below_the_radius(self):
        assert self.delays((20, 30), body_radius_m=0.2)[0] == 0
        assert self.delays((20, 30), body_radius_m=0.2001)[0] == 1

    def test_no_trajectory_is_not_blocked(self):
        log = make_log(still_curve(), still_curve(), remaining_clearance_m=np.full(101, np.nan))
        assert evaluate(log, WORLD)["blocked_episodes"] == 0

    def test_a_log_that_did_not_measure_it_says_nothing(self):
        fields = {"body_radius_m": math.nan, "remaining_clearance_m": np.zeros(0)}
        assert math.isnan(
            evaluate(make_log(still_curve(), still_curve(), **fields), WORLD)["blocked_episodes"]
        )

    def test_requests_tell_the_delays_that_the_mean_is_made_of(self):
        """The first request since the same update answers; requests outside an episode have no delay."""
        rng = np.random.default_rng(11)
        told = 0
        for _ in range(50):
            remaining_m = np.where(np.repeat(rng.random(21) < 0.4, 5)[:101], 0.1, 0.5)
            times_s = np.sort(rng.choice(1001, 8, replace=False)) * 0.01
            log = make_log(
                still_curve(),
                still_curve(),
                remaining_clearance_m=remaining_m,
                replans=tuple(make_replan(float(t), "map") for t in times_s),
                contacts=tuple(
                    Contact(start_s=float(t), end_s=float(t) + 0.2, position_m=np.zeros(3))
                    for t in np.sort(rng.uniform(0.0, 10.0, 2))
                ),
            )
            delays = request_delays(log)
            for replan, delay in zip(log.replans, delays, strict=True):
                if not math.isnan(delay.delay_s):
                    assert delay.blocked_since_s + delay.delay_s == pytest.approx(replan.time_s)
                    since, until = np.round(10.0 * np.array([delay.blocked_since_s, replan.time_s]), 6)
                    assert (remaining_m[int(since) : int(until) + 1] < log.limits.body_radius_m).all()
                    told += 1
            first: dict[float, float] = {}
            for delay in delays:
                first.setdefault(delay.blocked_since_s, delay.delay_s)
            answered = [delay_s for since_s, delay_s in first.items() if not math.isnan(since_s)]
            mean_s = answers(log).delay_s
            assert mean_s == pytest.approx(np.mean(answered) if answered else math.nan, nan_ok=True)
        assert told > 50

    def test_every_episode_is_answered_unanswered_or_cleared(self):
        rng = np.random.default_rng(5)
        for _ in range(50):
            cuts = 12 * np.arange(8) + rng.integers(1, 11, 8)  # never empty, never touching
            requests = [(float(t), True) for t in np.sort(rng.choice(100, 5, replace=False)) * 0.1]
            times_s = rng.uniform(0.0, 10.0, 2).tolist()
            episodes, delay_s, silent, cleared = self.delays(
                *zip(cuts[::2], cuts[1::2], strict=True), requests=requests, contacts=times_s
            )
            assert episodes == 4
            assert math.isnan(delay_s) == (silent + cleared == episodes)
