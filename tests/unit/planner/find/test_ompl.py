"""OMPL's planners in their own process: reproducible, on the same map, gone with their parent."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from uavexp.arrays import Float
from uavexp.check.fields import bounds, box, empty, field_from
from uavexp.errors import ConfigError
from uavexp.geometry import polyline_length_m
from uavexp.planner.bitstar import Bitstar
from uavexp.planner.find import ompl_server
from uavexp.planner.find.free_space import FreeSpace, free_space, straight_is_free
from uavexp.planner.find.ompl_bitstar import OmplBitstar
from uavexp.planner.find.ompl_rrtstar import OmplRrtstar
from uavexp.planner.find.ompl_search import Query
from uavexp.planner.find.ompl_server import search_with_ompl
from uavexp.types import Goal, Limits, PlanRequest, PlanStatus

pytest.importorskip("ompl")

LIMITS = Limits(
    max_speed_mps=2.5, max_acceleration_mps2=2.5, max_body_rate_radps=2.0, body_size_m=(0.32, 0.32, 0.12)
)
START, GOAL = np.array([1.0, 1.0, 1.2]), np.array([5.0, 1.0, 1.2])
GRID = empty((6.0, 4.0, 2.4))
box(GRID, (3.0, 0.0, 0.0), (3.2, 2.0, 2.4))


def space() -> FreeSpace:
    return free_space(field_from(GRID), np.stack([START, GOAL]), bounds(GRID), 0.26, 0.3, False)


def request(start: Float = START, goal: Float = GOAL) -> PlanRequest:
    return PlanRequest(
        time_s=0.0,
        position_m=start,
        velocity_mps=np.zeros(3),
        acceleration_mps2=np.zeros(3),
        goal=Goal(position_m=goal, is_target=True, score=0.0),
        field=field_from(GRID),
        flight_bounds_m=bounds(GRID),
    )


@pytest.mark.parametrize("planner", ["BITstar", "RRTstar"])
def test_same_seed_same_path_whatever_was_asked_before(planner: str) -> None:
    first, other, again = (search_with_ompl(Query(planner, {}, space(), seed, 1500)) for seed in (5, 6, 5))
    assert first.path.tobytes() == again.path.tobytes()
    assert first.path.tobytes() != other.path.tobytes()
    assert (first.iterations, first.checks) == (again.iterations, again.checks)
    np.testing.assert_array_equal(first.history[:, [0, 1, 3]], again.history[:, [0, 1, 3]])


@pytest.mark.parametrize("planner", ["BITstar", "RRTstar"])
def test_paths_are_free_and_cost_never_rises(planner: str) -> None:
    answer = search_with_ompl(Query(planner, {}, space(), 7, 1500))
    assert all(
        straight_is_free(space(), a, b)[0] for a, b in zip(answer.path[:-1], answer.path[1:], strict=True)
    )
    np.testing.assert_array_equal(answer.path[[0, -1]], [START, GOAL])
    assert (np.diff(answer.history[:, 1]) < 0.0).all()
    assert answer.history[-1, 1] == pytest.approx(polyline_length_m(answer.path), rel=1e-6)
    # straight to the wall's end and on, at no less than the clearance; at most a tenth longer
    shortest = 2.0 * float(np.hypot(2.0, 1.0))
    assert shortest < answer.history[-1, 1] < 1.2 * shortest


@pytest.mark.parametrize("finder", [OmplBitstar, OmplRrtstar])
def test_hopeless_requests_have_a_status(finder: type[OmplBitstar | OmplRrtstar]) -> None:
    made = Bitstar(find=finder())
    made.reset(LIMITS, np.random.default_rng(0))
    wall = np.array([3.1, 1.0, 1.2])
    assert made.plan(request(start=wall)).status is PlanStatus.START_BLOCKED
    assert made.plan(request(goal=wall)).status is PlanStatus.GOAL_BLOCKED
    none = Bitstar(find=finder(max_iterations=1))
    none.reset(LIMITS, np.random.default_rng(0))
    result = none.plan(request())
    assert result.status is PlanStatus.NO_PATH
    assert result.reason


def test_without_ompl_the_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ompl_server.importlib.util, "find_spec", lambda name: None)
    planner = Bitstar()
    planner.reset(LIMITS, np.random.default_rng(0))
    with pytest.raises(ConfigError, match=r"OMPL is not installed: pip install 'uavexp\[peers\]'"):
        planner.plan(request())


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="reads /proc")
def test_the_server_ends_with_its_parent_also_when_that_is_killed() -> None:
    code = (
        "from uavexp.planner.find.ompl_server import _server; import time\n"
        "print(_server().pid, flush=True); time.sleep(60)"
    )
    parent = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    server = Path("/proc") / parent.stdout.readline().strip()
    assert server.is_dir()
    parent.kill()
    parent.wait()
    parent.stdout.close()
    deadline = time.monotonic() + 50.0
    while server.is_dir() and "(zombie)" not in (server / "status").read_text():
        assert time.monotonic() < deadline, "the server outlived its parent"
        time.sleep(0.1)
