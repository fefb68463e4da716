"""What every movers option keeps; found by glob."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.components import build, options
from tests.logs import make_world
from uavexp.scene import Scene
from uavexp.seeding import Stream, generator
from uavexp.types import Bodies, Limits
from uavexp.world.boxes import Boxes

pytestmark = pytest.mark.parametrize("option", options("movers"))

LIMITS = Limits(
    max_speed_mps=2.5, max_acceleration_mps2=2.5, max_body_rate_radps=2.0, body_size_m=(0.32, 0.32, 0.12)
)
SIZE_M = (14.0, 10.0, 3.0)


@pytest.fixture(scope="module")
def hall():
    made = Boxes()
    made.shell(SIZE_M)
    vertices, triangles = made.mesh()
    world = make_world(
        [([0, 0, 0], [1, 1, 1])], size_m=SIZE_M, start_m=(1.0, 5.0, 1.2), target_m=(13.0, 5.0, 1.2)
    )
    world = dataclasses.replace(world, vertices_m=vertices, triangles=triangles)
    return world, Scene(world)


@pytest.fixture
def given(option, tmp_path):
    """Values for parameters that have no default."""
    if option != "recorded":
        return {}
    file = tmp_path / "people.csv"
    rows = [f"{0.4 * k:.1f},{p},{4.0 + 0.3 * p},{0.2 * k}" for p in range(3) for k in range(40)]
    file.write_text("\n".join(["t_s,id,x_m,y_m", *rows]) + "\n")
    return {"path": str(file), "begin_s": 0.0}


def begin(option, given, hall, seed=0):
    movers = build("movers", option, **given)
    movers.reset(*hall, LIMITS, generator(seed, Stream.MOVERS))
    return movers


def same(a: Bodies, b: Bodies) -> bool:
    return all(
        getattr(a, name).tobytes() == getattr(b, name).tobytes()
        for name in ("shape", "half_size_m", "position_m", "velocity_mps")
    )


def test_the_same_bodies_in_the_same_order_all_flight_long(option, given, hall):
    movers = begin(option, given, hall)
    first = movers.at(0.0)
    for k in range(1, 3000, 50):
        bodies = movers.at(0.01 * k)
        assert bodies.time_s == pytest.approx(0.01 * k)
        np.testing.assert_array_equal(bodies.shape, first.shape)
        np.testing.assert_array_equal(bodies.half_size_m, first.half_size_m)
        assert np.isfinite(bodies.position_m).all()
        assert np.isfinite(bodies.velocity_mps).all()


def test_where_they_are_depends_on_time_and_seed_alone(option, given, hall):
    one, other = begin(option, given, hall), begin(option, given, hall)
    for k in range(0, 1500, 37):  # asked in order, and only at the end
        one.at(0.01 * k)
    assert same(one.at(14.99), other.at(14.99))
    assert same(one.at(0.5), other.at(0.5))


def test_a_reset_begins_anew(option, given, hall):
    movers = begin(option, given, hall, seed=2)
    before = movers.at(3.0)
    movers.reset(*hall, LIMITS, generator(2, Stream.MOVERS))
    assert same(before, movers.at(3.0))


def test_none_is_faster_than_the_vehicle(option, given, hall):
    movers = begin(option, given, hall)
    for k in range(0, 3000, 11):
        speed = np.linalg.norm(movers.at(0.01 * k).velocity_mps, axis=1)
        assert speed.max(initial=0.0) <= LIMITS.max_speed_mps
