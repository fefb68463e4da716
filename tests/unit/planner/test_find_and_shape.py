"""Any finder with any shaper: every pair of conf/planner/find and conf/planner/shape plans one query."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from tests.components import build, options
from uavexp.check.fields import box, empty, field_from
from uavexp.check.hall import LIMITS
from uavexp.check.requests import ask
from uavexp.config.composition import Composer
from uavexp.config.overrides import parse_settings
from uavexp.errors import ConfigError
from uavexp.planner.find.turning import Turning
from uavexp.planner.find_and_shape import FindAndShape
from uavexp.planner.shape.scp import Scp
from uavexp.trajectory import evaluate
from uavexp.types import PlanStatus

FINDERS, SHAPERS = options("planner.find"), options("planner.shape")
UNCHECKED = ("waypoint_spline",)  # keeps neither limits nor clearance, for comparison


@pytest.mark.parametrize(("finder", "shaper"), list(product(FINDERS, SHAPERS)))
@pytest.mark.parametrize("speed", [0.0, 1.0])
def test_every_pair_keeps_limits_and_clearance(finder: str, shaper: str, speed: float) -> None:
    if finder.startswith("ompl"):
        pytest.importorskip("ompl")
    grid = empty((8.0, 6.0, 2.4))
    box(grid, (3.8, 0.0, 0.0), (4.2, 3.6, 2.4))
    field = field_from(grid)
    start, goal = np.array([1.0, 1.5, 1.2]), np.array([7.0, 1.5, 1.2])
    planner = FindAndShape(find=build("planner.find", finder), shape=build("planner.shape", shaper))
    planner.reset(LIMITS, np.random.default_rng(7))
    result = planner.plan(ask(field, start, goal, velocity_mps=np.array([speed, 0.0, 0.0])))
    assert result.status is PlanStatus.OK, result.reason
    assert result.trajectory is not None
    times_s = np.linspace(result.trajectory.start_s, result.trajectory.end_s, 2000)
    position, velocity, acceleration = evaluate(result.trajectory, times_s)
    np.testing.assert_allclose(position[[0, -1]], [start, goal], atol=1e-6)
    if shaper in UNCHECKED:
        return
    assert np.linalg.norm(velocity, axis=1).max() <= LIMITS.max_speed_mps * (1.0 + 1e-6)
    assert np.linalg.norm(acceleration, axis=1).max() <= LIMITS.max_acceleration_mps2 * (1.0 + 1e-6)
    assert field.distance_m(position).min() >= 0.25


def test_finder_and_shaper_are_chosen_like_a_group_and_set_like_a_parameter() -> None:
    settings = parse_settings(
        ["planner=min_acc", "planner.find=turning", "planner.find.turn_weight=0.7", "planner.shape=scp"]
    )
    planner = Composer().cell(settings).config["planner"]
    assert planner["find"]["_target_"] == f"{Turning.__module__}.Turning"
    assert planner["find"]["turn_weight"] == 0.7
    assert planner["shape"]["_target_"] == f"{Scp.__module__}.Scp"


@pytest.mark.parametrize(
    ("typed", "words"),
    [
        ("planner.find=tre", r"planner.find=tre: no such option \(did you mean 'tree'\?\)"),
        ("planner.find.turn_weight=1", "planner.find has no parameter 'turn_weight'"),
        ("planner.shape.tolerance=-1", "planner.shape.tolerance must be"),
        ("planner.find.max_expansions=0", "planner.find.max_expansions must be >= 1"),
    ],
)
def test_errors_say_what_may_be_typed(typed: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        Composer().cell(parse_settings(["planner=min_acc", typed]))


def test_what_an_option_does_not_hold_cannot_be_chosen() -> None:
    with pytest.raises(ConfigError, match=r"planner.shape=scp: planner=bspline_mpc holds no shape"):
        Composer().cell(parse_settings(["planner=bspline_mpc", "planner.shape=scp"]))
