"""Half spaces keep out of what they stand for."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from uavexp.planner.mpc.regions import facing

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
