"""BARN's clock and metric, on flights whose answers are known by hand."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from tests.logs import make_log, make_world
from uavexp.log import Contact
from uavexp.metrics.evaluate import evaluate
from uavexp.types import Outcome
from uavexp.world.barn_layouts import layout

NUMBER = 108
OPTIMAL_S = layout(NUMBER).reference_path_m / 2.0  # 5.3 s
WORLD = dataclasses.replace(
    make_world([], start_m=(-2.25, 3.0, 1.2), target_m=(-2.25, 13.0, 1.2)), name=f"barn_{NUMBER}"
)


def rest(times_s):
    return np.zeros((len(times_s), 3))


def scores(speed_mps: float, outcome: Outcome = Outcome.REACHED, until_m: float = 10.0, **fields):
    """A flight straight to the target, at rest for 1 s; 8.9 m of it by the challenge's clock."""

    def position(times_s):
        way = np.clip(speed_mps * (times_s - 1.0), 0.0, until_m)
        return np.column_stack([np.full_like(way, -2.25), 3.0 + way, np.full_like(way, 1.2)])

    duration_s = 1.0 + 10.0 / speed_mps
    return evaluate(make_log(position, rest, duration_s=duration_s, outcome=outcome, **fields), WORLD)


@pytest.mark.parametrize("speed_mps", [0.15, 0.3, 0.5, 2.0])
def test_the_clock_runs_from_a_decimetre_off_the_start_to_a_metre_off_the_target(speed_mps):
    assert scores(speed_mps)["barn_time_s"] == pytest.approx(8.9 / speed_mps, abs=0.02)


def test_the_metric_is_optimal_over_actual_time_between_its_clips():
    assert scores(2.0)["barn_score"] == pytest.approx(0.5)
    assert scores(2.0)["barn_score_4"] == pytest.approx(0.25)
    middle = 8.9 / (3.0 * OPTIMAL_S)  # of three optimal times
    assert scores(middle)["barn_score"] == pytest.approx(1 / 3, abs=1e-3)
    assert scores(middle)["barn_score_4"] == pytest.approx(0.25)
    slow = 8.9 / (12.0 * OPTIMAL_S)
    assert scores(slow)["barn_score"] == pytest.approx(0.125)


def test_a_contact_a_failure_and_a_hundred_seconds_score_nothing():
    touch = Contact(start_s=1.0, end_s=1.1, position_m=np.zeros(3))
    touched, late = scores(2.0, contacts=(touch,)), scores(0.088)
    stopped = scores(2.0, outcome=Outcome.STUCK, until_m=5.0)
    for flown in (touched, late, stopped):
        assert flown["barn_score"] == flown["barn_score_4"] == 0.0
    assert [flown["barn_collided"] for flown in (touched, late, stopped)] == [True, False, False]
    assert math.isnan(stopped["barn_time_s"])


def test_other_worlds_have_no_such_columns():
    assert not [name for name in evaluate(make_log(rest, rest), make_world([])) if name.startswith("barn")]
