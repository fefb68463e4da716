"""Figures of a plan against polynomials whose speed, acceleration and length are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.logs import changed, make_log, make_world, still_curve
from uavexp.log import TrialLog
from uavexp.metrics.evaluate import evaluate
from uavexp.metrics.metric import Flight, Values, measured
from uavexp.metrics.plan import METRICS, stretches
from uavexp.types import World


def figures(log: TrialLog, world: World) -> Values:
    return measured(METRICS, Flight(log=log, world=world))


def planned(coefficients: list[list[list[float]]], breaks_s: list[float], **limits: float):
    return changed(
        make_log(still_curve(), still_curve()),
        plan_path_m=np.array([[0.0, 6.0, 1.2], [3.0, 2.0, 1.2]]),
        plan_breaks_s=np.array(breaks_s),
        plan_coefficients=np.array(coefficients),
        body_radius_m=0.25,
        **{"max_speed_mps": 9.0, "max_acceleration_mps2": 9.0} | limits,
    )


def cubic(**limits: float):
    """x = t³/6 over 4 s: speed t²/2, acceleration t, length 32/3."""
    return planned([[[0, 6, 1.2], [0, 0, 0], [0, 0, 0], [1 / 6, 0, 0]]], [0.0, 4.0], **limits)


def test_a_cubic_has_the_speed_acceleration_and_length_of_its_formula() -> None:
    values = figures(cubic(), make_world([]))
    assert values["plan_max_speed_mps"] == pytest.approx(8.0)
    assert values["plan_max_acceleration_mps2"] == pytest.approx(4.0)
    assert values["plan_length_m"] == pytest.approx(64 / 6, rel=1e-9)
    assert values["plan_duration_s"] == 4.0
    assert values["plan_path_length_m"] == 5.0
    assert values["limit_violations"] == 0


@pytest.mark.parametrize(
    ("limits", "count"),
    [
        ({"max_speed_mps": 8.0, "max_acceleration_mps2": 4.0}, 0),  # reached, not exceeded
        ({"max_speed_mps": 7.99}, 1),
        ({"max_acceleration_mps2": 3.99}, 1),
        ({"max_speed_mps": 2.0, "max_acceleration_mps2": 3.0}, 1),  # both at once are one stretch
    ],
)
def test_limits_count_once_for_each_stretch_beyond_them(limits: dict[str, float], count: int) -> None:
    assert figures(cubic(**limits), make_world([]))["limit_violations"] == count


def test_speeding_twice_with_a_slow_stretch_between_is_two_violations() -> None:
    speeds = [3.0, 1.0, 3.0]
    starts = np.concatenate([[0.0], np.cumsum(speeds)])
    pieces = [[[x, 6.0, 1.2], [v, 0.0, 0.0]] for x, v in zip(starts, speeds, strict=False)]
    log = planned(pieces, [0.0, 1.0, 2.0, 3.0], max_speed_mps=2.0)
    assert figures(log, make_world([]))["limit_violations"] == 2


def test_a_plan_through_a_post_collides_once_and_its_clearance_is_the_true_one() -> None:
    posts = [([4.0, 5.9, 0.0], [4.2, 6.1, 3.0]), ([8.0, 6.5, 0.0], [8.2, 6.7, 3.0])]
    line = planned([[[0.0, 6.0, 1.2], [1.0, 0.0, 0.0]]], [0.0, 10.0])
    values = figures(line, make_world(posts))
    assert values["plan_collisions"] == 1  # the second post stays 0.5 m away
    aside = figures(line, make_world(posts[1:]))
    assert aside["plan_collisions"] == 0
    assert aside["plan_min_clearance_m"] == pytest.approx(0.5, abs=1e-5)


def test_a_flight_without_a_plan_has_no_figures_of_one() -> None:
    values = evaluate(make_log(still_curve(), still_curve()), make_world([]))
    assert math.isnan(values["limit_violations"])
    assert math.isnan(values["plan_length_m"])


@pytest.mark.parametrize(("flags", "runs"), [([], 0), ([0, 0], 0), ([1, 1], 1), ([1, 0, 1], 2), ([0, 1], 1)])
def test_stretches_are_runs(flags: list[int], runs: int) -> None:
    assert stretches(np.array(flags, dtype=bool)) == runs
