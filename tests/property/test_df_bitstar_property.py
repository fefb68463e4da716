"""Any scatter of boxes, any start state: a plan keeps its promises or says why there is none."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from uavexp.check.fields import bounds, box, empty, field_from
from uavexp.planner.df_bitstar import DfBitstar
from uavexp.planner.find.batch_tree.cubic_motion import cubic_time, least_time
from uavexp.planner.find.tree import Edges, Tree
from uavexp.trajectory import evaluate
from uavexp.types import Goal, Limits, PlanRequest, PlanStatus

LIMITS = Limits(
    max_speed_mps=2.5, max_acceleration_mps2=2.5, max_body_rate_radps=2.0, body_size_m=(0.32, 0.32, 0.12)
)
PLANNERS = {
    edges: DfBitstar(find=Tree(edges=edges, first_batches=8, batches=3, guide_batches=3)) for edges in Edges
}
for planner in PLANNERS.values():
    planner.reset(LIMITS, np.random.default_rng(0))

boxes = st.lists(
    st.tuples(st.floats(0.0, 7.5), st.floats(0.0, 5.5), st.floats(0.1, 1.5), st.floats(0.1, 1.5)), max_size=10
)
points = st.tuples(st.floats(0.1, 7.9), st.floats(0.1, 5.9), st.floats(0.4, 1.6))
directions = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-0.3, 0.3))
states = st.lists(st.floats(-2.0, 2.0), min_size=6, max_size=6)


@settings(max_examples=40, deadline=None)
@given(boxes, points, points, directions, st.floats(0.0, 2.4), st.sampled_from(Edges))
def test_plan_keeps_its_promises(
    scatter: list[tuple[float, float, float, float]],
    start: tuple[float, float, float],
    goal: tuple[float, float, float],
    heading: tuple[float, float, float],
    speed: float,
    edges: Edges,
) -> None:
    grid = empty((8.0, 6.0, 2.0))
    for x, y, width, depth in scatter:
        box(grid, (x, y, 0.0), (x + width, y + depth, 2.0))
    field = field_from(grid)
    velocity = speed * np.array(heading) / max(1.0, float(np.linalg.norm(heading)))
    request = PlanRequest(
        time_s=1.0,
        position_m=np.array(start),
        velocity_mps=velocity,
        acceleration_mps2=np.zeros(3),
        goal=Goal(position_m=np.array(goal), is_target=True, score=0.0),
        field=field,
        flight_bounds_m=bounds(grid),
    )
    result = PLANNERS[edges].plan(request)
    assert (np.diff(result.history[:, 1]) < 0.0).all()
    if result.status is not PlanStatus.OK:
        assert result.reason
        return
    trajectory = result.trajectory
    assert trajectory is not None
    times = np.append(np.arange(trajectory.start_s, trajectory.end_s, 1e-3), trajectory.end_s)
    position, velocities, accelerations = evaluate(trajectory, times)
    np.testing.assert_allclose(position[0], start, atol=1e-9)
    np.testing.assert_allclose(velocities[0], velocity, atol=1e-6)
    np.testing.assert_allclose(position[-1], goal, atol=1e-6)
    assert np.linalg.norm(velocities, axis=1).max() <= 2.5 * (1.0 + 1e-6)
    assert np.linalg.norm(accelerations, axis=1).max() <= 2.5 * (1.0 + 1e-6)
    clearance = field.distance_m(position)
    if clearance[0] >= 0.26:
        assert clearance.min() >= 0.25


@settings(max_examples=200, deadline=None)
@given(states, states, states)
def test_least_time_is_a_bound_and_cubics_obey_it(a: list[float], b: list[float], c: list[float]) -> None:
    first, middle, last = np.array(a), np.array(b), np.array(c)
    through = cubic_time(first, middle, np.inf, 4.0, 2.5) + cubic_time(middle, last, np.inf, 4.0, 2.5)
    assert least_time(first, last, 4.0, 2.5) <= through * (1.0 + 1e-9)
