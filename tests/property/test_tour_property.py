"""Tours of any costs: each node once, no longer than trivial ones, best possible when small."""

from __future__ import annotations

import itertools

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from uavexp.arrays import Float
from uavexp.inspection.tour import closed_tour, open_tour, tour_length

sizes = st.integers(1, 40)
seeds = st.integers(0, 2**32 - 1)


def metric(seed: int, size: int) -> Float:
    """Whole-number costs with many ties, no triangle inequality."""
    half = np.triu(np.random.default_rng(seed).integers(0, 12, (size, size)).astype(float), 1)
    return half + half.T


@settings(max_examples=60, deadline=None)
@given(seed=seeds, size=sizes)
def test_a_closed_tour_visits_each_node_once_and_beats_the_order_of_numbers(seed: int, size: int) -> None:
    cost = metric(seed, size)
    tour = closed_tour(cost, seed=seed, kicks=50)
    assert sorted(tour) == list(range(size))
    assert tour[0] == 0
    assert np.array_equal(tour, closed_tour(cost, seed=seed, kicks=50))
    if size > 4:
        best = tour_length(cost, np.arange(size), closed=True)
        assert tour_length(cost, tour, closed=True) <= best


@settings(max_examples=60, deadline=None)
@given(seed=seeds, size=st.integers(2, 40), fixed=st.booleans())
def test_an_open_tour_keeps_its_ends(seed: int, size: int, fixed: bool) -> None:
    end = size - 1 if fixed else None
    order = open_tour(metric(seed, size), end, kicks=50)
    assert sorted(order) == list(range(size))
    assert order[0] == 0
    assert not fixed or order[-1] == size - 1


@settings(max_examples=25, deadline=None)
@given(seed=seeds, size=st.integers(2, 8), fixed=st.booleans())
def test_small_open_tours_are_the_shortest(seed: int, size: int, fixed: bool) -> None:
    cost = metric(seed, size)
    ends = [size - 1] if fixed else range(1, size)
    best = min(
        tour_length(cost, np.array((0, *middle, end)), closed=False)
        for end in ends
        for middle in itertools.permutations(sorted(set(range(1, size)) - {end}))
    )
    found = tour_length(cost, open_tour(cost, size - 1 if fixed else None, kicks=300), closed=False)
    assert found <= best + 1e-9
