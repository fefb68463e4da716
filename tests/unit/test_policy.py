"""What a policy sees: every number by its name, on a map and a plan that are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from uavexp.field import FREE, DistanceField
from uavexp.policy import AHEAD_S, CAUSE, FEATURES, PolicyTrigger
from uavexp.trajectory import Trajectory
from uavexp.types import Goal, Limits, MapUpdate, Observation, Reference, State, Tracks

SPEED_MPS, BEGIN_S, END_S, NOW_S = 2.0, 1.0, 5.0, 2.0
LIMITS = Limits(
    max_speed_mps=2.5, max_acceleration_mps2=3.0, max_body_rate_radps=3.0, body_size_m=(0.3, 0.3, 0.1)
)


def field_of(distance_m: float) -> DistanceField:
    """Everywhere so far from everything; seen up to x = 4 m."""
    shape = (120, 20, 20)
    state = np.zeros(shape, dtype=np.uint8)
    state[:40] = FREE
    return DistanceField(
        origin_m=np.array([0.0, -1.0, 0.0]), voxel_size_m=0.1, max_distance_m=2.0,
        distance=np.full(shape, distance_m, dtype=np.float32), state=state,
    )  # fmt: skip


def straight() -> Trajectory:
    """Along x from the origin at 2 m/s, 1 m high."""
    coefficients = np.array([[[0.0, 0.0, 1.0], [SPEED_MPS, 0.0, 0.0]]])
    return Trajectory(breaks_s=np.array([BEGIN_S, END_S]), coefficients=coefficients, at_rest=False)


def seen(field: DistanceField, plan: Trajectory | None) -> Observation:
    here_m = np.array([SPEED_MPS * (NOW_S - BEGIN_S), 0.3, 1.0])
    goals = [Goal(position_m=np.add(here_m, [0.0, 0.0, up]), is_target=False, score=0.0) for up in (3.0, 3.5)]
    zero = np.zeros(3)
    tracks = Tracks(
        time_s=NOW_S, identity=np.array([0]), position_m=np.add(here_m, [1.5, 2.0, 0.0])[None],
        velocity_mps=np.zeros((1, 3)), covariance=np.zeros((1, 6, 6)), half_size_m=np.ones((1, 3)),
    )  # fmt: skip
    voxel = np.arange(99, dtype=np.int32)
    return Observation(
        time_s=NOW_S,
        state=State(
            position_m=here_m, velocity_mps=np.array([0.0, 1.2, 0.0]),
            quaternion_wxyz=np.array([1.0, 0.0, 0.0, 0.0]), body_rate_radps=zero,
        ),
        reference=Reference(
            position_m=here_m - [0.0, 0.3, 0.0], velocity_mps=zero, acceleration_mps2=zero, yaw_rad=0.0
        ),
        trajectory=plan,
        field=field,
        update=MapUpdate(
            time_s=NOW_S, voxel=voxel, old_distance_m=np.zeros(99, np.float32),
            new_distance_m=np.zeros(99, np.float32), first_seen=np.zeros(99, bool),
            occupied=np.zeros(99, bool),
        ),
        goal=goals[0],
        best_goal=goals[1],
        target_m=None,
        flight_bounds_m=np.array([[0.0, -1.0, 0.0], [12.0, 1.0, 2.0]]),
        tracks=tracks,
    )  # fmt: skip


def asked(trigger: PolicyTrigger, now: DistanceField, plan: Trajectory | None) -> dict[str, float]:
    vectors: list[np.ndarray] = []
    trigger.policy = lambda vector: bool(vectors.append(vector))
    trigger.decide(seen(now, plan))
    return dict(zip((item.name for item in FEATURES), vectors[0].tolist(), strict=True)) if vectors else {}


@pytest.fixture
def trigger() -> PolicyTrigger:
    made = PolicyTrigger(lambda vector: True)
    made.reset(LIMITS)
    return made


def test_every_number_is_what_its_name_says(trigger):
    plan = straight()
    trigger.planned(plan, field_of(2.0))
    value = asked(trigger, field_of(1.2), plan)
    told = {
        "speed_mps": 1.2, "tracking_error_m": 0.3, "plan_age_s": NOW_S - BEGIN_S,
        "plan_left_s": END_S - NOW_S,
        "goal_m": 3.0, "goal_drift_m": 0.5, "target_m": 0.0, "changed_voxels_log10": 2.0, "mover_m": 2.5,
    }  # fmt: skip
    for name, number in told.items():
        assert value[name] == pytest.approx(number, abs=1e-6), name
    for at_s in AHEAD_S:
        assert value[f"clearance_{at_s:g}s_m"] == pytest.approx(1.2)
        assert value[f"lost_{at_s:g}s_m"] == pytest.approx(0.8)
        x_m = SPEED_MPS * (min(NOW_S + at_s, END_S) - BEGIN_S)
        assert value[f"seen_{at_s:g}s"] == float(x_m < 4.0), at_s


def test_nothing_is_lost_of_a_plan_that_is_still_to_come(trigger):
    plan = straight()
    later = Trajectory(breaks_s=plan.breaks_s + 2.0, coefficients=plan.coefficients, at_rest=False)
    trigger.planned(later, field_of(2.0))
    value = asked(trigger, field_of(1.2), plan)
    assert {value[f"lost_{at_s:g}s_m"] for at_s in AHEAD_S} == {0.0}


def test_nobody_is_asked_before_there_is_a_plan(trigger):
    assert asked(trigger, field_of(1.2), None) == {}
    trigger.planned(straight(), field_of(2.0))
    assert asked(trigger, field_of(1.2), None) == {}


def test_a_yes_is_a_replan_with_its_cause(trigger):
    trigger.planned(straight(), field_of(2.0))
    decision = trigger.decide(seen(field_of(1.2), straight()))
    assert (decision.replan, decision.cause) == (True, CAUSE)
    assert math.isfinite(decision.score)
