"""Regression: a goal where the vehicle already is gave a trajectory of 44 microseconds."""

from __future__ import annotations

import numpy as np
import pytest

from tests.unit.trigger.test_trigger import LIMITS
from uavexp.check.fields import bounds, empty, field_from
from uavexp.planner.min_acc import MinAcc
from uavexp.trajectory import evaluate
from uavexp.types import Goal, PlanRequest


@pytest.mark.parametrize("target", [False, True])
@pytest.mark.parametrize("offset_m", [0.0, 0.02, 0.2])
def test_a_goal_at_hand_keeps_state_and_limits(target: bool, offset_m: float) -> None:
    grid = empty((8.0, 6.0, 2.0))
    planner = MinAcc()
    planner.reset(LIMITS, np.random.default_rng(0))
    start = np.array([2.0, 1.0, 1.0])
    request = PlanRequest(
        time_s=1.0,
        position_m=start,
        velocity_mps=np.zeros(3),
        acceleration_mps2=np.array([1.0, 0.0, 0.0]),
        goal=Goal(position_m=start + np.array([offset_m, 0.0, 0.0]), is_target=target, score=0.0),
        field=field_from(grid),
        flight_bounds_m=bounds(grid),
    )
    trajectory = planner.plan(request).trajectory
    assert trajectory is not None
    assert trajectory.duration_s > 0.19
    times = np.linspace(trajectory.start_s, trajectory.end_s, 2001)
    position, velocity, acceleration = evaluate(trajectory, times)
    np.testing.assert_allclose(acceleration[0], request.acceleration_mps2, atol=1e-9)
    np.testing.assert_allclose(position[-1], request.goal.position_m, atol=1e-6)
    assert np.linalg.norm(velocity, axis=1).max() <= 2.5 * (1 + 1e-6)
    assert np.linalg.norm(acceleration, axis=1).max() <= 2.5 * (1 + 1e-6)
