"""Any scatter of boxes and unknown space, any start state: a plan keeps its promises or says why not."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from uavexp.check.fields import bounds, box, empty, field_from
from uavexp.parameters import Unknown
from uavexp.planner.bspline_qp import BsplineQp
from uavexp.planner.shape.corridor_qp import CorridorQp, Derivative
from uavexp.trajectory import evaluate
from uavexp.types import Goal, Limits, PlanRequest, PlanStatus

LIMITS = Limits(
    max_speed_mps=2.5, max_acceleration_mps2=2.5, max_body_rate_radps=2.0, body_size_m=(0.32, 0.32, 0.12)
)
PLANNERS = [
    BsplineQp(shape=CorridorQp(derivative=derivative), unknown=unknown)
    for derivative in Derivative
    for unknown in Unknown
]
for planner in PLANNERS:
    planner.reset(LIMITS, np.random.default_rng(0))

boxes = st.lists(
    st.tuples(st.floats(0.0, 7.5), st.floats(0.0, 5.5), st.floats(0.1, 1.5), st.floats(0.1, 1.5)), max_size=10
)
points = st.tuples(st.floats(0.1, 7.9), st.floats(0.1, 5.9), st.floats(0.4, 1.6))
directions = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-0.3, 0.3))


@settings(max_examples=80, deadline=None)
@given(
    boxes,
    points,
    points,
    directions,
    st.floats(0.0, 2.4),
    directions,
    st.booleans(),
    st.sampled_from(PLANNERS),
)
def test_plan_keeps_its_promises(
    scatter: list[tuple[float, float, float, float]],
    start: tuple[float, float, float],
    goal: tuple[float, float, float],
    heading: tuple[float, float, float],
    speed: float,
    push: tuple[float, float, float],
    target: bool,
    planner: BsplineQp,
) -> None:
    grid = empty((8.0, 6.0, 2.0))
    for x, y, width, depth in scatter:
        box(grid, (x, y, 0.0), (x + width, y + depth, 2.0))
    unknown = empty((8.0, 6.0, 2.0))
    if scatter:
        x, y, width, depth = scatter[0]
        box(unknown, (x - 0.7, y - 0.7, 0.3), (x + width, y + depth + 0.4, 1.2))
    unknown &= ~grid
    field = field_from(grid, unknown=unknown)
    velocity = speed * np.array(heading) / max(1.0, float(np.linalg.norm(heading)))
    request = PlanRequest(
        time_s=1.0,
        position_m=np.array(start),
        velocity_mps=velocity,
        acceleration_mps2=np.array(push),
        goal=Goal(position_m=np.array(goal), is_target=target, score=0.0),
        field=field,
        flight_bounds_m=bounds(grid),
    )
    result = planner.plan(request)
    if result.status is not PlanStatus.OK:
        assert result.reason
        return
    trajectory = result.trajectory
    assert trajectory is not None
    times = np.append(np.arange(trajectory.start_s, trajectory.end_s, 1e-3), trajectory.end_s)
    position, velocities, accelerations = evaluate(trajectory, times)
    np.testing.assert_allclose(position[0], start, atol=1e-9)
    np.testing.assert_allclose(velocities[0], velocity, atol=1e-6)
    np.testing.assert_allclose(accelerations[0], push, atol=1e-5)
    np.testing.assert_allclose(position[-1], goal, atol=1e-9)
    # a start at full speed that still accelerates cannot help going a little beyond
    assert np.linalg.norm(velocities, axis=1).max() <= 2.5 * 1.02
    assert np.linalg.norm(accelerations, axis=1).max() <= 2.5 * (1.0 + 1e-6)
    clearance = field.distance_m(position)
    if clearance[0] >= 0.26:
        assert clearance.min() >= 0.25
    else:
        escaped = int(np.argmax(clearance >= 0.26))
        assert clearance[escaped:].min() >= 0.25
    if planner.unknown is Unknown.CONSERVATIVE and field.observed(position[:1])[0]:
        assert field.observed(position).all()
