"""Whatever the order of insertions and removals, the field is the exact transform of the occupancy."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.exact_distance import Replay, exact_field
from uavexp.field import FREE, OCCUPIED

shapes = st.tuples(*(st.integers(1, 11) for _ in range(3)))


@st.composite
def histories(draw):
    """A grid and a history of boxes that become occupied or free."""
    shape = draw(shapes)
    box = st.tuples(*(st.tuples(st.integers(0, n), st.integers(0, n)).map(sorted) for n in shape))
    steps = draw(st.lists(st.tuples(box, st.sampled_from([FREE, OCCUPIED])), min_size=1, max_size=8))
    return shape, steps


@given(history=histories(), reach=st.sampled_from([0.1, 0.25, 0.6, 1.3]))
@settings(max_examples=150, deadline=None)
def test_field_follows_any_history_of_boxes(history, reach):
    shape, steps = history
    replay = Replay(shape, reach)
    state = replay.state.copy()
    for box, value in steps:
        state[tuple(slice(low, high) for low, high in box)] = value
        replay.become(state)
        np.testing.assert_array_equal(replay.field.distance, exact_field(state == OCCUPIED, reach))


@given(history=histories())
@settings(max_examples=60, deadline=None)
def test_field_depends_on_the_occupancy_and_not_on_its_history(history):
    shape, steps = history
    state = np.zeros(shape, np.uint8)
    stepwise, at_once = Replay(shape), Replay(shape)
    for box, value in steps:
        state[tuple(slice(low, high) for low, high in box)] = value
        stepwise.become(state)
    at_once.become(state)
    np.testing.assert_array_equal(stepwise.field.distance, at_once.field.distance)


@given(history=histories(), axis=st.integers(0, 2))
@settings(max_examples=60, deadline=None)
def test_field_is_mirrored_and_turned_with_the_occupancy(history, axis):
    shape, steps = history
    state = np.zeros(shape, np.uint8)
    for box, value in steps:
        state[tuple(slice(low, high) for low, high in box)] = value
    order = np.roll(np.arange(3), axis)
    plain, moved = Replay(shape), Replay(tuple(shape[n] for n in order))
    plain.become(state)
    moved.become(np.ascontiguousarray(np.flip(state.transpose(order), axis)))
    np.testing.assert_array_equal(np.flip(moved.field.distance, axis), plain.field.distance.transpose(order))
