"""The free length between voxels is that of a whole search over the 26 neighbours."""

from __future__ import annotations

import heapq

import pytest

from uavexp.planner.find.octile import octile


def searched(goal: tuple[int, int, int]) -> float:
    """Dijkstra over the box around the ends, with exact steps."""
    span = [range(min(0, g), max(0, g) + 1) for g in goal]
    steps = [(a, b, c) for a in (-1, 0, 1) for b in (-1, 0, 1) for c in (-1, 0, 1) if (a, b, c) != (0, 0, 0)]
    best, queue = {(0, 0, 0): 0.0}, [(0.0, (0, 0, 0))]
    while queue:
        cost, at = heapq.heappop(queue)
        if at == goal:
            return cost
        for step in steps:
            to = (at[0] + step[0], at[1] + step[1], at[2] + step[2])
            if not all(place in axis for place, axis in zip(to, span, strict=True)):
                continue
            there = cost + sum(abs(part) for part in step) ** 0.5
            if there < best.get(to, float("inf")):
                best[to] = there
                heapq.heappush(queue, (there, to))
    raise AssertionError("no way")


@pytest.mark.parametrize("goal", [(5, 0, 0), (3, -3, 0), (2, 4, 6), (-3, 3, 3), (1, 0, -5), (4, 2, 2)])
def test_octile_is_the_shortest_way_in_free_space(goal: tuple[int, int, int]) -> None:
    assert octile(*goal) == pytest.approx(searched(goal))
