"""What every estimator option keeps."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from tests.components import build, numbers, options
from uavexp.errors import ConfigError
from uavexp.seeding import Stream, generator
from uavexp.types import State

pytestmark = pytest.mark.parametrize("option", options("estimator"))


def still() -> State:
    return State(
        position_m=np.array([1.0, 2.0, 3.0]),
        velocity_mps=np.array([0.5, 0.0, -0.5]),
        quaternion_wxyz=np.array([np.cos(0.2), np.sin(0.2), 0.0, 0.0]),
        body_rate_radps=np.array([0.1, 0.2, 0.3]),
    )


def estimates(option, seed, count=200):
    estimator = build("estimator", option)
    estimator.reset(generator(seed, Stream.ESTIMATOR))
    return [estimator.estimate(still(), 0.01) for _ in range(count)]


def test_begins_at_the_truth(option):
    first = estimates(option, 0, 1)[0]
    np.testing.assert_allclose(first.position_m, still().position_m, atol=1e-3)
    np.testing.assert_allclose(first.quaternion_wxyz, still().quaternion_wxyz, atol=1e-3)


def test_same_seed_same_bytes(option):
    one, two = estimates(option, 3)[-1], estimates(option, 3)[-1]
    assert one.position_m.tobytes() == two.position_m.tobytes()
    assert one.quaternion_wxyz.tobytes() == two.quaternion_wxyz.tobytes()


def test_believed_velocity_is_the_rate_of_believed_position(option):
    moving, estimator, believed = still(), build("estimator", option), []
    estimator.reset(generator(1, Stream.ESTIMATOR))
    for k in range(100):
        state = State(
            position_m=moving.position_m + 0.01 * k * moving.velocity_mps,
            velocity_mps=moving.velocity_mps,
            quaternion_wxyz=moving.quaternion_wxyz,
            body_rate_radps=moving.body_rate_radps,
        )
        believed.append(estimator.estimate(state, 0.01))
    for before, after in pairwise(believed):
        rate = (after.position_m - before.position_m) / 0.01
        np.testing.assert_allclose(rate, before.velocity_mps, atol=1e-9)


def test_attitude_stays_a_unit_quaternion(option):
    for state in estimates(option, 2):
        assert np.linalg.norm(state.quaternion_wxyz) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("value", [-1.0, float("nan"), float("inf")])
def test_refuses_bad_numbers(option, value):
    for name in numbers(build("estimator", option)):
        with pytest.raises(ConfigError, match=r"must .*got"):
            build("estimator", option, **{name: value})
