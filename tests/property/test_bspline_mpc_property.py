"""Half spaces keep out of what they stand for; plans keep their promises among any boxes and movers."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from uavexp.check.fields import bounds, box, empty, field_from
from uavexp.planner.bspline_mpc import BsplineMpc
from uavexp.planner.mpc.regions import facing
from uavexp.trajectory import evaluate
from uavexp.types import Goal, Limits, PlanRequest, PlanStatus, Tracks

LIMITS = Limits(
    max_speed_mps=2.5, max_acceleration_mps2=2.5, max_body_rate_radps=2.0, body_size_m=(0.32, 0.32, 0.12)
)
PLANNER = BsplineMpc()

vectors = st.tuples(*3 * [st.floats(-3.0, 3.0)]).map(np.array)
sizes = st.tuples(*3 * [st.floats(0.1, 1.0)]).map(np.array)


@settings(deadline=None)  # the first example compiles a kernel
@given(vectors, vectors, sizes, st.floats(0.2, 1.5))
def test_half_space_excludes_the_grown_box_and_touches_it(
    apart: np.ndarray, relative: np.ndarray, half: np.ndarray, kept: float
) -> None:
    unit = facing(apart, relative, half, kept)
    assert abs(np.linalg.norm(unit) - 1.0) < 1e-9
    support = np.abs(unit) @ half + kept  # of the box grown by a ball, seen from its centre
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    assert (corners @ unit + kept).max() <= support + 1e-9
    outside = np.linalg.norm(apart - np.clip(apart, -half, half))
    if outside >= kept:  # then the vehicle is on the right side, by as much as it is outside
        assert abs(unit @ apart - support - (outside - kept)) < 1e-6


boxes = st.lists(
    st.tuples(st.floats(0.0, 7.5), st.floats(0.0, 5.5), st.floats(0.1, 1.5), st.floats(0.1, 1.5)), max_size=8
)
points = st.tuples(st.floats(0.1, 7.9), st.floats(0.1, 5.9), st.floats(0.4, 1.6))
directions = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-0.3, 0.3))
movers = st.lists(st.tuples(points, directions), max_size=3)


@settings(max_examples=40, deadline=None)
@given(boxes, points, points, directions, st.floats(0.0, 2.4), directions, st.booleans(), movers)
def test_plan_keeps_its_promises(
    scatter: list[tuple[float, float, float, float]],
    start: tuple[float, float, float],
    goal: tuple[float, float, float],
    heading: tuple[float, float, float],
    speed: float,
    push: tuple[float, float, float],
    target: bool,
    seen: list[tuple[tuple[float, float, float], tuple[float, float, float]]],
) -> None:
    grid = empty((8.0, 6.0, 2.0))
    for x, y, width, depth in scatter:
        box(grid, (x, y, 0.0), (x + width, y + depth, 2.0))
    field = field_from(grid)
    velocity = speed * np.array(heading) / max(1.0, float(np.linalg.norm(heading)))
    tracks = Tracks(
        time_s=1.0,
        identity=np.arange(len(seen)),
        position_m=np.array([place for place, _ in seen]).reshape(-1, 3),
        velocity_mps=np.array([moving for _, moving in seen]).reshape(-1, 3),
        covariance=np.tile(0.01 * np.eye(6), (len(seen), 1, 1)),
        half_size_m=np.full((len(seen), 3), 0.3),
    )
    request = PlanRequest(
        time_s=1.0,
        position_m=np.array(start),
        velocity_mps=velocity,
        acceleration_mps2=np.array(push),
        goal=Goal(position_m=np.array(goal), is_target=target, score=0.0),
        field=field,
        flight_bounds_m=bounds(grid),
        tracks=tracks,
    )
    PLANNER.reset(LIMITS, np.random.default_rng(0))
    result = PLANNER.plan(request)
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
    assert np.linalg.norm(velocities, axis=1).max() <= 2.5 * 1.03
    assert np.linalg.norm(accelerations, axis=1).max() <= 2.5 * (1.0 + 1e-6)
    clearance = field.distance_m(position)
    if clearance[0] >= 0.26:
        assert clearance.min() >= 0.25
    else:
        escaped = int(np.argmax(clearance >= 0.26))
        assert clearance[escaped:].min() >= 0.25
