"""The least time between two states is a bound: no way round is faster."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from uavexp.planner.find.batch_tree.cubic_motion import cubic_time, least_time

states = st.lists(st.floats(-2.0, 2.0), min_size=6, max_size=6)


@settings(max_examples=200, deadline=None)
@given(states, states, states)
def test_least_time_is_a_bound_and_cubics_obey_it(a: list[float], b: list[float], c: list[float]) -> None:
    first, middle, last = np.array(a), np.array(b), np.array(c)
    through = cubic_time(first, middle, np.inf, 4.0, 2.5) + cubic_time(middle, last, np.inf, 4.0, 2.5)
    assert least_time(first, last, 4.0, 2.5) <= through * (1.0 + 1e-9)
