"""The oracle's count against every way of choosing when to replan."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from benchmarks.fewest_replans import fewest


def least(time_s: np.ndarray, seen_s: np.ndarray) -> int:
    """By trial: the smallest set of times such that every place lies in the plan flown there."""
    for count in range(len(time_s) + 1):
        for chosen in combinations(time_s, count):
            made_s = [max(t for t in (0.0, *chosen) if t <= now) for now in time_s]
            if all(seen <= made for seen, made in zip(seen_s, made_s, strict=True)):
                return count
    raise AssertionError


def test_is_the_least_of_all_choices() -> None:
    rng = np.random.default_rng(0)
    for _ in range(200):
        time_s = np.cumsum(rng.uniform(0.5, 1.5, 7))
        seen_s = np.maximum(time_s - rng.uniform(0.0, 4.0, 7), 0.0)
        assert fewest(time_s, seen_s, 0.0) == least(time_s, seen_s)


def test_all_seen_from_the_start_needs_none_and_a_sight_of_5_s_one_each_5_s() -> None:
    time_s = np.arange(0.0, 20.5, 0.5)
    assert fewest(time_s, np.zeros(41), 0.0) == 0
    assert fewest(time_s, np.maximum(time_s - 5.0, 0.0), 0.0) == 3
