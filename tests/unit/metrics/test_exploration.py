"""When how much of the reachable volume was seen, and what a vehicle did meanwhile, on made-up flights."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.logs import make_log, still_curve
from uavexp.log import TrialLog
from uavexp.metrics import exploration


def flight() -> TrialLog:
    """4 s of flight at 1 m/s, 2 s of turning at 0.5 rad/s, 4 s of waiting; a twentieth is seen at a time."""
    log = make_log(still_curve(), still_curve())
    time_s = 0.01 * np.arange(1001)
    moves = np.minimum(time_s, 4.0)
    yaw_rad = 0.5 * np.clip(time_s - 4.0, 0.0, 2.0)
    zero = np.zeros_like(time_s)
    steps = replace(
        log.steps,
        time_s=time_s,
        position_m=np.column_stack([moves, zero, zero]),
        velocity_mps=np.column_stack([np.where(time_s < 4.0, 1.0, 0.0), zero, zero]),
        quaternion_wxyz=np.column_stack([np.cos(yaw_rad / 2), zero, zero, np.sin(yaw_rad / 2)]),
    )
    tick_s = 0.1 * np.arange(20)
    ticks = replace(log.ticks, tick_s=tick_s, seen_so_far=0.05 * np.arange(20))
    return replace(log, step_s=0.01, steps=steps, ticks=ticks)


def test_time_and_path_are_those_of_the_first_update_that_saw_so_much() -> None:
    log = flight()
    assert exploration.time_to_s(log, 0.899) == pytest.approx(1.8)
    assert exploration.path_to_m(log, 0.899) == pytest.approx(1.8)
    assert math.isnan(exploration.time_to_s(log, 0.99))
    assert math.isnan(exploration.path_to_m(log, 0.99))


def test_the_share_over_time_is_that_of_the_last_update() -> None:
    shares = exploration.over_time(flight(), np.array([-1.0, 0.0, 0.25, 100.0]))
    np.testing.assert_allclose(shares, [0.0, 0.0, 0.1, 0.95])


def test_a_flight_turns_waits_or_moves() -> None:
    log = flight()
    assert exploration.turning_share(log) == pytest.approx(0.2, abs=0.003)
    assert exploration.waiting_share(log) == pytest.approx(0.4, abs=0.003)


def test_a_flight_with_a_target_has_none_of_these_columns() -> None:
    from tests.logs import make_world
    from uavexp.metrics.evaluate import evaluate

    log = make_log(still_curve(), still_curve())
    world = make_world([([3.0, 3.0, 0.0], [4.0, 4.0, 2.0])])
    columns = {metric.column for metric in exploration.METRICS}
    assert not columns & set(evaluate(log, world))
