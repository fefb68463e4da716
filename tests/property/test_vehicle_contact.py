"""Contact with one plane of any direction, where the answer is known in closed form."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from uavexp.geometry import rotation_from_quaternion
from uavexp.scene import Scene
from uavexp.space import Space
from uavexp.types import State
from uavexp.vehicle.contact import resolve

SIZE_M = (0.32, 0.32, 0.12)
component = st.floats(-1.0, 1.0)


@st.composite
def unit(draw, length):
    vector = np.array([draw(component) for _ in range(length)])
    norm = np.linalg.norm(vector)
    return vector / norm if norm > 0.1 else np.eye(length)[0]


def plane(normal) -> Scene:
    """Two triangles, 20 m wide, through the origin."""
    aside = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    aside /= np.linalg.norm(aside)
    along = np.cross(normal, aside)
    corners = 10.0 * np.array([aside, along, -aside, -along])
    mesh = SimpleNamespace(
        vertices_m=corners.astype(np.float32),
        triangles=np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        space=Space.all_free(),
    )
    return Scene(mesh)


@given(unit(3), unit(4), unit(4), unit(3), st.floats(0.0, 0.04), st.floats(0.1, 5.0))
@settings(max_examples=150, deadline=None)
def test_only_the_velocity_into_the_plane_is_lost(normal, q, turned_by, direction, gap_m, speed_mps):
    scene, rotation = plane(normal), rotation_from_quaternion(q)
    reach = 0.5 * np.abs(normal @ rotation) @ SIZE_M
    # a turn of up to 2 rad/s within the step
    turn = np.array([1.0, *(0.01 * turned_by[1:])])
    turn /= np.linalg.norm(turn)
    after_q = np.array(
        [
            q[0] * turn[0] - q[1:] @ turn[1:],
            *(q[0] * turn[1:] + turn[0] * q[1:] + np.cross(q[1:], turn[1:])),
        ]
    )
    velocity = speed_mps * direction
    before = State(
        position_m=(reach + gap_m + 1e-5) * normal,
        velocity_mps=velocity,
        quaternion_wxyz=q,
        body_rate_radps=np.zeros(3),
    )
    after = State(
        position_m=before.position_m + 0.01 * velocity,
        velocity_mps=velocity,
        quaternion_wxyz=after_q,
        body_rate_radps=np.zeros(3),
    )
    after_rotation = rotation_from_quaternion(after_q)
    after_reach = 0.5 * np.abs(normal @ after_rotation) @ SIZE_M
    state, touched = resolve(before, after, scene, SIZE_M)
    left = float(normal @ after.position_m) - after_reach
    if abs(left) > 1e-5:
        assert bool(touched) == (left < 0.0)
    if not touched:
        assert state is after
        return
    assert not scene.touches(
        state.position_m, rotation_from_quaternion(state.quaternion_wxyz), np.array(SIZE_M)
    )
    assert np.linalg.norm(state.velocity_mps) <= speed_mps + 1e-12
    # Open3D's nearest points are float32, and off by some 1e-5 m beside the edge of two triangles
    into = min(float(velocity @ normal), 0.0)
    np.testing.assert_allclose(state.velocity_mps, velocity - into * normal, atol=4e-3 * speed_mps)
    np.testing.assert_allclose(state.quaternion_wxyz, after_q, atol=1e-12)
    slid = state.position_m - before.position_m
    np.testing.assert_allclose(
        slid - (slid @ normal) * normal, 0.01 * (velocity - (velocity @ normal) * normal), atol=1e-4
    )
