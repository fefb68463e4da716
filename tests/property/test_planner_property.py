"""Any boxes, unknown space and movers, any start state: a plan keeps its promises or says why not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uavexp.arrays import Float
from uavexp.check.fields import bounds, box, empty, field_from
from uavexp.check.hall import LIMITS
from uavexp.parameters import Unknown
from uavexp.planner.base import Planner
from uavexp.planner.bspline_mpc import BsplineMpc
from uavexp.planner.bspline_qp import BsplineQp
from uavexp.planner.df_bitstar import DfBitstar
from uavexp.planner.find.tree import Edges, Tree
from uavexp.planner.min_acc import MinAcc
from uavexp.planner.shape.corridor_qp import CorridorQp, Derivative
from uavexp.trajectory import evaluate
from uavexp.types import Goal, PlanRequest, PlanStatus, Tracks

PLANNERS: dict[str, Planner] = {
    "min_acc": MinAcc(),
    "bspline_mpc": BsplineMpc(),
    **{
        f"bspline_qp {derivative} {unknown}": BsplineQp(
            shape=CorridorQp(derivative=derivative), unknown=unknown
        )
        for derivative in Derivative
        for unknown in Unknown
    },
    **{
        f"df_bitstar {edges}": DfBitstar(find=Tree(edges=edges, first_batches=8, batches=3, guide_batches=3))
        for edges in Edges
    },
}
SIZE_M = (8.0, 6.0, 2.0)
points = st.tuples(st.floats(0.1, 7.9), st.floats(0.1, 5.9), st.floats(0.4, 1.6))
directions = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-0.3, 0.3))
walls = st.tuples(st.floats(0.0, 7.5), st.floats(0.0, 5.5), st.floats(0.1, 1.5), st.floats(0.1, 1.5))


@st.composite
def requests(draw: Any, *, unknown: bool, movers: bool, push: bool) -> PlanRequest:
    grid = empty(SIZE_M)
    scatter = draw(st.lists(walls, max_size=10))
    for x, y, width, depth in scatter:
        box(grid, (x, y, 0.0), (x + width, y + depth, 2.0))
    unseen = empty(SIZE_M)
    if unknown and scatter:
        x, y, width, depth = scatter[0]
        box(unseen, (x - 0.7, y - 0.7, 0.3), (x + width, y + depth + 0.4, 1.2))
    heading = np.array(draw(directions))
    seen = draw(st.lists(st.tuples(points, directions), max_size=3)) if movers else []
    return PlanRequest(
        time_s=1.0,
        position_m=np.array(draw(points)),
        velocity_mps=draw(st.floats(0.0, 2.4)) * heading / max(1.0, float(np.linalg.norm(heading))),
        acceleration_mps2=np.array(draw(directions)) if push else np.zeros(3),
        goal=Goal(position_m=np.array(draw(points)), is_target=not push or draw(st.booleans()), score=0.0),
        field=field_from(grid, unknown=unseen & ~grid),
        flight_bounds_m=bounds(grid),
        tracks=Tracks(
            time_s=1.0,
            identity=np.arange(len(seen)),
            position_m=np.array([place for place, _ in seen]).reshape(-1, 3),
            velocity_mps=np.array([moving for _, moving in seen]).reshape(-1, 3),
            covariance=np.tile(0.01 * np.eye(6), (len(seen), 1, 1)),
            half_size_m=np.full((len(seen), 3), 0.3),
        ),
    )


def plan_of(name: str, request: PlanRequest) -> tuple[Float, Float, Float] | None:
    """Position, velocity and acceleration every millisecond; None when it is refused, with a reason."""
    planner = PLANNERS[name]
    planner.reset(LIMITS, np.random.default_rng(0))
    result = planner.plan(request)
    assert (np.diff(result.history[:, 1]) < 0.0).all()
    if result.status is not PlanStatus.OK:
        assert result.reason
        return None
    trajectory = result.trajectory
    assert trajectory is not None
    return evaluate(
        trajectory, np.append(np.arange(trajectory.start_s, trajectory.end_s, 1e-3), trajectory.end_s)
    )


@pytest.mark.parametrize("name", PLANNERS)
@settings(max_examples=20, deadline=None)
@given(st.data())
def test_plan_keeps_its_promises(name: str, data: st.DataObject) -> None:
    tree = name.startswith("df_bitstar")
    drawn = requests(unknown="bspline_qp" in name, movers=name == "bspline_mpc", push=not tree)
    request = data.draw(drawn)
    planned = plan_of(name, request)
    if planned is None:
        return
    position, velocity, acceleration = planned
    np.testing.assert_allclose(position[0], request.position_m, atol=1e-9)
    np.testing.assert_allclose(velocity[0], request.velocity_mps, atol=1e-6)
    np.testing.assert_allclose(acceleration[0], request.acceleration_mps2, atol=1e-5)
    np.testing.assert_allclose(position[-1], request.goal.position_m, atol=1e-6 if tree else 1e-9)
    beyond = 1.0 + 1e-6 if tree else 1.03 if name == "bspline_mpc" else 1.02
    # a start at full speed that still accelerates cannot help going a little beyond
    assert np.linalg.norm(velocity, axis=1).max() <= LIMITS.max_speed_mps * beyond
    assert np.linalg.norm(acceleration, axis=1).max() <= LIMITS.max_acceleration_mps2 * (1.0 + 1e-6)
    clearance = request.field.distance_m(position)
    # where the usual clearance finds no way, a lesser one is taken, slowly
    needed = 0.22 if np.linalg.norm(velocity, axis=1).max() <= 1.0 * beyond else 0.26
    kept = int(np.argmax(clearance >= needed))  # a start that is nearer may leave
    assert clearance[kept:].min() >= needed - 0.01
    if "conservative" in name and request.field.observed(position[:1])[0]:
        # planners look every quarter of a voxel: a corner of unknown space may be cut by no more
        inside = position[~request.field.observed(position)]
        around = inside[:, None] + 0.25 * request.field.voxel_size_m * np.vstack([np.eye(3), -np.eye(3)])
        assert request.field.observed(around.reshape(-1, 3)).reshape(-1, 6).any(axis=1).all()
